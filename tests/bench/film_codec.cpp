// Bytes and CPU time of film deltas and checkpoints at 1080p, for made-up but noise-like sums: mean 2^20
// units an iteration, 8 iterations, relative noise of one iteration 1, channels correlated as those of one
// path are.
#include <benchmark/benchmark.h>

#include <cmath>

#include "common/film/film.h"

namespace {

using namespace candela;

constexpr film::Layout kLayout{1920, 1080, 1};

// Exponentially distributed luminance (deviation = mean) times a colour that varies over the image and a
// little by path.
void fill(film::UnitFilm& film) {
  film::SampleCounts sample_counts;
  for (std::uint32_t i = 0; i < 8; ++i) {
    for (std::uint32_t y = 0; y < kLayout.height; ++y) {
      for (std::uint32_t x = 0; x < kLayout.width; ++x) {
        const std::uint64_t key = rng::key(1, i, y, x);
        rng::Stream stream(key);
        const float luminance = -std::log(1 - stream.next_float());
        const float shade = 0.2F + 1.6F * static_cast<float>(x) / kLayout.width;
        const auto jitter = [&] { return luminance * shade * (0.9F + 0.2F * stream.next_float()); };
        film.add(0, x, y, {jitter(), 0.7F * jitter(), 0.4F * jitter()}, key, sample_counts);
      }
    }
  }
}

film::DeltaInfo info_of(std::uint64_t begin) {
  film::DeltaInfo info;
  info.unit = {Unit::Kind::iterations, 0, begin, begin + 8};
  return info;
}

// Sums, in 64 bits each, that one second handles: comparable between the steps.
void report(benchmark::State& state, std::size_t bytes) {
  state.SetBytesProcessed(static_cast<std::int64_t>(kLayout.pixel_count() * 24) * state.iterations());
  state.counters["delta_MB"] = static_cast<double>(bytes) * 1e-6;
  state.counters["bits_per_value"] =
      static_cast<double>(bytes) * 8 / static_cast<double>(kLayout.pixel_count() * 3);
}

void encode(benchmark::State& state) {
  film::UnitFilm film(kLayout, 20);
  fill(film);
  std::size_t bytes = 0;
  for (auto _ : state) bytes = film::encode_delta(film, info_of(0)).size();
  report(state, bytes);
}

void decode_and_merge(benchmark::State& state) {
  film::UnitFilm film(kLayout, 20);
  fill(film);
  film::MergedFilm merged(kLayout, 20);
  std::uint64_t begin = 0;
  std::size_t bytes = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const std::string delta_bytes = film::encode_delta(film, info_of(begin));
    bytes = delta_bytes.size();
    begin += 8;
    state.ResumeTiming();
    const auto delta = film::Delta::decode(delta_bytes, kLayout);
    if (!delta.ok() || !merged.merge(*delta).ok()) state.SkipWithError("the delta did not merge");
  }
  report(state, bytes);
}

void serialise(benchmark::State& state) {
  film::UnitFilm film(kLayout, 20);
  fill(film);
  film::MergedFilm merged(kLayout, 20);
  const auto delta = film::Delta::decode(film::encode_delta(film, info_of(0)), kLayout);
  if (!delta.ok() || !merged.merge(*delta).ok()) state.SkipWithError("the delta did not merge");
  std::size_t bytes = 0;
  for (auto _ : state) bytes = merged.serialise().size();
  report(state, bytes);
}

void develop(benchmark::State& state) {
  film::UnitFilm film(kLayout, 20);
  fill(film);
  film::MergedFilm merged(kLayout, 20);
  const auto delta = film::Delta::decode(film::encode_delta(film, info_of(0)), kLayout);
  if (!delta.ok() || !merged.merge(*delta).ok()) state.SkipWithError("the delta did not merge");
  for (auto _ : state) benchmark::DoNotOptimize(merged.develop(0));
  report(state, 0);
}

BENCHMARK(encode)->Unit(benchmark::kMillisecond);
BENCHMARK(decode_and_merge)->Unit(benchmark::kMillisecond);
BENCHMARK(serialise)->Unit(benchmark::kMillisecond);
BENCHMARK(develop)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
