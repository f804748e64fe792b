// The figures of one image against a reference. docs/bench.md defines each.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/bench/candela_bench/flip.h"

namespace candela::bench {

struct Figures {
  double relmse = 0;          // as common/stats/image_error.h defines it
  double relmse_trimmed = 0;  // the same without the worst 0.1 % of pixels
  double relmse_fixed = 0;    // mean((a-b)^2 / (b^2 + 0.01)): a floor that does not follow the image's mean
  double rmse = 0;
  double smape = 0;  // mean(2 |a-b| / (|a| + |b|)), 0 where both are 0
  double flip = 0;   // HDR-FLIP
};

// The errors a reference has of its own, as figures of it against the truth. Estimated from the standard
// error of each of its values: what squares add up to.
struct OwnError {
  double relmse = 0, relmse_trimmed = 0, relmse_fixed = 0, rmse = 0;
};

class Reference {
 public:
  // `deviation` (empty: not known) has as many values as `rgb`.
  Reference(std::uint32_t width, std::uint32_t height, std::vector<float> rgb, std::vector<float> deviation,
            bool with_flip);
  // NAME.exr, and NAME.stderr.exr beside it if there is one.
  static Result<std::shared_ptr<const Reference>> read(const std::string& path, bool with_flip);

  std::uint32_t width() const { return width_; }
  std::uint32_t height() const { return height_; }
  const std::vector<float>& rgb() const { return rgb_; }
  const std::optional<OwnError>& own_error() const { return own_; }
  // Digest of all that figures depend on: size, values, standard errors.
  const std::string& hash() const { return hash_; }

  // NaN for flip where the reference was made without. Precondition: as many values as the reference.
  Figures figures_of(std::span<const float> image) const;

  // Factor by which the measured squared errors are larger than the reference's own: the least over relMSE,
  // its trimmed and its fixed form, and MSE. NaN where the reference's error is not known.
  double factor_of(const Figures& measured) const;

 private:
  std::uint32_t width_, height_;
  std::vector<float> rgb_;
  std::optional<OwnError> own_;
  std::string hash_;
  std::unique_ptr<const Flip> flip_;
};

}  // namespace candela::bench
