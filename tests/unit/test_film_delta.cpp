// Tests of the wire form: it carries the film whole, and nothing but the whole and unchanged bytes are
// accepted.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "common/film/codec.h"
#include "common/film/film.h"

namespace candela::film {
namespace {

DeltaInfo info_of(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  DeltaInfo info;
  info.unit = {Unit::Kind::iterations, half, begin, end};
  info.job_id = "job-7";
  info.build_id = "build-1";
  return info;
}

void fill(UnitFilm& film, std::uint64_t seed, int samples, float scale) {
  rng::Stream stream(seed);
  const Layout& l = film.layout();
  SampleCounts sample_counts;
  for (int i = 0; i < samples; ++i) {
    const std::array<float, 3> rgb{scale * stream.next_float(), -scale * stream.next_float(),
                                   stream.next_float()};
    film.add(stream.next_u32() % l.layers, stream.next_u32() % l.width, stream.next_u32() % l.height, rgb,
             rng::key(seed, i), sample_counts, true);
  }
  sample_counts.eye_samples = static_cast<std::uint64_t>(samples);
  film.count(sample_counts);
}

bool same_sums(const UnitFilm& film, const MergedFilm& merged, std::uint32_t half) {
  const Layout& l = film.layout();
  const std::int64_t* sum = film.sums();
  for (std::uint32_t layer = 0; layer < l.layers; ++layer) {
    for (std::uint32_t y = 0; y < l.height; ++y) {
      for (std::uint32_t x = 0; x < l.width; ++x) {
        for (int c = 0; c < kChannels; ++c) {
          if (merged.sum(half, layer, x, y, c) != *sum++) return false;
        }
      }
    }
  }
  return true;
}

// Claim: every sum, tally and field arrives, for films whose borders cut tiles, small and huge sums, several
// layers.
TEST(Delta, CarriesTheFilm) {
  for (const Layout layout : {Layout{1, 1, 1}, Layout{33, 65, 2}, Layout{200, 170, 3}, Layout{5000, 1, 1}}) {
    for (const float scale : {0.0F, 1e-3F, 1.0F, 0x1p35F}) {
      UnitFilm film(layout, 20);
      fill(film, 5, 3000, scale);
      const std::string bytes = encode_delta(film, info_of(1, 4, 9));
      EXPECT_EQ(bytes, encode_delta(film, info_of(1, 4, 9)));
      const auto delta = Delta::decode(bytes, layout);
      ASSERT_TRUE(delta.ok()) << delta.error().to_string();
      EXPECT_EQ(delta->info().unit.half, 1U);
      EXPECT_EQ(delta->info().unit.begin, 4U);
      EXPECT_EQ(delta->info().unit.end, 9U);
      EXPECT_EQ(delta->info().job_id, "job-7");
      EXPECT_EQ(delta->info().build_id, "build-1");
      EXPECT_EQ(delta->info().scale_log2, 20);
      EXPECT_EQ(delta->sample_counts(), film.sample_counts());
      MergedFilm merged(layout, 20);
      ASSERT_TRUE(merged.merge(*delta).ok());
      EXPECT_TRUE(same_sums(film, merged, 1));
    }
  }
}

// Claim: the content's hash tells one unit of a sum, the counts behind an image, the scale and the unit
// apart, and not who sent it, nor counts for people.
TEST(Delta, ContentIsWhatIsSummed) {
  const Layout layout{200, 170, 2};
  const auto hash = [&](std::uint64_t end, int scale, int change, const char* sender) {
    UnitFilm film(layout, scale);
    fill(film, 5, 3000, 1);
    SampleCounts sample_counts;
    if (change == 1) sample_counts.light_paths = 1;
    if (change == 3) sample_counts.rays = sample_counts.bounded_walks = 1;
    if (change == 2) film.add(1, 199, 169, {0, 0, 0x1p-20F}, 3, sample_counts, true);
    film.count(sample_counts);
    DeltaInfo info = info_of(1, 4, end);
    info.job_id = sender;
    info.build_id = sender;
    const auto delta = Delta::decode(encode_delta(film, info), layout);
    EXPECT_TRUE(delta.ok());
    return delta->content_sha256();
  };
  const std::string one = hash(9, 20, 0, "a");
  EXPECT_EQ(one.size(), 64U);
  EXPECT_EQ(hash(9, 20, 0, "another"), one);
  EXPECT_NE(hash(10, 20, 0, "a"), one);
  EXPECT_NE(hash(9, 21, 0, "a"), one);
  EXPECT_NE(hash(9, 20, 1, "a"), one);
  EXPECT_NE(hash(9, 20, 2, "a"), one);
  EXPECT_EQ(hash(9, 20, 3, "a"), one);
}

// Claim: the extreme 64-bit sums survive the zigzag coding.
TEST(Delta, ZigzagIsABijection) {
  for (const std::int64_t v :
       {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1}, std::numeric_limits<std::int64_t>::max(),
        std::numeric_limits<std::int64_t>::min(), std::int64_t{-123456789012345}}) {
    EXPECT_EQ(unzigzag(zigzag(v)), v);
  }
  EXPECT_EQ(zigzag(-1), 1U);
  EXPECT_EQ(zigzag(1), 2U);
}

// Claim: an untouched film costs next to nothing, and adding only black does not make it dearer or different.
TEST(Delta, UntouchedFilmIsTiny) {
  UnitFilm film({1920, 1080, 1}, 20);
  const std::string empty = encode_delta(film, info_of(0, 0, 1));
  EXPECT_LT(empty.size(), 200U);
  SampleCounts sample_counts;
  film.add(0, 100, 100, {0, 0, 0}, 1, sample_counts);
  EXPECT_EQ(encode_delta(film, info_of(0, 0, 1)), empty);
}

// Claim: a change of any single byte and a cut at any length are refused, as are trailing bytes.
TEST(Delta, AnyDamageIsRefused) {
  const Layout layout{40, 34, 1};
  UnitFilm film(layout, 6);
  fill(film, 8, 60, 3);
  const std::string good = encode_delta(film, info_of(0, 0, 1));
  ASSERT_TRUE(Delta::decode(good, layout).ok());
  ASSERT_LT(good.size(), 6000U);
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const int flip : {1, 128, 255}) {
      std::string bad = good;
      bad[i] = static_cast<char>(bad[i] ^ flip);
      ASSERT_FALSE(Delta::decode(bad, layout).ok()) << "byte " << i;
    }
    ASSERT_FALSE(Delta::decode(std::string_view(good).substr(0, i), layout).ok()) << "length " << i;
  }
  EXPECT_FALSE(Delta::decode(good + '\0', layout).ok());
  EXPECT_FALSE(Delta::decode(good + good, layout).ok());
  const auto other = Delta::decode(good, Layout{40, 35, 1});
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.error().field, "layout");
}

