// The memory of films: what is said of it before it is taken, and merges for which it does not suffice.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "common/film/film.h"
#include "common/rng/stream.h"
#include "common/stages/memory_need.h"
#include "tests/unit/failing_allocation.inc"

namespace candela::film {
namespace {

// A delta with a sum in every pixel; `huge`: so large that three of them need 128 bits.
Delta delta_of(const Layout& layout, std::uint32_t half, std::uint64_t begin, bool huge) {
  UnitFilm film(layout, huge ? 40 : 20);
  SampleCounts sample_counts;
  for (std::uint32_t layer = 0; layer < layout.layers; ++layer)
    for (std::uint32_t y = 0; y < layout.height; ++y)
      for (std::uint32_t x = 0; x < layout.width; ++x) {
        const std::uint64_t key = rng::key(half, begin, layer, y, x);
        const float v =
            (huge ? 0x1p15F : 1.0F) * (1.0F + 0.5F * rng::to_float(static_cast<std::uint32_t>(key)));
        for (int n = huge ? 100 : 1; n-- > 0;) film.add(layer, x, y, {v, v, v}, key, sample_counts);
      }
  sample_counts.eye_samples = layout.pixel_count();
  film.count(sample_counts);
  DeltaInfo info;
  info.unit = {Unit::Kind::iterations, half, begin, begin + 1};
  info.layout = layout;
  info.scale_log2 = film.scale_log2();
  info.job_id = "j";
  info.build_id = "b";
  auto delta = Delta::decode(encode_delta(film, info), layout);
  EXPECT_TRUE(delta.ok()) << delta.error().to_string();
  return std::move(*delta);
}

// Claim: a merge that runs out of memory, wherever it does, leaves the film as it was to the last byte, and
// succeeds afterwards: with tiles that are new, and with sums that must be widened.
TEST(FilmMemory, AMergeIsWholeOrNotAtAll) {
  constexpr Layout kLayout{70, 65, 2};
  for (const bool huge : {false, true}) {
    SCOPED_TRACE(huge ? "huge" : "small");
    MergedFilm film(kLayout, huge ? 40 : 20);
    std::uint64_t failures = 0;
    for (std::uint64_t i = 0; i < 3; ++i) {
      const Delta delta = delta_of(kLayout, 0, i, huge);
      const std::string before = film.serialise();
      bool merged = false;
      for (std::uint64_t skip = 0; !merged; ++skip) {
        ASSERT_LT(skip, 1000U);
        try {
          const test::FailingAllocations failing(1, skip);
          ASSERT_TRUE(film.merge(delta).ok());
          merged = true;
        } catch (const std::bad_alloc&) {
          ++failures;
          ASSERT_EQ(film.serialise(), before) << "after " << skip << " allocations";
        }
      }
    }
    // Memory that was taken for an attempt serves the next one, so each tile fails at most once.
    EXPECT_GT(failures, 5U) << "nothing failed: the test is none";
    Int128 largest = 0;
    for (std::uint32_t y = 0; y < kLayout.height; ++y)
      for (std::uint32_t x = 0; x < kLayout.width; ++x) largest = std::max(largest, film.sum(0, 1, x, y, 0));
    EXPECT_EQ(largest > std::numeric_limits<std::int64_t>::max(), huge) << "sums were widened";
    MergedFilm whole(kLayout, huge ? 40 : 20);
    for (std::uint64_t i = 3; i-- > 0;) ASSERT_TRUE(whole.merge(delta_of(kLayout, 0, i, huge)).ok());
    EXPECT_EQ(film.serialise(), whole.serialise());
  }
}

// Claim: what a job's film is said to need is what it takes, within 20 %: of one layer and of several, large
// and small, with borders that cut tiles.
TEST(FilmMemory, IsAsItWasSaid) {
  for (const Layout layout : {Layout{320, 200, 1}, Layout{97, 61, 3}, Layout{512, 512, 2}}) {
    WorkPlan plan;
    for (std::uint32_t i = 1; i < layout.layers; ++i) plan.layers.push_back("layer" + std::to_string(i));
    const Delta first = delta_of(layout, 0, 0, false), second = delta_of(layout, 1, 0, false);
    const std::int64_t before = test::allocations().live_bytes;
    const auto film = std::make_unique<MergedFilm>(layout, 20);
    ASSERT_TRUE(film->merge(first).ok() && film->merge(second).ok());
    const auto taken = static_cast<double>(test::allocations().live_bytes - before);
    const MemoryNeed need = memory_need(plan, layout.width, layout.height);
    EXPECT_NEAR(static_cast<double>(need.film) / taken, 1, 0.2) << layout.width << ' ' << layout.layers;
    // A copy and its bytes are what a checkpoint takes.
    const std::int64_t between = test::allocations().live_bytes;
    const auto copy = std::make_unique<MergedFilm>(*film);
    std::string bytes;
    copy->serialise(bytes);
    const auto working = static_cast<double>(test::allocations().live_bytes - between);
    EXPECT_GE(static_cast<double>(need.working), 0.95 * working);
    EXPECT_LE(static_cast<double>(need.working), 1.5 * working);
  }
}

// Claim: a job that can never fit is refused with the figures and the mend.
TEST(FilmMemory, RefusalsHaveFigures) {
  JobSettings settings;
  settings.width = settings.height = 16384;
  const MemoryNeed need = memory_need({}, settings.width, settings.height);
  EXPECT_GT(need.film, std::uint64_t{16384} * 16384 * 48);
  EXPECT_TRUE(check_memory(need, settings, need.all()).ok());
  const auto refused = check_memory(need, settings, std::uint64_t{12} << 30);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().kind, ErrorKind::input);
  for (const char* word :
       {"16384 x 16384", "12.9 GB for its film", "12.9 GB for jobs", "--memory", "smaller image"})
    EXPECT_NE(refused.error().to_string().find(word), std::string::npos) << refused.error().to_string();
}

}  // namespace
}  // namespace candela::film
