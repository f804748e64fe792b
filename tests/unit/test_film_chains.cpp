// Markov chains as the farm knows them: records, the bootstrap's table, b, and how their film is read.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "common/chains/chains.h"
#include "common/chains/growth.h"
#include "common/film/codec.h"
#include "common/film/delta.h"
#include "common/film/development.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "common/stats/image_error.h"

namespace candela::chains {
namespace {

ChainRecord sample_record(std::uint64_t seed) {
  ChainRecord r;
  r.segments = 7 + seed;
  r.counts = {1000 + seed, 400, 300, 100, 12.5, 30.25, 17, 3, 4.5F, 6.25F};
  if (seed % 2 == 1)
    r.counts.by_mutation = {{"bidirectional", 400, 200, {10, 0, 0, 20, 3, 0}, 5000},
                            {"half_vector", 300, 100, {0, 7, 6, 5, 0, 1}, 9000}};
  if (seed % 3 == 0) r.counts.mollified = {0.25, 10.5, 20.25, 22.5, 700.125, seed % 5};
  r.state.assign(seed * 37 % 200, static_cast<char>('a' + seed % 20));
  return r;
}

// Claim: a record comes back as it was, alone and among others, and its length is what it is said to be.
TEST(ChainRecords, RoundTrip) {
  std::vector<ChainRecord> records;
  for (std::uint64_t i = 0; i < 20; ++i) {
    records.push_back(sample_record(i));
    const std::string bytes = encode(records.back());
    EXPECT_EQ(bytes.size(), encoded_bytes(records.back()));
    EXPECT_LE(bytes.size(), kMaxRecordBytes);
    const auto back = decode(bytes);
    ASSERT_TRUE(back.ok()) << back.error().to_string();
    EXPECT_EQ(*back, records.back());
  }
  const auto all = decode(encode(std::span<const ChainRecord>(records)), records.size());
  ASSERT_TRUE(all.ok()) << all.error().to_string();
  EXPECT_EQ(*all, records);
  ChainRecord largest;
  largest.state.assign(kMaxStateBytes, 'x');
  EXPECT_TRUE(decode(encode(largest)).ok());
}

// Claim: cut, lengthened and contradictory bytes are refused as input, naming the field.
TEST(ChainRecords, DamageIsRefused) {
  const std::string good = encode(sample_record(3));
  for (std::size_t n = 0; n < good.size(); ++n) EXPECT_FALSE(decode(good.substr(0, n)).ok()) << n << " bytes";
  EXPECT_FALSE(decode(good + 'x').ok());
  EXPECT_FALSE(decode('x' + good).ok());
  const auto spoiled = [](auto spoil) {
    ChainRecord r = sample_record(3);
    spoil(r);
    return decode(encode(r));
  };
  EXPECT_TRUE(spoiled([](ChainRecord&) {}).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.accepted = r.counts.mutations + 1; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.large_accepted = r.counts.large_steps + 1; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.present_stay = r.counts.longest_stay + 1; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.large_sum = -1; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.large_square_sum = std::nan(""); }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.stay_x = INFINITY; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.by_mutation[1].name.clear(); }).ok());
  for (const char* name : {"\xff", "a b", "A", "a\"b"})
    EXPECT_FALSE(spoiled([&](ChainRecord& r) { r.counts.by_mutation[1].name = name; }).ok()) << name;
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.by_mutation[0].proposed = 900; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.by_mutation[0].accepted = 390; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.by_mutation[1].failed[2] = 200; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.mollified->start_share = 1.5; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.mollified->large_sum = 12.75; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.mollified->large_product_sum = std::nan(""); }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.mollified->stay_sum = 2000; }).ok());
  EXPECT_FALSE(spoiled([](ChainRecord& r) { r.counts.mollified->lost = r.segments + 1; }).ok());
  const auto long_state = spoiled([](ChainRecord& r) { r.state.assign(kMaxStateBytes + 1, 'x'); });
  ASSERT_FALSE(long_state.ok());
  EXPECT_EQ(long_state.error().field, "chain_records");
  EXPECT_EQ(long_state.error().kind, ErrorKind::input);

  const std::vector<ChainRecord> two = {sample_record(1), sample_record(2)};
  const std::string both = encode(std::span<const ChainRecord>(two));
  EXPECT_FALSE(decode(both, 1).ok());
  EXPECT_FALSE(decode(both, 3).ok());
  EXPECT_FALSE(decode(both.substr(0, both.size() - 1), 2).ok());
  EXPECT_FALSE(decode(std::string(4, '\xff'), 1).ok()) << "a length beyond the bytes";
}