// Claim: bytes whose checksum was made right after the change (a faulty or hostile sender) never crash the
// decoder, and what it accepts of them is a well-formed delta that merges. Run under sanitisers this guards
// the memory bounds.
TEST(Delta, ResealedDamageIsRefusedOrWellFormed) {
  const Layout layout{40, 34, 1};
  UnitFilm film(layout, 6);
  fill(film, 8, 60, 3);
  const std::string good = encode_delta(film, info_of(0, 0, 1));
  const std::size_t content = good.size() - 8;
  const auto reseal = [](std::string bytes) {
    seal(bytes);
    return bytes;
  };
  ASSERT_EQ(reseal(good.substr(0, content)), good);
  int refused = 0;
  for (std::size_t i = 8; i < content; ++i) {
    for (const int flip : {1, 2, 64, 128, 255}) {
      std::string bad = good.substr(0, content);
      bad[i] = static_cast<char>(bad[i] ^ flip);
      const auto delta = Delta::decode(reseal(bad), layout);
      if (delta.ok()) {
        MergedFilm merged(layout, delta->info().scale_log2);
        // (A changed kind makes a pilot of it, which is well-formed and not for merging, or segments.)
        EXPECT_EQ(merged.merge(*delta).ok(), delta->info().unit.kind != Unit::Kind::pilot);
      } else {
        EXPECT_FALSE(delta.error().message.empty());
        ++refused;
      }
    }
    ASSERT_FALSE(Delta::decode(reseal(good.substr(0, i)), layout).ok()) << "length " << i;
  }
  EXPECT_GT(refused, 0);
  EXPECT_FALSE(Delta::decode(reseal(good.substr(0, content) + '\0'), layout).ok());
}

