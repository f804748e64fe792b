// The loops that integrators share: each light path once per iteration, the same film whatever the threads,
// stops that are noticed, progress that only grows.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <mutex>
#include <set>

#include "tests/unit/scene_fixture.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/light_paths.h"

namespace candela::integrators {
namespace {

const film::Layout kLayout{50, 40, 2};

struct Stage {
  std::unique_ptr<scene::Scene> scene;
  film::PixelFilter filter;
  UnitContext context() const {
    return {*scene, filter, samplers::SamplerKind::sobol, 11, kLayout.width, kLayout.height};
  }
};
Stage make_stage() {
  auto scene = test::build_scene("<shape type=\"sphere\"/>");
  auto filter = film::PixelFilter::create("box", {});
  if (!scene.ok() || !filter.ok()) throw std::runtime_error("no stage");
  return {std::move(*scene), *filter};
}

// A stand-in for a light integrator: each path splats one value to a random pixel of both layers.
Result<void> splat_some(const Stage& stage, const Unit& unit, std::uint64_t paths, film::UnitFilm& film,
                        const RunContext& run) {
  return run_light_paths(stage.context(), unit, paths, film, run, [&](film::SampleCounts& sample_counts) {
    return [&](std::uint64_t, samplers::Sampler& sampler) {
      const Vec2 at = sampler.next_2d();
      const auto x = static_cast<std::uint32_t>(at.x * static_cast<float>(kLayout.width));
      const auto y = static_cast<std::uint32_t>(at.y * static_cast<float>(kLayout.height));
      const float value = sampler.next_1d();
      film.splat(0, x, y, {value, 1, 0}, sampler.sample_key(), sample_counts);
      film.splat(1, x, y, {0, value, 1}, sampler.sample_key(), sample_counts);
      ++sample_counts.rays;
    };
  });
}

// Claim: sums and sample counts do not depend on the threads, nor on how iterations are cut into units, and
// the count of light paths is the iterations' times the paths'.
TEST(LightPaths, ThreadsAndCutsChangeNothing) {
  const Stage stage = make_stage();
  constexpr std::uint64_t kPaths = 5 * kLightChunk + 17;
  film::UnitFilm one(kLayout, 20), four(kLayout, 20), cut(kLayout, 20), other(kLayout, 20);
  ASSERT_TRUE(splat_some(stage, {Unit::Kind::iterations, 1, 3, 7}, kPaths, one, {1}).ok());
  ASSERT_TRUE(splat_some(stage, {Unit::Kind::iterations, 1, 3, 7}, kPaths, four, {4}).ok());
  ASSERT_TRUE(splat_some(stage, {Unit::Kind::iterations, 1, 4, 7}, kPaths, cut, {2}).ok());
  ASSERT_TRUE(splat_some(stage, {Unit::Kind::iterations, 1, 3, 4}, kPaths, cut, {3}).ok());
  ASSERT_TRUE(splat_some(stage, {Unit::Kind::iterations, 0, 3, 7}, kPaths, other, {1}).ok());
  EXPECT_EQ(one.sample_counts().light_paths, 4 * kPaths);
  EXPECT_EQ(one.sample_counts().rays, 4 * kPaths);
  const std::size_t values = kLayout.pixel_count() * kLayout.layers * film::kChannels;
  const std::vector<std::int64_t> sums(one.sums(), one.sums() + values);
  EXPECT_EQ(sums, std::vector<std::int64_t>(four.sums(), four.sums() + values));
  EXPECT_EQ(sums, std::vector<std::int64_t>(cut.sums(), cut.sums() + values));
  EXPECT_NE(sums, std::vector<std::int64_t>(other.sums(), other.sums() + values)) << "halves must differ";
  EXPECT_EQ(one.sample_counts(), four.sample_counts());
  EXPECT_EQ(one.sample_counts(), cut.sample_counts());
}

// Claim: chunks cover [0, count) once, none is longer than kLightChunk or starts elsewhere than at a
// multiple.
TEST(LightPaths, ChunksCoverTheCountOnce) {
  for (const std::uint64_t count :
       {std::uint64_t{0}, std::uint64_t{1}, kLightChunk, kLightChunk + 1, 9 * kLightChunk - 1}) {
    film::UnitFilm film(kLayout, 0);
    std::mutex mutex;
    std::map<std::uint64_t, std::uint64_t> chunks;
    ASSERT_TRUE(for_each_light_chunk(count, film, {3},
                                     [&](std::uint64_t begin, std::uint64_t end, film::SampleCounts&) {
                                       const std::lock_guard lock(mutex);
                                       EXPECT_TRUE(chunks.emplace(begin, end).second);
                                     })
                    .ok());
    EXPECT_EQ(chunks.size(), light_chunk_count(count));
    std::uint64_t at = 0;
    for (const auto& [begin, end] : chunks) {
      EXPECT_EQ(begin, at);
      EXPECT_EQ(begin % kLightChunk, 0U);
      EXPECT_GT(end, begin);
      EXPECT_LE(end - begin, kLightChunk);
      at = end;
    }
    EXPECT_EQ(at, count);
  }
}

// Claim: a stop set while paths are traced ends the loop with the error "stopped", whatever the threads, and
// soon: no more than the chunks in hand are finished.
TEST(LightPaths, StopIsNoticed) {
  const Stage stage = make_stage();
  for (const unsigned threads : {1U, 3U}) {
    std::atomic<bool> stop{false};
    std::atomic<std::uint64_t> traced{0};
    film::UnitFilm film(kLayout, 0);
    const auto result =
        run_light_paths(stage.context(), {Unit::Kind::iterations, 0, 0, 100000}, 100 * kLightChunk, film,
                        {threads, &stop, nullptr}, [&](film::SampleCounts&) {
                          return [&](std::uint64_t, samplers::Sampler&) {
                            if (++traced == 10) stop = true;
                          };
                        });
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().kind, ErrorKind::refused);
    EXPECT_LE(traced.load(), threads * kLightChunk);
  }
}

// Claim: a loop that may be cut begins no task after that but the first, ends those that it has begun, and
// returns how many: they are the first ones. Other loops do not heed the cut.
TEST(Tasks, CutLoopsHaveTheFirstTasks) {
  film::UnitFilm film(kLayout, 0);
  for (const unsigned threads : {1U, 3U})
    for (const std::uint64_t cut_at : {0U, 7U}) {
      SCOPED_TRACE(fmt::format("{} threads, cut in task {}", threads, cut_at));
      std::atomic<bool> cut{false};
      std::mutex mutex;
      std::set<std::uint64_t> done;
      RunContext run{threads};
      run.cut = &cut;
      const auto body = [&](std::uint64_t task, film::SampleCounts&) {
        if (task == cut_at) cut = true;
        const std::lock_guard lock(mutex);
        done.insert(task);
      };
      const auto count = for_first_tasks(1000, film, run, body);
      ASSERT_TRUE(count.ok());
      EXPECT_GE(*count, cut_at + 1);
      EXPECT_EQ(done.size(), *count);
      EXPECT_EQ(*done.rbegin(), *count - 1);
      if (threads == 1) {
        EXPECT_EQ(*count, cut_at + 1);
      }
      done.clear();
      EXPECT_EQ(*for_first_tasks(1000, film, run, body), 1U) << "it is cut from the beginning";
      done.clear();
      ASSERT_TRUE(for_each_task(1000, film, run, body).ok());
      EXPECT_EQ(done.size(), 1000U);
      std::atomic<bool> stop{true};
      run.stop = &stop;
      EXPECT_FALSE(for_first_tasks(1000, film, run, body).ok());
    }
}

// Claim: a unit of several loops reports a progress that starts at its parts' begins, only grows, and ends at
// 1. (One thread: with more, two stores may swap, which the next one mends.)
TEST(Tasks, ProgressSpansGrowToOne) {
  std::atomic<float> progress{0};
  film::UnitFilm film(kLayout, 0);
  const RunContext run{1, nullptr, &progress};
  float last = 0;
  for (std::uint64_t part = 0; part < 6; part += 2) {
    ASSERT_TRUE(for_each_light_chunk(
                    3 * kLightChunk, film, run,
                    [&](std::uint64_t, std::uint64_t, film::SampleCounts&) {
                      EXPECT_GE(progress.load(), last);
                      last = progress.load();
                    },
                    progress_part(part, 6))
                    .ok());
    EXPECT_FLOAT_EQ(progress.load(), static_cast<float>(part + 1) / 6);
    ASSERT_TRUE(for_each_tile(
                    kLayout.width, kLayout.height, film, run,
                    [&](std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t, film::SampleCounts&) {
                      EXPECT_GE(progress.load(), last);
                      last = progress.load();
                    },
                    progress_part(part + 1, 6))
                    .ok());
  }
  EXPECT_EQ(progress.load(), 1);
}

// Claim: (half, index) counts a job's iterations without a gap, in the order in which half i % 2 takes i.
TEST(Tasks, GlobalIterationsCountBothHalves) {
  for (std::uint64_t i = 0; i < 10; ++i)
    EXPECT_EQ(global_iteration(static_cast<std::uint32_t>(i % 2), i / 2), i);
  EXPECT_EQ(global_iteration(1, Limits::max_iterations), 2 * Limits::max_iterations + 1);
}

}  // namespace
}  // namespace candela::integrators