// Claim: plans out of bounds are refused by the field that is wrong.
TEST(ChainPlans, Bounds) {
  EXPECT_TRUE(validate({2, 1, 1}).ok());
  EXPECT_TRUE(validate({kMaxChains, kMaxBootstrapSamples, kMaxSegmentMutations}).ok());
  for (const ChainPlan& bad : {ChainPlan{0, 1, 1}, ChainPlan{3, 1, 1}, ChainPlan{kMaxChains + 2, 1, 1}})
    EXPECT_EQ(validate(bad).error().field, "chains");
  for (const ChainPlan& bad : {ChainPlan{2, 0, 1}, ChainPlan{2, kMaxBootstrapSamples + 1, 1}})
    EXPECT_EQ(validate(bad).error().field, "bootstrap_samples");
  for (const ChainPlan& bad : {ChainPlan{2, 1, 0}, ChainPlan{2, 1, kMaxSegmentMutations + 1}})
    EXPECT_EQ(validate(bad).error().field, "segment_mutations");
}

// Claim: the table takes each sample once and nothing impossible, and does not depend on the order of
// arrival.
TEST(Bootstrap, TableIsExact) {
  std::vector<float> values(1000);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = i % 3 == 0 ? 0 : 10 * rng::to_float(static_cast<std::uint32_t>(rng::key(5, i)));
  const std::span<const float> all(values);
  BootstrapTable forward(1000), backward(1000);
  for (std::size_t at = 0; at < 1000; at += 100) {
    EXPECT_FALSE(forward.complete());
    ASSERT_TRUE(forward.insert(at, all.subspan(at, 100)).ok());
    ASSERT_TRUE(backward.insert(900 - at, all.subspan(900 - at, 100)).ok());
  }
  EXPECT_TRUE(forward.complete());
  EXPECT_EQ(forward.sums(), backward.sums());
  EXPECT_EQ(forward.choose_starts(64, 9), backward.choose_starts(64, 9));
  EXPECT_NE(forward.choose_starts(64, 9), forward.choose_starts(64, 10));

  BootstrapTable table(10);
  const std::vector<float> three = {1, 2, 3};
  ASSERT_TRUE(table.insert(4, three).ok());
  EXPECT_EQ(table.insert(6, three).error().kind, ErrorKind::refused) << "sample 6 is known";
  EXPECT_FALSE(table.insert(8, three).ok());
  EXPECT_FALSE(table.insert(11, {}).ok());
  for (const float bad : {-1.0F, std::nanf(""), INFINITY})
    EXPECT_FALSE(table.insert(0, std::vector<float>{1, bad}).ok());
  EXPECT_EQ(table.known().count(), 3U) << "a refusal changes nothing";
}

