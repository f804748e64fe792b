#include "master/http/pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/base/memory_limit.h"
#include "common/base/text.h"
#include "common/film/development.h"
#include "common/film/merged_film.h"
#include "common/job/aov.h"
#include "common/stats/image_error.h"
#include "master/farm.h"
#include "master/jobs/aov_layers.h"
#include "master/jobs/develop.h"
#include "master/jobs/film_layers.h"

namespace candela::master {
namespace {

// Means of 2 x 2 pixels; fewer at an odd edge.
Picture::Level halved(const Picture::Level& from) {
  Picture::Level to{(from.width + 1) / 2, (from.height + 1) / 2, {}, {}};
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

namespace {

// So many values of layers a mix has at its finest level: 6 bytes each, which a browser fetches, too.
constexpr std::uint64_t kMaxMixPixels = 12'000'000;

// Widths and heights of the levels of a picture.
std::vector<Picture::Level> empty_levels(std::uint32_t width, std::uint32_t height) {
  std::vector<Picture::Level> levels = {{width, height, {}, {}}};
  while (std::max(levels.back().width, levels.back().height) > kPageTile)
    levels.push_back({(levels.back().width + 1) / 2, (levels.back().height + 1) / 2, {}, {}});
  return levels;
}

std::size_t first_level_of_mix(const std::vector<Picture::Level>& levels, std::size_t layers) {
  std::size_t first = 0;
  while (first + 1 < levels.size() &&
         std::uint64_t{levels[first].width} * levels[first].height * layers > kMaxMixPixels)
    ++first;
  return first;
}

void append_half(std::uint16_t half, std::string& out) {
  out += static_cast<char>(half & 0xff);
  out += static_cast<char>(half >> 8);
}

}  // namespace

std::uint16_t half_of(float value) {
  constexpr float largest = 65504;
  constexpr int mantissa_bits = 10, least_exponent = -14;
  const auto sign = static_cast<std::uint16_t>(std::signbit(value) ? 0x8000 : 0);
  if (std::isnan(value)) return 0x7e00;
  const float size = std::min(std::abs(value), largest);
  int exponent = 0;
  std::frexp(size, &exponent);  // size = f 2^exponent, f in [1/2, 1)
  // Below 2^-14 the steps are those of 2^-14.
  exponent = std::max(exponent - 1, least_exponent);
  const auto steps = static_cast<std::uint32_t>(std::nearbyint(std::ldexp(size, mantissa_bits - exponent)));
  // A number of steps that rounds up to the next power of two carries into the exponent.
  const std::uint32_t bits =
      size == 0 ? 0 : (static_cast<std::uint32_t>(exponent - least_exponent) << mantissa_bits) + steps;
  return static_cast<std::uint16_t>(sign | bits);
}

Picture::Picture(std::uint32_t width, std::uint32_t height, std::vector<float> rgb, Facts facts)
    : facts_(std::move(facts)) {
  levels_.push_back({width, height, std::move(rgb), {}});
  while (std::max(levels_.back().width, levels_.back().height) > kPageTile)
    levels_.push_back(halved(levels_.back()));
}

Picture::Picture(std::uint32_t width, std::uint32_t height, Facts facts, const Develop& develop)
    : facts_(std::move(facts)), levels_(empty_levels(width, height)) {
  const std::size_t layers = facts_.partition.size();
  first_ = first_level_of_mix(levels_, layers);
  for (std::size_t i = first_; i < levels_.size(); ++i)
    levels_[i].halves.reserve(std::size_t{3} * levels_[i].width * levels_[i].height * layers);
  for (std::size_t layer = 0; layer < layers; ++layer) {
    Level level{width, height, develop(layer), {}};
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      if (i > 0) level = halved(level);
      if (i >= first_)
        for (const float value : level.rgb) levels_[i].halves.push_back(half_of(value));
    }
  }
}

Picture::Tile Picture::tile(std::size_t level, std::uint32_t x, std::uint32_t y, TileForm form) {
  if (level >= levels_.size() || level < first_) return {};
  const Level& l = levels_[level];
  const auto tiles = [](std::uint32_t pixels) { return (pixels + kPageTile - 1) / kPageTile; };
  if (x >= tiles(l.width) || y >= tiles(l.height)) return {};
  const std::uint32_t x_end = std::min((x + 1) * kPageTile, l.width);
  const std::uint32_t y_end = std::min((y + 1) * kPageTile, l.height);
  std::string bytes;
  const auto for_each_row = [&](const auto& of_row) {
    for (std::uint32_t v = y * kPageTile; v < y_end; ++v)
      of_row(3 * (std::size_t{v} * l.width + x * kPageTile), 3 * std::size_t{x_end - x * kPageTile});
  };
  if (!l.halves.empty()) {  // not kept: the halves are there already
    const std::size_t values = std::size_t{3} * l.width * l.height;
    for (std::size_t begin = 0; begin < l.halves.size(); begin += values)
      for_each_row([&](std::size_t at, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) append_half(l.halves[begin + at + i], bytes);
      });
    std::string etag = etag_of(bytes);
    return {std::make_shared<const std::string>(std::move(bytes)), std::move(etag)};
  }
  const Lock lock(mutex_);
  Tile& tile = tiles_[{static_cast<std::uint32_t>(level), x, y, static_cast<std::uint32_t>(form)}];
  if (tile.bytes) return tile;
  bytes.reserve((form == TileForm::half ? std::size_t{6} : std::size_t{4}) * kPageTile * kPageTile);
  for_each_row([&](std::size_t at, std::size_t count) {
    if (form == TileForm::half)
      for (std::size_t i = 0; i < count; ++i) append_half(half_of(l.rgb[at + i]), bytes);
    else
      for (std::size_t i = 0; i < count; i += 3) append_pixel(&l.rgb[at + i], bytes);
  });
  tile.etag = etag_of(bytes);
  tile.bytes = std::make_shared<const std::string>(std::move(bytes));
  return tile;
}

std::string Picture::answer(const std::string& question, const std::function<std::string()>& make) {
  constexpr std::size_t most = 32;
  {
    const Lock lock(mutex_);
    if (const auto known = answers_.find(question); known != answers_.end()) return known->second;
  }
  std::string made = make();
  const Lock lock(mutex_);
  if (answers_.size() < most) answers_.emplace(question, made);
  return made;
}

std::uint64_t Picture::memory_bytes(std::uint32_t width, std::uint32_t height) {
  // 3 floats and the bytes of tiles of both forms, and a third more for smaller levels.
  return std::uint64_t{width} * height * (3 * sizeof(float) + 4 + 6) * 4 / 3;
}

std::uint64_t Picture::mix_memory_bytes(std::uint32_t width, std::uint32_t height, std::size_t layers) {
  const std::vector<Level> levels = empty_levels(width, height);
  const Level& first = levels[first_level_of_mix(levels, layers)];
  // The halves, a tile of all layers under way, and one layer's floats while the picture is made.
  return std::uint64_t{first.width} * first.height * layers * 6 * 4 / 3 +
         std::uint64_t{kPageTile} * kPageTile * layers * 6 +
         std::uint64_t{width} * height * 3 * sizeof(float) * 2;
}

namespace {

Error nothing_merged() {
  return refused_error("nothing is merged yet");
}

// All values of a layer, three a pixel: those that a layer of fewer letters lacks are 0, or all the same of
// one.
std::vector<float> values_of(const image::Layer& layer, std::uint32_t width, std::uint32_t height) {
  const std::size_t count = layer.letters.size();
  std::vector<float> out(std::size_t{3} * width * height), row(count * width);
  for (std::uint32_t y = 0; y < height; ++y) {
    layer.row(y, row);
    for (std::size_t x = 0; x < width; ++x)
      for (std::size_t c = 0; c < 3; ++c)
        out[3 * (std::size_t{y} * width + x) + c] = count == 1  ? row[x]
                                                    : c < count ? row[x * count + c]
                                                                : 0.0F;
  }
  return out;
}

Result<std::shared_ptr<Picture>> layer_picture(const JobRow& row, const JobFilm::Snapshot& copy,
                                               const film::Development& development, const PictureKind& kind,
                                               Picture::Facts facts) {
  const auto both = film::MergedFilm::Which::both;
  const std::uint32_t width = row.settings.width, height = row.settings.height;
  std::vector<image::Layer> layers = film_layers(row, *copy.film, development, both);
  if (kind.kind == PictureKind::Kind::mix) {
    if (facts.partition.empty())
      return refused_error("the job has no layers that add up to the image")
          .with_mend("render with --light-groups or --partition");
    std::erase_if(layers, [&](const image::Layer& layer) {
      return std::find(facts.partition.begin(), facts.partition.end(), layer.name) == facts.partition.end();
    });
    return std::make_shared<Picture>(width, height, std::move(facts), [&](std::size_t layer) {
      return values_of(layers[layer], width, height);
    });
  }
  CANDELA_ASSIGN(const std::vector<image::Layer> aovs, aov_layers(row, copy, both));
  layers.insert(layers.end(), aovs.begin(), aovs.end());
  const auto found = std::find_if(layers.begin(), layers.end(),
                                  [&](const image::Layer& layer) { return layer.name == kind.layer; });
  if (found == layers.end()) return refused_error("the job has no layer " + quote(kind.layer));
  facts.letters = std::string(found->letters);
  return std::make_shared<Picture>(width, height, values_of(*found, width, height), std::move(facts));
}

Result<std::shared_ptr<Picture>> picture_of(const JobRow& row, JobFilm& film, const PictureKind& kind) {
  using Kind = PictureKind::Kind;
  const bool error = kind.kind == Kind::error, layers = kind.kind == Kind::layer || kind.kind == Kind::mix;
  const JobFilm::Snapshot copy = film.snapshot(layers ? JobFilm::Part::all : JobFilm::Part::image);
  if (!copy.film || copy.film->iterations() == 0) return nothing_merged();
  if (error && (copy.film->merged(0).count() == 0 || copy.film->merged(1).count() == 0))
    return refused_error("an error estimate needs iterations of both halves");
  CANDELA_ASSIGN(const film::Development development, develop(row, copy, {}));
  Picture::Facts facts{.iterations = row.iterations_of(copy.film->iterations()),
                       .letters = error ? "Y" : "RGB",
                       .partition = partition_of(row)};
  for (std::string& name : film_layer_names(row)) facts.layers.push_back({std::move(name), "RGB"});
  CANDELA_ASSIGN(const std::vector<Aov> aovs, parse_aovs(row.settings.aovs));
  for (const Aov& aov : aovs) facts.layers.push_back({aov.name, std::string(channel_letters(aov.kind))});
  if (layers) return layer_picture(row, copy, development, kind, std::move(facts));
  const std::uint32_t width = row.settings.width, height = row.settings.height;
  std::vector<float> rgb = film::develop_image(*copy.film, development, film::MergedFilm::Which::both);
  if (error) rgb = relative_error(rgb, stats::variance_map(*copy.film, development), width, height);
  return std::make_shared<Picture>(width, height, std::move(rgb), std::move(facts));
}

}  // namespace

Result<std::shared_ptr<Picture>> make_picture(Farm& farm, const std::string& job_id,
                                              const PictureKind& kind) {
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
    if (!film) return nothing_merged();
    return picture_of(view.row, *film, kind);
  });
  if (only_here) known->unload_if_idle(farm.now().seconds, 0);
  return made;
}

}  // namespace candela::master
