// Texture lookups: nanoseconds of a bilinear lookup in tiles as against rows, in memory as against the
// scratch file, and through a virtual call as against a switch. Variants run in turn;
// the fastest turn of each counts, for other programs only ever add.
//
//   bench_textures [SIDE]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "tests/bench/count_argument.h"
#include "tests/bench/thread_time.h"
#include "worker/scene/textures/bitmap.h"

namespace {

using namespace candela;
using namespace candela::scene;

constexpr int kLookups = 1 << 17;
constexpr int kTurns = 41;

float sum = 0;  // so that nothing is optimised away

// CPU time: the machine may be busy.
double cpu_nanoseconds() {
  return 1e9 * bench::thread_cpu_seconds();
}

double nanoseconds(const std::vector<Vec2>& uvs, const auto& eval) {
  // Once untimed: the variants must not begin with each other's cache.
  Spectrum total;
  for (const Vec2 uv : uvs) total += eval(uv);
  const double begin = cpu_nanoseconds();
  for (const Vec2 uv : uvs) total += eval(uv);
  const double time = cpu_nanoseconds() - begin;
  sum += total.r + total.g + total.b;
  return time / static_cast<double>(uvs.size());
}

// Tiles are measured against this: texels in rows, four bytes each, the arithmetic of Bitmap.
struct Rows {
  std::uint32_t width, height;
  std::vector<std::uint8_t> bytes;
  std::array<float, 256> table;
  bool identity = true;
  Spectrum at(std::size_t i) const {
    return {table[bytes[4 * i]], table[bytes[4 * i + 1]], table[bytes[4 * i + 2]]};
  }
  [[gnu::noinline]] Spectrum eval(Vec2 uv) const {
    if (!identity) uv = {2 * uv.x, 2 * uv.y};
    const double x = static_cast<double>(uv.x) * width - 0.5, y = static_cast<double>(uv.y) * height - 0.5;
    const double fx = std::floor(x), fy = std::floor(y);
    const auto integer = [](double v) { return std::abs(v) < 1e15 ? static_cast<std::int64_t>(v) : 0; };
    const std::int64_t ix = integer(fx), iy = integer(fy);
    const double span_x = x - fx, span_y = y - fy;
    const float wx = span_x >= 0 && span_x <= 1 ? static_cast<float>(span_x) : 0.0f;
    const float wy = span_y >= 0 && span_y <= 1 ? static_cast<float>(span_y) : 0.0f;
    const auto wrap = [](std::int64_t i, std::int64_t n) {
      return static_cast<std::size_t>(i >= 0 && i < n ? i : (i % n + n) % n);
    };
    const std::size_t x0 = wrap(ix, width), x1 = wrap(ix + 1, width);
    const std::size_t y0 = wrap(iy, height) * width, y1 = wrap(iy + 1, height) * width;
    const Spectrum top = at(y0 + x0) * (1 - wx) + at(y0 + x1) * wx;
    const Spectrum bottom = at(y1 + x0) * (1 - wx) + at(y1 + x1) * wx;
    return top * (1 - wy) + bottom * wy;
  }
};

std::shared_ptr<const TexelImage> tiles_of(const Rows& rows, Scratch& scratch) {
  auto image = std::make_shared<TexelImage>();
  image->width = rows.width;
  image->height = rows.height;
  image->format = TexelFormat::rgb8;
  image->table = rows.table;
  auto writer = TexelWriter::create(scratch, *image);
  const int pick[3] = {0, 1, 2};
  for (std::uint32_t y = 0; writer.ok() && y < rows.height; ++y) {
    if (!writer->add_row(&rows.bytes[static_cast<std::size_t>(y) * rows.width * 4], 4, pick).ok())
      return nullptr;
  }
  return writer.ok() && writer->finish(*image).ok() ? image : nullptr;
}

// A second kind of texture, as cheap as they come.
class Squares final : public Texture {
 public:
  Spectrum eval(Vec2 uv) const override {
    return Spectrum((uv.x - std::floor(uv.x) > 0.5f) == (uv.y - std::floor(uv.y) > 0.5f) ? 0.4f : 0.2f);
  }
  TextureGradient gradient(Vec2) const override { return {}; }
  Spectrum maximum() const override { return Spectrum(0.4f); }
  Spectrum minimum() const override { return Spectrum(0.2f); }
};

void compare(
    const char* title, const std::vector<Vec2>& uvs,
    const std::vector<std::pair<const char*, std::function<double(const std::vector<Vec2>&)>>>& variants) {
  std::vector<std::vector<double>> times(variants.size());
  for (int turn = 0; turn < kTurns; ++turn)
    for (std::size_t i = 0; i < variants.size(); ++i) times[i].push_back(variants[i].second(uvs));
  std::printf("%s:", title);
  for (std::size_t i = 0; i < variants.size(); ++i)
    std::printf(" %s %.1f ns%s", variants[i].first, *std::min_element(times[i].begin(), times[i].end()),
                i + 1 < variants.size() ? "," : "\n");
}

}  // namespace