// Claim: starts are chosen in proportion to the contribution: sample i starts the floor or the ceiling of its
// expected number of chains, whatever the seed; zeros start none; and over seeds (and within one half of the
// chains) the mean is that expectation. 2000 seeds, each sample within 5 standard errors of the fraction's
// Bernoulli: a false alarm in about one of 10^5 such tests; a comb without a random offset fails at once.
// At most one sample starts chains of both halves, whose error is known by their difference.
TEST(Bootstrap, StartsAreInProportion) {
  const std::vector<float> values = {0, 1, 2.5F, 0, 0.25F, 7, 0, 1.5F, 0.1F};
  BootstrapTable table(values.size());
  ASSERT_TRUE(table.insert(0, values).ok());
  constexpr std::uint32_t kChains = 20;
  constexpr int kSeeds = 2000;
  const double sum = std::accumulate(values.begin(), values.end(), 0.0);
  std::vector<double> mean(values.size()), half(values.size());
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto starts = table.choose_starts(kChains, static_cast<std::uint64_t>(seed));
    ASSERT_EQ(starts.size(), kChains);
    std::vector<int> count(values.size()), of_half(values.size());
    for (std::size_t c = 0; c < starts.size(); ++c) {
      ++count.at(starts[c]);
      if (c % 2 == 0) ++of_half[starts[c]];
    }
    int in_both = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      half[i] += 2.0 * of_half[i] / kSeeds;
      in_both += of_half[i] > 0 && of_half[i] < count[i] ? 1 : 0;
      const double expected = kChains * static_cast<double>(values[i]) / sum;
      EXPECT_GE(count[i], std::floor(expected - 1e-9));
      EXPECT_LE(count[i], std::ceil(expected + 1e-9));
      mean[i] += static_cast<double>(count[i]) / kSeeds;
    }
    EXPECT_LE(in_both, 1) << seed;
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double expected = kChains * static_cast<double>(values[i]) / sum;
    const double fraction = expected - std::floor(expected);
    EXPECT_NEAR(mean[i], expected, 5 * std::sqrt(fraction * (1 - fraction) / kSeeds) + 1e-9) << i;
    // A half has all chains of a sample or none: doubled, its count is within `expected` of its mean.
    EXPECT_NEAR(half[i], expected, 5 * std::sqrt((expected * expected + fraction) / kSeeds) + 1e-9) << i;
  }
  // If no sample starts two chains, the order is random over both halves.
  BootstrapTable even(40);
  ASSERT_TRUE(even.insert(0, std::vector<float>(40, 1.0F)).ok());
  std::vector<double> first_half(40);
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto starts = even.choose_starts(kChains, static_cast<std::uint64_t>(seed));
    for (std::size_t c = 0; c < starts.size(); c += 2) first_half[starts[c]] += 1.0 / kSeeds;
  }
  for (const double share : first_half) EXPECT_NEAR(share, 0.25, 5 * std::sqrt(0.25 * 0.75 / kSeeds));
  BootstrapTable black(4);
  ASSERT_TRUE(black.insert(0, std::vector<float>(4)).ok());
  EXPECT_TRUE(black.choose_starts(8, 1).empty());
  EXPECT_EQ(black.normalisation().b, 0);
}

// Claim: b is the mean over all samples of bootstrap and large steps, its standard error that of a mean.
TEST(Bootstrap, PoolIsTheMeanOfAllSamples) {
  BootstrapTable table(4);
  ASSERT_TRUE(table.insert(0, std::vector<float>{0, 2, 4, 6}).ok());
  ChainCounts a, b;
  a.large_steps = 2;  // 1 and 3
  a.large_sum = 4;
  a.large_square_sum = 10;
  b.large_steps = 1;  // 5
  b.large_sum = 5;
  b.large_square_sum = 25;
  const std::vector<ChainCounts> counts = {a, b};
  const Normalisation n = pool(table, counts);
  EXPECT_EQ(n.samples, 7U);
  EXPECT_DOUBLE_EQ(n.b, 3);  // 0..6
  EXPECT_DOUBLE_EQ(n.standard_error, std::sqrt(4.0 / 6));
  const Normalisation same = pool(table.sums(), counts);
  EXPECT_EQ(same.b, n.b);
  EXPECT_EQ(same.standard_error, n.standard_error);
}

