#include "tests/bench/candela_bench/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "common/base/hash.h"
#include "common/image/image.h"
#include "common/stats/image_error.h"

namespace candela::bench {
namespace {

constexpr double kFixedFloor = 0.01;

double fixed_floor_relmse(std::span<const float> image, std::span<const float> truth) {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double b = truth[i], difference = static_cast<double>(image[i]) - b;
    sum += difference * difference / (b * b + kFixedFloor);
  }
  return sum / static_cast<double>(image.size());
}

double smape(std::span<const float> image, std::span<const float> truth) {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double a = image[i], b = truth[i];
    const double size = std::abs(a) + std::abs(b);
    if (size > 0) sum += std::isfinite(size) ? 2 * std::abs(a - b) / size : 2;
    if (std::isnan(size)) sum += 2;
  }
  return sum / static_cast<double>(image.size());
}

}  // namespace

Reference::Reference(std::uint32_t width, std::uint32_t height, std::vector<float> rgb,
                     std::vector<float> deviation, bool with_flip)
    : width_(width), height_(height), rgb_(std::move(rgb)) {
  Sha256 hash;
  hash.update(fmt::format("{} {} {}\n", width, height, deviation.size()));
  for (const std::vector<float>* values : {&rgb_, &deviation})
    hash.update({reinterpret_cast<const char*>(values->data()), values->size() * sizeof(float)});
  hash_ = hash.finish_hex();
  if (!deviation.empty()) {
    // An image that is off by one standard error everywhere has the expected squared errors.
    for (std::size_t i = 0; i < deviation.size(); ++i) deviation[i] += rgb_[i];
    const auto off = stats::compare(deviation, rgb_, width, height, 0);
    own_ = OwnError{off.relmse, off.relmse_trimmed, fixed_floor_relmse(deviation, rgb_), off.rmse};
  }
  if (with_flip) flip_ = std::make_unique<const Flip>(rgb_, width, height);
}

Result<std::shared_ptr<const Reference>> Reference::read(const std::string& path, bool with_flip) {
  if (std::filesystem::path(path).extension() != ".exr")
    return input_error("a reference is an .exr file")
        .at(path, 0)
        .with_mend("other formats hold less than it takes");
  CANDELA_ASSIGN(image::Image rgb, image::read_image(path));
  for (const float value : rgb.rgb)
    if (!std::isfinite(value))
      return input_error("a reference image holds a value that is not finite").at(path, 0);
  std::vector<float> deviation;
  const auto beside = std::filesystem::path(path).replace_extension(".stderr.exr");
  if (std::filesystem::exists(beside)) {
    CANDELA_ASSIGN(image::Image read, image::read_image(beside));
    if (read.width != rgb.width || read.height != rgb.height)
      return input_error("the standard errors of a reference have another size than it")
          .at(beside.string(), 0);
    for (const float value : read.rgb)
      if (!(value >= 0) || !std::isfinite(value))
        return input_error("a standard error that is negative or not finite").at(beside.string(), 0);
    deviation = std::move(read.rgb);
  }
  return std::shared_ptr<const Reference>(std::make_shared<Reference>(
      rgb.width, rgb.height, std::move(rgb.rgb), std::move(deviation), with_flip));
}

Figures Reference::figures_of(std::span<const float> image) const {
  const auto compared = stats::compare(image, rgb_, width_, height_, 0);
  Figures figures;
  figures.relmse = compared.relmse;
  figures.relmse_trimmed = compared.relmse_trimmed;
  figures.relmse_fixed = fixed_floor_relmse(image, rgb_);
  figures.rmse = compared.rmse;
  figures.smape = smape(image, rgb_);
  figures.flip = flip_ != nullptr ? flip_->mean(image) : std::numeric_limits<double>::quiet_NaN();
  return figures;
}

double Reference::factor_of(const Figures& measured) const {
  if (!own_) return std::numeric_limits<double>::quiet_NaN();
  const auto ratio = [](double error, double own) {
    return own > 0 ? error / own : std::numeric_limits<double>::infinity();
  };
  return std::min({ratio(measured.relmse, own_->relmse), ratio(measured.relmse_trimmed, own_->relmse_trimmed),
                   ratio(measured.relmse_fixed, own_->relmse_fixed),
                   ratio(measured.rmse * measured.rmse, own_->rmse * own_->rmse)});
}

}  // namespace candela::bench
