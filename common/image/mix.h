// A mix of the layers of an image: the image is made anew as the sum of its layers, each with an intensity
// and a tint, in linear light. Only layers that add up to the image can be mixed: light groups, or the layers
// of a partition. docs/layers.md explains the keys.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::image {

struct MixedLayer {
  std::string name;
  double intensity = 1;
  std::array<double, 3> tint = {1, 1, 1};  // of red, green and blue
  bool operator==(const MixedLayer&) const = default;
};

// Layers that the mix does not name stay as they are.
struct Mix {
  std::vector<MixedLayer> layers;
  bool operator==(const Mix&) const = default;
};

inline constexpr std::size_t kMaxMixBytes = 65536;  // of the text
inline constexpr double kMaxMixFactor = 1e6;        // of an intensity, and of a tint

// The attribute that names the layers that add up to the image, separated by ", "; none: no layers do.
inline constexpr const char* kPartitionAttribute = "candela:partition";
// The attribute of a mixed image: the mix as text_of() writes it.
inline constexpr const char* kMixAttribute = "candela:mix";

// Reads JSON. Errors (input) name the key, and the line where the text is no JSON.
Result<Mix> parse_mix(std::string_view text);
// The same of a file. Errors name the file, too.
Result<Mix> read_mix(const std::filesystem::path& file);
// As parse_mix() reads it, on one line.
std::string text_of(const Mix& mix);

// Fails (input) unless the layers add up to the image within the rounding of floats. All have three values a
// pixel. The error tells of the pixel that differs most.
Result<void> check_sum(std::uint32_t width, std::span<const float> image,
                       std::span<const std::span<const float>> layers);

struct MixedExr {
  std::string bytes;
  std::vector<std::string> left_out;  // layers that are true of the image before the mix alone
};
// Makes the image of the EXR anew; its layers stay. The estimate of the error, which is that of the image
// before the mix, is left out, as are the layers 'error', 'variance' and 'denoised'. The command that makes
// the image again (candela:reproduce) is that of the image before the mix. Errors (input): the image is a mix
// already, says of no layers that they add up to it, or has layers that do not; the mix names another layer.
Result<MixedExr> mix_exr(std::string_view exr, const Mix& mix);

}  // namespace candela::image