// Claim: of chains that mollify b is b_reg, the mean over all samples, and b_irr, that over the large steps
// alone; the bootstrap's sum is shared out as the chains' starts are. [regularisation note, section 9]
TEST(Bootstrap, PoolHasMollifiedPathsOfLargeStepsAlone) {
  BootstrapTable table(4);
  ASSERT_TRUE(table.insert(0, std::vector<float>{0, 2, 4, 6}).ok());
  ChainCounts a, b;
  a.mutations = b.mutations = 8;
  a.large_steps = 2;  // 3, of which 1 is mollified, and 1
  a.large_sum = 4;
  a.large_square_sum = 10;
  a.mollified = {0.25, 1, 1, 3, 2, 0};
  b.large_steps = 1;  // 5, of which 4 are mollified
  b.large_sum = 5;
  b.large_square_sum = 25;
  b.mollified = {0.75, 4, 16, 20, 6, 3};
  const std::vector<ChainCounts> counts = {a, b};
  EXPECT_DOUBLE_EQ(pool(table, counts).b, (12 * 0.5 + 4) / 7 + 5.0 / 3);
  EXPECT_EQ(pool(table, counts).samples, 7U);
  const auto mollified = summarise_mollified(counts);
  ASSERT_TRUE(mollified.has_value());
  EXPECT_DOUBLE_EQ(mollified->b, 5.0 / 3);
  EXPECT_DOUBLE_EQ(mollified->standard_error, std::sqrt((17.0 / 3 - 25.0 / 9) / 3));
  EXPECT_DOUBLE_EQ(mollified->share, 0.5);
  EXPECT_DOUBLE_EQ(mollified->share_spread, 0.25);
  EXPECT_EQ(mollified->lost, 3U);
  EXPECT_FALSE(summarise_mollified({}).has_value());
  // No large step yet: the bootstrap alone.
  const std::vector<ChainCounts> none(2);
  EXPECT_EQ(pool(table, none).b, 3);
}

// Claim: that b has no bias, although the bootstrap has another radius and its sum is shared out by the
// starts of few chains; its standard error is its spread, or a little more.
TEST(Bootstrap, PoolOfMollifiedPathsHasNoBias) {
  constexpr std::uint64_t kSamples = 64, kSeeds = 20000;
  constexpr std::uint32_t kChains = 8;
  constexpr double kRegular = 1, kFirst = 3, kNow = 5;  // means; a sample in four has any
  double sum = 0, square_sum = 0, variance = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    rng::Stream stream(rng::key(seed, 5));
    const auto draw = [&](double mean) { return stream.next_double() < 0.25 ? 4 * mean : 0; };
    BootstrapTable table(kSamples);
    std::vector<float> values;
    std::vector<double> shares;
    for (std::uint64_t i = 0; i < kSamples; ++i) {
      const double regular = draw(kRegular), part = draw(kFirst);
      values.push_back(static_cast<float>(regular + part));
      shares.push_back(part > 0 ? part / (regular + part) : 0);
    }
    ASSERT_TRUE(table.insert(0, values).ok());
    const auto starts = table.choose_starts(kChains, seed);
    if (starts.empty()) continue;
    std::vector<ChainCounts> counts(kChains);
    for (std::uint32_t c = 0; c < kChains; ++c) {
      MollifiedCounts& m = counts[c].mollified.emplace();
      m.start_share = shares[starts[c]];
      counts[c].mutations = 32;
      counts[c].large_steps = 16;
      for (int i = 0; i < 16; ++i) {
        const double regular = draw(kRegular), part = draw(kNow), all = regular + part;
        counts[c].large_sum += all;
        counts[c].large_square_sum += all * all;
        m.large_sum += part;
        m.large_square_sum += part * part;
        m.large_product_sum += part * all;
      }
    }
    const Normalisation b = pool(table, counts);
    sum += b.b;
    square_sum += b.b * b.b;
    variance += b.standard_error * b.standard_error;
  }
  const double mean = sum / kSeeds, spread = square_sum / kSeeds - mean * mean;
  EXPECT_NEAR(mean, kRegular + kNow, 4 * std::sqrt(spread / kSeeds));
  EXPECT_GT(variance / kSeeds, 0.97 * spread);
  EXPECT_LT(variance / kSeeds, 1.1 * spread);
}

