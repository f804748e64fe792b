#include "master/http/pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/base/memory_limit.h"
#include "common/film/development.h"
#include "common/film/merged_film.h"
#include "common/stats/image_error.h"
#include "master/farm.h"
#include "master/jobs/develop.h"

namespace candela::master {
namespace {

// Means of 2 x 2 pixels; fewer at an odd edge.
Picture::Level halved(const Picture::Level& from) {
  Picture::Level to{(from.width + 1) / 2, (from.height + 1) / 2, {}};
  to.rgb.resize(std::size_t{3} * to.width * to.height);
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x)
      for (std::uint32_t c = 0; c < 3; ++c) {
        float sum = 0, count = 0;
        for (std::uint32_t v = 2 * y; v < std::min(2 * y + 2, from.height); ++v)
          for (std::uint32_t u = 2 * x; u < std::min(2 * x + 2, from.width); ++u, ++count)
            sum += from.rgb[3 * (std::size_t{v} * from.width + u) + c];
        to.rgb[3 * (std::size_t{y} * to.width + x) + c] = sum / count;
      }
  return to;
}

// Values that are not positive are 0.
void append_pixel(const float* rgb, std::string& out) {
  const float largest = std::max({rgb[0], rgb[1], rgb[2]});
  char bytes[4] = {};
  if (largest > 1e-32F && std::isfinite(largest)) {
    int exponent = 0;
    const float scale = std::frexp(largest, &exponent) * 256 / largest;
    for (int c = 0; c < 3; ++c)
      bytes[c] =
          static_cast<char>(static_cast<unsigned char>(rgb[c] > 0 ? std::min(rgb[c] * scale, 255.0F) : 0.0F));
    bytes[3] = static_cast<char>(static_cast<unsigned char>(exponent + 128));
  }
  out.append(bytes, 4);
}

// FNV-1a over words of 8 bytes: names tiles, keeps no secret.
std::string etag_of(const std::string& bytes) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (std::size_t i = 0; i < bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, std::min<std::size_t>(8, bytes.size() - i));
    hash = (hash ^ word) * 1099511628211ULL;
    hash ^= hash >> 29;
  }
  return fmt::format("{:016x}", hash);
}

// Means over 5 x 5 pixels, by two passes over 5.
std::vector<float> smoothed(const std::vector<float>& values, std::uint32_t width, std::uint32_t height) {
  const auto pass = [](const std::vector<float>& in, std::uint32_t count, std::uint32_t lines,
                       std::size_t step, std::size_t line_step) {
    std::vector<float> out(in.size());
    for (std::uint32_t line = 0; line < lines; ++line)
      for (std::uint32_t i = 0; i < count; ++i) {
        float sum = 0, n = 0;
        for (std::uint32_t k = i < 2 ? 0 : i - 2; k < std::min(i + 3, count); ++k, ++n)
          sum += in[line * line_step + k * step];
        out[line * line_step + i * step] = sum / n;
      }
    return out;
  };
  return pass(pass(values, width, height, 1, width), height, width, width, 1);
}

std::vector<float> relative_error(const std::vector<float>& rgb, const std::vector<float>& variance,
                                  std::uint32_t width, std::uint32_t height) {
  double sum = 0;
  for (const float v : rgb) sum += v;
  const double mean = sum / static_cast<double>(rgb.size()), floor = 0.01 * mean * mean;
  std::vector<float> squares(rgb.size() / 3);
  for (std::size_t i = 0; i < squares.size(); ++i) {
    double term = 0;
    for (std::size_t v = 3 * i; v < 3 * i + 3; ++v) {
      const double below = double{rgb[v]} * rgb[v] + floor;
      if (below > 0) term += variance[v] / below / 3;
    }
    squares[i] = static_cast<float>(term);
  }
  squares = smoothed(squares, width, height);
  std::vector<float> out(rgb.size());
  for (std::size_t i = 0; i < squares.size(); ++i)
    std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(3 * i), 3, std::sqrt(squares[i]));
  return out;
}

}  // namespace

