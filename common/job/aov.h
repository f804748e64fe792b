// Arbitrary output variables (AOVs): what the camera sees first, in layers beside the image. Kinds and their
// names are those of Mitsuba 3's integrator `aov`. Each AOV is an accumulator of the job
// (common/film/accumulator.h): the sums of its values over the eye samples, weighted by the pixel filter
// (docs/decisions/045).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela {

enum class AovKind : std::uint8_t {
  albedo,
  depth,
  position,
  uv,
  geo_normal,
  sh_normal,
  dp_du,
  dp_dv,
  prim_index,
  shape_index,
  coverage,
  duv_dx,
  duv_dy,
  boundary_test,
  crypto_object,
  crypto_material,
};
inline constexpr AovKind kLastAovKind = AovKind::crypto_material;

struct Aov {
  std::string name;  // of the layer
  AovKind kind = AovKind::albedo;
  bool operator==(const Aov&) const = default;
};

inline constexpr std::size_t kMaxAovs = 16;

// Reads "NAME:KIND,KIND,...". A kind alone names its layer too; `normal` is `normal:sh_normal`. "" and "none"
// have no AOV; `crypto_object` is `CryptoObject:crypto_object`, and materials likewise. Fails (usage) on
// anything else, on two layers of one name, and on more than kMaxAovs.
Result<std::vector<Aov>> parse_aovs(std::string_view text);
// As "NAME:KIND,...", which parse_aovs() reads.
std::string text_of(const std::vector<Aov>& aovs);

std::string_view name(AovKind kind);
// The letters of the channels in an image file: "RGB" of albedo makes NAME.R, NAME.G and NAME.B. A matte has
// its preview under its name.
std::string_view channel_letters(AovKind kind);
// Names of all kinds for messages: "albedo, depth, ...".
std::string aov_kind_names();

// Mattes have ids and coverage of this many names a pixel, two in a layer: NAME00, NAME01, ...
// (cryptomatte.h).
inline constexpr std::size_t kMatteRanks = 6;
constexpr bool is_matte(AovKind kind) {
  return kind == AovKind::crypto_object || kind == AovKind::crypto_material;
}
// Its layers in an image: NAME, of mattes also those of the ranks.
std::vector<std::string> layer_names(const Aov& aov);

// The name of its accumulator.
std::string accumulator_name(const Aov& aov);

// Name of an accumulator of jobs of Markov chains. The accumulator has one channel, which counts the eye
// samples of each pixel; the master divides sums of AOVs by them. The sums of other jobs are divided by the
// number of iterations.
inline constexpr std::string_view kAovSamples = "aov-samples";
inline constexpr std::string_view kAovPrefix = "aov.";  // of accumulator_name()

}  // namespace candela