// Claim: segments_in counts each chain's merged segments, as plain counting does, for random sets that grow
// as a farm's do, and refuses a segment without the one before it.
TEST(Segments, AreCountedPerChain) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    rng::Stream stream(rng::key(seed, 1));
    const std::uint32_t chains = 2 + 2 * static_cast<std::uint32_t>(stream.next_double() * 12);
    const std::uint64_t n = chains / 2;
    film::IndexSet merged;
    std::vector<std::uint64_t> counts(n);
    for (int unit = 0; unit < 60; ++unit) {
      // A run of neighbouring chains that stand at the same index row: [i, i + length).
      const std::uint64_t first = static_cast<std::uint64_t>(stream.next_double() * static_cast<double>(n));
      const std::uint64_t begin = counts[first] * n + first;
      std::uint64_t end = begin;
      while (end < begin + n && stream.next_double() < 0.8 && counts[end % n] == end / n) ++end;
      if (begin == end) continue;
      ASSERT_TRUE(merged.insert(begin, end));
      for (std::uint64_t i = begin; i < end; ++i) ++counts[i % n];
      const auto found = segments_in(merged, chains);
      ASSERT_TRUE(found.ok()) << found.error().to_string();
      ASSERT_EQ(*found, counts);
    }
    film::IndexSet torn = merged;
    const std::uint64_t far = (*std::max_element(counts.begin(), counts.end()) + 1) * n;
    ASSERT_TRUE(torn.insert(far, far + 1));
    EXPECT_FALSE(segments_in(torn, chains).ok());
  }
  EXPECT_EQ(*segments_in({}, 6), (std::vector<std::uint64_t>{0, 0, 0}));
}

film::MergedFilm two_layer_film(const std::array<float, 2>& first, const std::array<float, 2>& second) {
  const film::Layout layout{1, 1, 2};
  film::MergedFilm merged(layout, 20);
  for (std::uint32_t half = 0; half < 2; ++half) {
    film::UnitFilm film(layout, 20);
    film::SampleCounts sample_counts;
    const auto value = [](float v) { return std::array<float, 3>{v, v, v}; };
    film.splat(0, 0, 0, value(2 * first[half]), 1, sample_counts);  // two segments
    film.splat(1, 0, 0, value(2 * second[half]), 2, sample_counts);
    film::DeltaInfo info;
    info.unit = {Unit::Kind::segments, half, 0, 2};
    const auto delta = film::Delta::decode(film::encode_delta(film, info), layout);
    EXPECT_TRUE(delta.ok() && merged.merge(*delta).ok());
  }
  return merged;
}

// Claim: the image of chains is b/b0 times the first layer plus the second, and so is its error, to which b's
// own variance adds for what carries b; without the factor it is as for any film.
TEST(Development, AppliesTheFactor) {
  const film::MergedFilm film = two_layer_film({3, 5}, {1, 2});
  film::Development d = development(2.0, {3.0, 0.3, 100});
  EXPECT_DOUBLE_EQ(d.factor, 1.5);
  EXPECT_DOUBLE_EQ(d.factor_variance, 0.01);
  EXPECT_EQ(film::develop_image(film, d)[0], 1.5F * 4 + 1.5F);
  EXPECT_EQ(film::develop_image(film, d, film::MergedFilm::Which::half1)[2], 1.5F * 5 + 2);
  const double halves = std::pow((1.5 * 3 + 1) - (1.5 * 5 + 2), 2) / 4;
  const double own = 0.01 * std::pow(1.5 * 4, 2);
  EXPECT_NEAR(stats::estimate_error(film, d).rmse, std::sqrt(halves + own), 1e-6);
  EXPECT_NEAR(stats::error_map(film, d)[1], std::sqrt(halves + own), 1e-6);
  EXPECT_NEAR(stats::estimate_error(film, d).relmse, (halves + own) / (7.5 * 7.5 * 1.01), 1e-6);
  EXPECT_EQ(film::develop_image(film, {})[0], 4.0F);
  EXPECT_EQ(film::develop_image(film, {}), film.develop(0));
  const film::MergedFilm image = film.first_layers(2);
  EXPECT_EQ(film::develop_image(image, d), film::develop_image(film, d));
  EXPECT_EQ(image.merged(0), film.merged(0));
  EXPECT_FALSE(film.black(2));
  EXPECT_TRUE(two_layer_film({0, 0}, {0, 0}).black(2));
  EXPECT_FALSE(two_layer_film({0, 0}, {0, 1e-3F}).black(2));
  EXPECT_TRUE(two_layer_film({0, 0}, {0, 1e-3F}).black(1));
  const film::Development black = development(0, {});
  EXPECT_TRUE(std::isfinite(black.factor));
  EXPECT_EQ(black.factor_variance, 0);
}