Picture::Picture(std::uint32_t width, std::uint32_t height, std::vector<float> rgb, std::uint64_t iterations)
    : iterations_(iterations) {
  levels_.push_back({width, height, std::move(rgb)});
  while (std::max(levels_.back().width, levels_.back().height) > kPageTile)
    levels_.push_back(halved(levels_.back()));
}

Picture::Tile Picture::tile(std::size_t level, std::uint32_t x, std::uint32_t y) {
  if (level >= levels_.size()) return {};
  const Level& l = levels_[level];
  const auto tiles = [](std::uint32_t pixels) { return (pixels + kPageTile - 1) / kPageTile; };
  if (x >= tiles(l.width) || y >= tiles(l.height)) return {};
  const Lock lock(mutex_);
  Tile& tile = tiles_[{static_cast<std::uint32_t>(level), x, y}];
  if (tile.bytes) return tile;
  const std::uint32_t x_end = std::min((x + 1) * kPageTile, l.width);
  const std::uint32_t y_end = std::min((y + 1) * kPageTile, l.height);
  std::string bytes;
  bytes.reserve(std::size_t{4} * kPageTile * kPageTile);
  for (std::uint32_t v = y * kPageTile; v < y_end; ++v)
    for (std::uint32_t u = x * kPageTile; u < x_end; ++u)
      append_pixel(&l.rgb[3 * (std::size_t{v} * l.width + u)], bytes);
  tile.etag = etag_of(bytes);
  tile.bytes = std::make_shared<const std::string>(std::move(bytes));
  return tile;
}

std::uint64_t Picture::memory_bytes(std::uint32_t width, std::uint32_t height) {
  // 3 floats and a tile's 4 bytes a pixel, and a third more for smaller levels.
  return std::uint64_t{width} * height * (3 * sizeof(float) + 4) * 4 / 3;
}

namespace {

Result<std::shared_ptr<Picture>> picture_of(const JobRow& row, JobFilm& film, bool error) {
  const auto nothing = [] { return refused_error("nothing is merged yet"); };
  const JobFilm::Snapshot copy = film.snapshot(JobFilm::Part::image);
  if (!copy.film || copy.film->iterations() == 0) return nothing();
  if (error && (copy.film->merged(0).count() == 0 || copy.film->merged(1).count() == 0))
    return refused_error("an error estimate needs iterations of both halves");
  CANDELA_ASSIGN(const film::Development development, develop(row, copy, {}));
  const std::uint32_t width = row.settings.width, height = row.settings.height;
  std::vector<float> rgb = film::develop_image(*copy.film, development, film::MergedFilm::Which::both);
  if (error) rgb = relative_error(rgb, stats::variance_map(*copy.film, development), width, height);
  return std::make_shared<Picture>(width, height, std::move(rgb), row.iterations_of(copy.film->iterations()));
}

}  // namespace

Result<std::shared_ptr<Picture>> make_picture(Farm& farm, const std::string& job_id, bool error) {
  struct View {
    JobRow row;
    MemoryNeed need;
  };
  const View view = farm.with_scheduler([&](Scheduler& s) {
    const Job& job = *s.job(job_id);
    return View{job.row, job.need};
  });
  CANDELA_ASSIGN(const ImageMemory::Place place, farm.images().memory().take(view.need.working));
  const std::shared_ptr<JobFilm> known = farm.film_of(job_id);
  const bool only_here = known && !known->loaded() && has_ended(view.row.state);
  auto made = within_memory("the picture cannot be made", [&]() -> Result<std::shared_ptr<Picture>> {
    CANDELA_ASSIGN(const std::shared_ptr<JobFilm> film, farm.truth().open_film(job_id, !only_here));
    if (!film) return refused_error("nothing is merged yet");
    return picture_of(view.row, *film, error);
  });
  if (only_here) known->unload_if_idle(farm.now().seconds, 0);
  return made;
}

}  // namespace candela::master
