// The cost of exact film adds beside plain float adds of the same memory layout, one and two threads, along
// rows and at random. Compare the lines of one run: time of exact / time of plain.
//
// Each thread owns its own band of rows, as eye paths do; "splat" is the atomic add that light paths use.
#include <benchmark/benchmark.h>

#include "common/film/film.h"

namespace {

using namespace candela;

constexpr std::uint32_t kWidth = 1920;
constexpr std::uint32_t kHeight = 1080;

// The film of a renderer without exactness: float sums, no checks.
class PlainFilm {
 public:
  PlainFilm() : sums_(std::size_t{kWidth} * kHeight * 3) {}
  void add(std::uint32_t x, std::uint32_t y, const std::array<float, 3>& rgb) {
    float* to = sums_.data() + (std::size_t{y} * kWidth + x) * 3;
    for (std::size_t c = 0; c < 3; ++c) to[c] += rgb[c];
  }

 private:
  std::vector<float> sums_;
};

struct Films {
  PlainFilm plain;
  film::UnitFilm exact{{kWidth, kHeight, 1}, 20};
};
const std::unique_ptr<Films>& films() {
  static const auto both = std::make_unique<Films>();
  return both;
}

enum class Film { plain, exact, splat };
enum class Order { rows, random };

template <Film kFilm, Order kOrder>
void add(benchmark::State& state) {
  Films& both = *films();
  const auto threads = static_cast<std::uint32_t>(state.threads());
  const std::uint32_t band = kHeight / threads;
  const std::uint32_t top = band * static_cast<std::uint32_t>(state.thread_index());
  std::uint32_t x = 0, y = 0, pass = 0;
  film::SampleCounts sample_counts;
  for (auto _ : state) {
    // The sample's key and value, made the same way for all films; a renderer has both anyway.
    const std::uint64_t key = rng::combine((std::uint64_t{pass} << 32) | (top + y), x);
    const std::array<float, 3> rgb{rng::to_float(static_cast<std::uint32_t>(key)),
                                   rng::to_float(static_cast<std::uint32_t>(key >> 32)), 0.25F};
    std::uint32_t px = x, py = y;
    if constexpr (kOrder == Order::random) {
      px = static_cast<std::uint32_t>((key & 0xffffffff) * kWidth >> 32);
      py = static_cast<std::uint32_t>((key >> 32) * band >> 32);
    }
    if constexpr (kFilm == Film::plain) {
      both.plain.add(px, top + py, rgb);
    } else if constexpr (kFilm == Film::exact) {
      both.exact.add(0, px, top + py, rgb, key, sample_counts);
    } else {
      both.exact.splat(0, px, top + py, rgb, key, sample_counts);
    }
    benchmark::ClobberMemory();
    if (++x == kWidth) {
      x = 0;
      if (++y == band) {
        y = 0;
        ++pass;
      }
    }
  }
  state.SetItemsProcessed(state.iterations());
}

BENCHMARK(add<Film::plain, Order::rows>)->ThreadRange(1, 2)->Name("rows/plain");
BENCHMARK(add<Film::exact, Order::rows>)->ThreadRange(1, 2)->Name("rows/exact");
BENCHMARK(add<Film::splat, Order::rows>)->ThreadRange(1, 2)->Name("rows/splat");
BENCHMARK(add<Film::plain, Order::random>)->ThreadRange(1, 2)->Name("random/plain");
BENCHMARK(add<Film::exact, Order::random>)->ThreadRange(1, 2)->Name("random/exact");
BENCHMARK(add<Film::splat, Order::random>)->ThreadRange(1, 2)->Name("random/splat");

}  // namespace

BENCHMARK_MAIN();