// Claim: a summary's groups add their chains' counts and show the longest stay with its pixel; a stay within
// the bound is no news.
TEST(Summaries, GroupChains) {
  std::vector<ChainCounts> counts(40);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    counts[i].mutations = 100;
    counts[i].accepted = i;
    counts[i].longest_stay = 10 * i;
    counts[i].stay_x = static_cast<float>(i) + 0.5F;
  }
  const Summary s = summarise({10, 30, 5}, counts);
  EXPECT_EQ(s.groups[3].mutations, 300U);
  EXPECT_EQ(s.groups[3].accepted, 3U + 19 + 35);
  EXPECT_EQ(s.groups[3].longest_stay, 350U);
  EXPECT_EQ(s.groups[3].stay_x, 35.5F);
  EXPECT_EQ(s.groups[15].mutations, 200U);
  EXPECT_EQ(s.normalisation.samples, 5U);
  EXPECT_TRUE(long_stay_text(s).empty());
  counts[7].longest_stay = kLongStay + 1;
  EXPECT_NE(long_stay_text(summarise({10, 30, 5}, counts)).find("pixel 7, 0"), std::string::npos);
}

// Claim: light that needs no chain, of which the pilot's scale knows, fits a film whose chains bring next to
// nothing.
TEST(FilmScale, IsWithinReachOfThePilots) {
  EXPECT_EQ(film_scale_log2(1, 19), 19);
  EXPECT_EQ(film_scale_log2(1e-3, 19), film::scale_log2_for(1e-3));
  EXPECT_EQ(film_scale_log2(1e6, 19), film::scale_log2_for(1e6));
  EXPECT_EQ(film_scale_log2(1e-38, 19), 35);
  EXPECT_EQ(film_scale_log2(1e-44, 126), 126) << "all light is as faint";
  EXPECT_EQ(film_scale_log2(0, 19), 19);
}

// Claim: b that grows beyond the bootstrap's error is told; a wide error, or a b that falls, is no news.
TEST(Summaries, TellIfBGrows) {
  const BootstrapSums sure{1000, 1100, 1000}, unsure{1000, 1e6, 1000}, dark{0, 0, 1000};
  EXPECT_TRUE(grown_b_text(sure, {1.1, 0.1, 2000}).empty());
  EXPECT_TRUE(grown_b_text(sure, {0.1, 0.01, 2000}).empty());
  EXPECT_TRUE(grown_b_text(unsure, {3, 0.1, 2000}).empty());
  EXPECT_TRUE(grown_b_text(dark, {3, 0.1, 2000}).empty());
  EXPECT_NE(grown_b_text(sure, {9, 3, 2000}).find("from 1 +- 0.01 in the bootstrap to 9 +- 3"),
            std::string::npos)
      << grown_b_text(sure, {9, 3, 2000});
}

}  // namespace
}  // namespace candela::chains