int main(int argc, char** argv) {
  const auto side = static_cast<std::uint32_t>(bench::count_argument("SIDE", argc, argv, 1, 4096, 32768));
  rng::Stream stream(rng::key(7));
  Rows rows{side, side, {}, {}, argc < 9};
  rows.bytes.resize(static_cast<std::size_t>(side) * side * 4);
  for (auto& v : rows.bytes) v = static_cast<std::uint8_t>(stream.next_u32());
  for (std::size_t v = 0; v < 256; ++v) rows.table[v] = static_cast<float>(v * v) / 65025;
  TextureLimits none;
  none.memory_bytes = 1;
  TextureLimits plenty;
  plenty.memory_bytes = std::uint64_t{1} << 40;
  Scratch file(none), memory(plenty);
  const auto in_memory = tiles_of(rows, memory), in_file = tiles_of(rows, file);
  if (!in_memory || !in_file) return std::fprintf(stderr, "bench_textures: no room\n"), 1;
  const Bitmap tiles(in_memory, {}), mapped(in_file, {});

  // Places all over, and places along short walks in any direction, as neighbouring pixels have them.
  std::vector<Vec2> random(kLookups), walks(kLookups);
  for (Vec2& uv : random) uv = {stream.next_float(), stream.next_float()};
  for (std::size_t i = 0; i < walks.size(); ++i) {
    static Vec2 at, step;
    if (i % 64 == 0) {
      at = {stream.next_float(), stream.next_float()};
      step = {(stream.next_float() - 0.5f) * 4 / static_cast<float>(side),
              (stream.next_float() - 0.5f) * 4 / static_cast<float>(side)};
    }
    walks[i] = at = {at.x + step.x, at.y + step.y};
  }
  const auto by_rows = [&](const std::vector<Vec2>& uvs) {
    return nanoseconds(uvs, [&](Vec2 uv) { return rows.eval(uv); });
  };
  const auto by_tiles = [&](const std::vector<Vec2>& uvs) {
    return nanoseconds(uvs, [&](Vec2 uv) { return tiles.eval(uv); });
  };
  const auto by_file = [&](const std::vector<Vec2>& uvs) {
    return nanoseconds(uvs, [&](Vec2 uv) { return mapped.eval(uv); });
  };
  compare("random", random, {{"rows", by_rows}, {"tiles", by_tiles}, {"tiles in the file", by_file}});
  compare("walks", walks, {{"rows", by_rows}, {"tiles", by_tiles}, {"tiles in the file", by_file}});

  // Dispatch: two kinds of textures, chosen at random for each lookup, by their virtual eval and by a switch.
  const Squares other;
  struct Entry {
    int kind;
    const Texture* texture;
  };
  std::vector<Entry> entries;
  for (int i = 0; i < 1024; ++i)
    entries.push_back(stream.next_u32() % 2 == 0 ? Entry{0, &tiles} : Entry{1, &other});
  const auto dispatch = [&](const auto& call) {
    return [&entries, call](const std::vector<Vec2>& uvs) {
      std::size_t i = 0;
      return nanoseconds(uvs, [&](Vec2 uv) { return call(entries[i++ % 1024], uv); });
    };
  };
  const auto virtually = dispatch([](const Entry& e, Vec2 uv) { return e.texture->eval(uv); });
  const auto by_switch = dispatch([](const Entry& e, Vec2 uv) {
    switch (e.kind) {
      case 0:
        return static_cast<const Bitmap*>(e.texture)->Bitmap::eval(uv);
      default:
        return static_cast<const Squares*>(e.texture)->Squares::eval(uv);
    }
  });
  compare("walks, mixed", walks, {{"virtual", virtually}, {"switch", by_switch}});
  return sum < 0 ? 1 : 0;
}
