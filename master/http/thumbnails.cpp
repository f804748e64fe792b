#include "master/http/thumbnails.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "common/image/image.h"

namespace candela::master {
namespace {

constexpr const char* kFile = "thumbnails.bin";  // "REVISION BYTES\n", then the small and the large PNG
constexpr std::uint64_t kMaxFileBytes = 2 << 20;
constexpr double kBright = 0.98;                  // quantile of luminance that is exposed
constexpr float kDarkest = 0.2F, kBrightest = 2;  // of it, as it is

// Means over the pixels' areas.
image::Image reduced(const Picture::Level& from, std::uint32_t side) {
  const double scale = std::min(1.0, static_cast<double>(side) / std::max(from.width, from.height));
  image::Image to;
  to.width = std::max<std::uint32_t>(1, static_cast<std::uint32_t>(std::lround(from.width * scale)));
  to.height = std::max<std::uint32_t>(1, static_cast<std::uint32_t>(std::lround(from.height * scale)));
  to.rgb.resize(std::size_t{3} * to.width * to.height);
  struct Share {
    std::uint32_t at;
    float weight;
  };
  const auto shares = [](std::uint32_t in, std::uint32_t out) {
    std::vector<std::vector<Share>> all(out);
    const double step = static_cast<double>(in) / out;
    for (std::uint32_t o = 0; o < out; ++o)
      for (std::uint32_t i = static_cast<std::uint32_t>(o * step); i < in && i < (o + 1) * step; ++i)
        all[o].push_back({i, static_cast<float>((std::min(i + 1.0, (o + 1) * step) -
                                                 std::max(static_cast<double>(i), o * step)) /
                                                step)});
    return all;
  };
  const auto columns = shares(from.width, to.width), rows = shares(from.height, to.height);
  for (std::uint32_t y = 0; y < to.height; ++y)
    for (std::uint32_t x = 0; x < to.width; ++x)
      for (const Share& v : rows[y])
        for (const Share& u : columns[x])
          for (std::size_t c = 0; c < 3; ++c) {
            const float value = from.rgb[3 * (std::size_t{v.at} * from.width + u.at) + c];
            if (std::isfinite(value))
              to.rgb[3 * (std::size_t{y} * to.width + x) + c] += v.weight * u.weight * value;
          }
  return to;
}

double exposure_of(const image::Image& picture) {
  std::vector<float> luminance;
  luminance.reserve(picture.rgb.size() / 3);
  for (std::size_t i = 0; i < picture.rgb.size(); i += 3)
    luminance.push_back(0.2126F * picture.rgb[i] + 0.7152F * picture.rgb[i + 1] +
                        0.0722F * picture.rgb[i + 2]);
  const auto bright =
      luminance.begin() + static_cast<std::ptrdiff_t>(kBright * static_cast<double>(luminance.size() - 1));
  std::nth_element(luminance.begin(), bright, luminance.end());
  if (!(*bright > 0) || (*bright >= kDarkest && *bright <= kBrightest)) return 0;
  return -std::log2(double{*bright});
}

}  // namespace

std::string thumbnail_revision(const Job& job) {
  const std::uint64_t n = job.row.iterations;
  if (n == 0) return {};
  // A film that begins anew has other pictures after as many iterations.
  if (has_ended(job.row.state)) return fmt::format("{}-{}", job.first_token, n);
  return fmt::format("{}-r{}", job.first_token,
                     static_cast<int>(std::log(static_cast<double>(n)) / std::log(1.5)));
}

Result<Thumbnails> make_thumbnails(const Picture& picture, std::string revision) {
  Thumbnails out{std::move(revision), {}};
  double exposure = 0;
  for (std::size_t k = kThumbnailSides.size(); k-- > 0;) {
    const std::uint32_t side = kThumbnailSides[k];
    const Picture::Level* level = &picture.levels().front();
    for (const Picture::Level& next : picture.levels())
      if (std::max(next.width, next.height) >= side) level = &next;
    const image::Image small = reduced(*level, side);
    if (k + 1 == kThumbnailSides.size()) exposure = exposure_of(small);
    CANDELA_ASSIGN(std::string png, image::encode_png(small, exposure));
    out.png[k] = std::make_shared<const std::string>(std::move(png));
  }
  return out;
}

std::optional<Thumbnails> read_thumbnails(const std::filesystem::path& folder, const std::string& revision) {
  const auto file = read_file(folder / kFile, kMaxFileBytes);
  if (!file.ok()) return std::nullopt;
  const std::string_view text = *file;
  const std::size_t line = text.find('\n'), gap = text.substr(0, line).find(' ');
  if (line == std::string_view::npos || gap == std::string_view::npos || text.substr(0, gap) != revision)
    return std::nullopt;
  std::size_t small = 0;
  const auto [end, error] = std::from_chars(text.data() + gap + 1, text.data() + line, small);
  const std::string_view bytes = text.substr(line + 1);
  if (error != std::errc() || end != text.data() + line || small > bytes.size()) return std::nullopt;
  return Thumbnails{revision,
                    {std::make_shared<const std::string>(bytes.substr(0, small)),
                     std::make_shared<const std::string>(bytes.substr(small))}};
}

Result<void> write_thumbnails(const std::filesystem::path& folder, const Thumbnails& thumbnails) {
  return write_file_atomically(folder / kFile,
                               fmt::format("{} {}\n{}{}", thumbnails.revision, thumbnails.png[0]->size(),
                                           *thumbnails.png[0], *thumbnails.png[1]));
}

std::optional<Thumbnails> ThumbnailMemory::find(const std::string& job_id) {
  const Lock lock(mutex_);
  const auto found = by_job_.find(job_id);
  if (found == by_job_.end()) return std::nullopt;
  entries_.splice(entries_.begin(), entries_, found->second);
  return found->second->thumbnails;
}

void ThumbnailMemory::keep(const std::string& job_id, Thumbnails thumbnails) {
  const Lock lock(mutex_);
  const auto drop = [this](std::list<Entry>::iterator entry) CANDELA_REQUIRES(mutex_) {
    bytes_ -= entry->thumbnails.bytes();
    by_job_.erase(entry->job_id);
    entries_.erase(entry);
  };
  if (const auto found = by_job_.find(job_id); found != by_job_.end()) drop(found->second);
  bytes_ += thumbnails.bytes();
  entries_.push_front({job_id, std::move(thumbnails)});
  by_job_[job_id] = entries_.begin();
  while (bytes_ > limit_bytes_ && entries_.size() > 1) drop(std::prev(entries_.end()));
}

std::size_t ThumbnailMemory::bytes() const {
  const Lock lock(mutex_);
  return bytes_;
}

}  // namespace candela::master