// Claim: each field of the header is checked by itself.
TEST(Delta, HeaderFieldsAreChecked) {
  const Layout layout{40, 34, 1};
  UnitFilm film(layout, 6);
  const std::string good = encode_delta(film, info_of(0, 0, 1));
  const auto field_of = [&](std::size_t offset, std::uint64_t value, std::size_t size) -> std::string {
    std::string bytes = good.substr(0, good.size() - 8);
    for (std::size_t i = 0; i < size; ++i) bytes[offset + i] = static_cast<char>(value >> (8 * i));
    seal(bytes);
    const auto delta = Delta::decode(bytes, layout);
    return delta.ok() ? "accepted" : delta.error().field;
  };
  EXPECT_EQ(field_of(8, 9, 1), "kind");
  EXPECT_EQ(field_of(9, 2, 1), "unit");
  EXPECT_EQ(field_of(10, 1, 8), "unit");           // begin == end
  EXPECT_EQ(field_of(18, 1ULL << 41, 8), "unit");  // beyond the last iteration
  EXPECT_EQ(field_of(26, 0xffff, 2), "job_id");
  const std::size_t section = 28 + info_of(0, 0, 1).job_id.size() + 2 + info_of(0, 0, 1).build_id.size();
  EXPECT_EQ(field_of(section, 5, 1), "sections");      // counts in the place of the film
  EXPECT_EQ(field_of(section + 3, 1, 8), "sections");  // a film of an epoch
  EXPECT_EQ(field_of(section + 11, 1ULL << 40, 8), "length");
  const std::size_t at = section + 19;
  EXPECT_EQ(field_of(at, 40, 4), "accepted");
  EXPECT_EQ(field_of(at, 0xffffffff, 4), "layout");
  EXPECT_EQ(field_of(at + 4, 0, 4), "layout");
  EXPECT_EQ(field_of(at + 8, 2, 4), "layout");
  EXPECT_EQ(field_of(at + 8, 0, 4), "layers");
  EXPECT_EQ(field_of(at + 12, 201, 4), "film_scale_log2");
}

// Claim: the checksum is XXH64 as published (values of the specification's reference implementation for seed
// 0).
TEST(Checksum, IsXxh64) {
  EXPECT_EQ(checksum(""), 0xEF46DB3751D8E999ULL);
  EXPECT_EQ(checksum("a"), 0xD24EC4F1A98C6E5BULL);
  EXPECT_EQ(checksum("abc"), 0x44BC2CF5AD770999ULL);
  EXPECT_EQ(checksum("Nobody inspects the spammish repetition"), 0xFBCEA83C8A378BF1ULL);
}

// Claim: tile lists have one form only: ascending, inside the film, runs as long as they can be.
TEST(TileRuns, AreStrict) {
  const auto read = [](std::initializer_list<std::uint32_t> words, std::size_t tiles) {
    std::string bytes;
    for (const std::uint32_t word : words) put_u32(bytes, word);
    Reader reader(bytes);
    return read_tiles(reader, tiles);
  };
  const auto good = read({2, 1, 2, 5, 1}, 6);
  ASSERT_TRUE(good.ok());
  EXPECT_EQ(*good, (std::vector<std::uint32_t>{1, 2, 5}));
  EXPECT_FALSE(read({2, 1, 2, 5, 1}, 5).ok());
  EXPECT_FALSE(read({2, 1, 2, 3, 1}, 9).ok());
  EXPECT_FALSE(read({2, 5, 1, 1, 2}, 9).ok());
  EXPECT_FALSE(read({1, 1, 0}, 9).ok());
  EXPECT_FALSE(read({1, 1, 0xffffffff}, 9).ok());
  EXPECT_FALSE(read({0xffffffff, 1, 1}, 9).ok());
  EXPECT_FALSE(read({}, 9).ok());
}

}  // namespace
}  // namespace candela::film
