// Sums by pixel and key, and sums of tables: what a worker adds, what travels, what a master adds up.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <thread>

#include "common/film/codec.h"
#include "common/film/film.h"
#include "common/rng/stream.h"

namespace candela::film {
namespace {

using Spec = AccumulatorSpec;

constexpr std::uint32_t kWidth = 70, kHeight = 45, kKeys = 5;  // tiles that the border cuts
const Spec kMattes{"mattes", 1, 20, Spec::Per::job, Spec::Domain::keys, 0, {"a", "b", "c", "d", "e"}};
const Layout kFilm{kWidth, kHeight, 1};
const DeltaShape kShape{kFilm, {kMattes}};

// Samples of one unit at a few places. Some keys of some pixels have sums of both signs.
void fill(UnitAccumulator& sums, std::uint64_t seed, int count) {
  SampleCounts sample_counts;
  for (int i = 0; i < count; ++i) {
    const std::uint64_t key = rng::key(seed, static_cast<std::uint64_t>(i));
    const auto x = static_cast<std::uint32_t>(key % kWidth),
               y = static_cast<std::uint32_t>(key / 97 % kHeight);
    const double value = key % 4 == 0 ? -0.3 : 1.1;
    EXPECT_TRUE(
        sums.add_key(x, y, static_cast<std::uint32_t>(key / 7919 % kKeys), value, key, sample_counts));
  }
}
std::string encode(const UnitAccumulator& sums, std::uint64_t begin = 0) {
  DeltaWriter writer({{Unit::Kind::iterations, 0, begin, begin + 1}, {}, 0, "job", "build"});
  writer.film(UnitFilm(kFilm, 4));
  writer.accumulator(sums, 0);
  writer.counts({});
  return writer.finish();
}
using Pairs = std::map<std::array<std::uint32_t, 3>, Int128>;
Pairs pairs_of(const KeyedSums& sums) {
  Pairs pairs;
  std::vector<KeyedSums::KeySum> keys;
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      sums.get_pixel(x, y, keys);
      for (const KeyedSums::KeySum& key : keys)
        if (key.sum != 0) pairs[{x, y, key.key}] = key.sum;
    }
  return pairs;
}
Delta decoded(const std::string& bytes) {
  auto delta = Delta::decode(bytes, kShape);
  EXPECT_TRUE(delta.ok()) << delta.error().to_string();
  return std::move(*delta);
}

// Claim: every key that was added to a pixel is there, with the sum of its samples, in any order and grouping
// of units; equal sums have equal bytes, and few if little was added. Two threads and one give the same
// bytes.
TEST(Keys, MergingIsExactInAnyOrder) {
  constexpr std::uint64_t kUnits = 12;
  std::vector<std::string> deltas;
  Pairs expected;
  for (std::uint64_t u = 0; u < kUnits; ++u) {
    UnitAccumulator sums(kWidth, kHeight, kMattes), threads(kWidth, kHeight, kMattes);
    const int count = u % 3 == 0 ? 2 : 700;
    fill(sums, u, count);
    fill(sums, u + 100, count);
    {
      std::jthread other([&] { fill(threads, u + 100, count); });
      fill(threads, u, count);
    }
    deltas.push_back(encode(sums, u));
    EXPECT_TRUE(deltas.back() == encode(threads, u));
    for (const auto& [place, sum] : pairs_of(decoded(deltas.back()).accumulators()[0].keys))
      expected[place] += sum;
  }
  std::erase_if(expected, [](const auto& pair) { return pair.second == 0; });
  EXPECT_GT(expected.size(), std::size_t{kWidth} * kHeight);
  EXPECT_LT(deltas[0].size(), 400U) << "four samples";
  std::mt19937 shuffle(1);
  std::string stored;
  for (int order = 0; order < 4; ++order) {
    MergedAccumulator all(kWidth, kHeight, kMattes), relay(kWidth, kHeight, kMattes);
    for (std::size_t u = 0; u < deltas.size(); ++u)
      (u % 2 == 0 ? all : relay).merge(decoded(deltas[u]).accumulators()[0]);
    ASSERT_TRUE(all.merge(relay).ok());
    EXPECT_TRUE(pairs_of(all.keys()) == expected);
    if (stored.empty()) stored = all.serialise();
    EXPECT_TRUE(all.serialise() == stored);
    std::shuffle(deltas.begin(), deltas.end(), shuffle);
  }
  const auto back = MergedAccumulator::parse(stored, kWidth, kHeight, kMattes);
  ASSERT_TRUE(back.ok()) << back.error().to_string();
  EXPECT_TRUE(back->serialise() == stored);
  EXPECT_TRUE(pairs_of(back->keys()) == expected);
  Spec fewer = kMattes;
  fewer.key_names.pop_back();
  EXPECT_FALSE(MergedAccumulator::parse(stored, kWidth, kHeight, fewer).ok());
  EXPECT_FALSE(MergedAccumulator::parse(stored + '\0', kWidth, kHeight, kMattes).ok());
  for (std::size_t i = 0; i < stored.size(); i += 7)
    EXPECT_FALSE(MergedAccumulator::parse(stored.substr(0, i), kWidth, kHeight, kMattes).ok()) << i;
}

// Claim: what is taken back leaves no trace, and neither does a sum that returns to 0.
TEST(Keys, TakingBackLeavesNothing) {
  UnitAccumulator first(kWidth, kHeight, kMattes), second(kWidth, kHeight, kMattes);
  fill(first, 1, 300);
  fill(second, 2, 300);
  const Delta a = decoded(encode(first)), b = decoded(encode(second));
  MergedAccumulator sums(kWidth, kHeight, kMattes);
  sums.merge(a.accumulators()[0]);
  const std::string before = sums.serialise();
  SparseSums::TileBuffers none(0);
  sums.reserve(b.accumulators()[0]);
  EXPECT_TRUE(sums.serialise() == before);
  sums.merge(b.accumulators()[0]);
  EXPECT_FALSE(sums.serialise() == before);
  sums.take_back(b.accumulators()[0], none);
  EXPECT_TRUE(sums.serialise() == before);

  SampleCounts sample_counts;
  UnitAccumulator zero(kWidth, kHeight, kMattes);
  zero.add_key(3, 4, 2, 1, 5, sample_counts);
  zero.add_key(3, 4, 2, -1, 5, sample_counts);
  EXPECT_TRUE(encode(zero) == encode(UnitAccumulator(kWidth, kHeight, kMattes)));
  fill(zero, 1, 50);
  zero.clear();
  EXPECT_TRUE(encode(zero) == encode(UnitAccumulator(kWidth, kHeight, kMattes)));
  EXPECT_FALSE(zero.add_key(0, 0, 0, std::nan(""), 1, sample_counts));
  EXPECT_FALSE(zero.add_key(0, 0, 0, 0x1p50, 1, sample_counts));
  EXPECT_EQ(sample_counts.rejected[static_cast<std::size_t>(RejectCause::saturated)], 1U);
}

// Claim: merged sums widen to 128 bits where 64 are too few, and stay exact there.
TEST(Keys, MergedSumsWiden) {
  Spec spec = kMattes;
  spec.scale_log2 = 0;
  UnitAccumulator unit(kWidth, kHeight, spec);
  SampleCounts sample_counts;
  for (int i = 0; i < 127; ++i) unit.add_key(0, 0, 1, -0x1p56, 1, sample_counts);
  unit.add_key(1, 0, 3, 3, 1, sample_counts);
  ASSERT_FALSE(unit.overflowed());
  MergedAccumulator sums(kWidth, kHeight, spec);
  const auto delta = Delta::decode(encode(unit), {kFilm, {spec}});
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  for (int i = 0; i < 1000; ++i) sums.merge(delta->accumulators()[0]);
  Pairs expected = {{{0, 0, 1}, Int128{-127000} * (Int128{1} << 56)}, {{1, 0, 3}, 3000}};
  EXPECT_TRUE(pairs_of(sums.keys()) == expected);
  const auto back = MergedAccumulator::parse(sums.serialise(), kWidth, kHeight, spec);
  ASSERT_TRUE(back.ok());
  EXPECT_TRUE(pairs_of(back->keys()) == expected);
  unit.add_key(0, 0, 1, -0x1p56, 1, sample_counts);
  unit.add_key(0, 0, 1, -0x1p56, 1, sample_counts);
  EXPECT_TRUE(unit.overflowed());
}

// Claim: what is decoded of changed bytes, with their checksum made right, is refused or has another hash
// where its sums are others: a compressor may write equal sums in several ways. A key that the plan has not
// is refused.
TEST(Keys, DamageIsRefused) {
  UnitAccumulator sums(kWidth, kHeight, kMattes);
  fill(sums, 3, 60);
  const std::string good = encode(sums);
  const std::string content = decoded(good).content_sha256();
  const std::string sealed = good.substr(0, good.size() - 8);
  Spec fewer = kMattes;
  fewer.key_names.pop_back();
  EXPECT_FALSE(Delta::decode(good, {kFilm, {fewer}}).ok());
  EXPECT_FALSE(Delta::decode(good, {kFilm, {{"mattes", 1, 20}}}).ok());
  const Pairs pairs = pairs_of(decoded(good).accumulators()[0].keys);
  std::size_t refused = 0;
  for (std::size_t i = 70; i < sealed.size(); ++i) {
    std::string changed = sealed;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    seal(changed);
    const auto delta = Delta::decode(changed, kShape);
    if (!delta.ok())
      ++refused;
    else
      EXPECT_TRUE(delta->content_sha256() != content || pairs_of(delta->accumulators()[0].keys) == pairs)
          << i;
  }
  EXPECT_GT(refused, 100U);
}

// Claim: a table of entries has nothing to do with the film's size, and its sums are as exact.
TEST(Tables, AreOfEntries) {
  const Spec table{"table", 2, 0, Spec::Per::epoch, Spec::Domain::table, 3000};
  for (const Layout& film : {Layout{1, 1, 1}, Layout{70, 45, 1}}) {
    UnitAccumulator unit(film.width, film.height, table);
    SampleCounts sample_counts;
    for (std::uint32_t e = 0; e < table.entries; ++e) {
      const auto at = place_of_entry(e);
      unit.splat(at.x, at.y, 0, std::array<double, 2>{1, e % 3 == 0 ? 1.0 : 0.0}, e, sample_counts);
    }
    DeltaWriter writer({{Unit::Kind::iterations, 0, 0, 1}, {}, 0, "job", "build"});
    writer.film(UnitFilm(film, 4));
    writer.accumulator(unit, 7);
    writer.counts({});
    const auto delta = Delta::decode(writer.finish(), {film, {table}});
    ASSERT_TRUE(delta.ok()) << delta.error().to_string();
    MergedAccumulator sums(film.width, film.height, table);
    for (int i = 0; i < 2; ++i) sums.merge(delta->accumulators()[0]);
    const auto back = MergedAccumulator::parse(sums.serialise(), film.width, film.height, table);
    ASSERT_TRUE(back.ok()) << back.error().to_string();
    for (std::uint32_t e = 0; e < table.entries; ++e) {
      const auto at = place_of_entry(e);
      ASSERT_TRUE(back->sum(at.x, at.y, 0) == 2);
      ASSERT_TRUE(back->sum(at.x, at.y, 1) == (e % 3 == 0 ? 2 : 0));
    }
  }
}

// Claim: each domain has what it needs and nothing of the others; beyond the bound on pairs a unit says so.
TEST(Keys, PlansAreChecked) {
  const auto field = [](const Spec& spec) {
    const auto valid = validate(std::vector{spec}, 64, 64);
    return valid.ok() ? "valid" : valid.error().field;
  };
  EXPECT_EQ(field(kMattes), "valid");
  Spec spec = kMattes;
  spec.channels = 2;
  EXPECT_EQ(field(spec), "accumulators");
  spec = kMattes;
  spec.per = Spec::Per::epoch;
  EXPECT_EQ(field(spec), "accumulators");
  spec = kMattes;
  spec.key_names[0] = std::string(kMaxKeyNameBytes, 'x');
  EXPECT_EQ(field(spec), "accumulators");
  spec = kMattes;
  spec.domain = Spec::Domain::film;
  EXPECT_EQ(field(spec), "accumulators");
  EXPECT_EQ(field({"t", 1, 0, Spec::Per::job, Spec::Domain::table, 0}), "accumulators");
  EXPECT_EQ(field({"t", 1, 0, Spec::Per::job, Spec::Domain::table, 12}), "valid");
  EXPECT_EQ(field({"t", 1, 0, Spec::Per::job, Spec::Domain::film, 12}), "accumulators");

  spec = kMattes;
  spec.key_names.assign(40, "n");
  EXPECT_EQ(max_pairs(spec, 10, 10), 4000U);
  spec.key_names.assign(4000, "n");
  EXPECT_EQ(max_pairs(spec, 400, 400), 8 * 400U * 400U);
}

}  // namespace
}  // namespace candela::film
