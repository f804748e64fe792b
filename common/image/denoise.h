// Intel's Open Image Denoise, found at run time: Debian 12 has no package of it.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::image {

// Names by which the dynamic linker finds the library, versions 2 and 1.
inline constexpr const char* kDenoiseLibraries[] = {"libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1"};

// The layer that has the denoised image; the attributes that name its denoiser and guides, and have its
// error.
inline constexpr std::string_view kDenoisedLayer = "denoised";
inline constexpr const char* kDenoiserAttribute = "candela:denoiser";
inline constexpr const char* kDenoisedErrorAttribute = "candela:denoised_relmse";

// Three values a pixel, row by row from the top.
struct DenoiseImages {
  std::uint32_t width = 0, height = 0;
  std::span<const float> color;        // linear radiance
  std::span<const float> albedo = {};  // or none
  std::span<const float> normal = {};  // or none; serves only beside albedo
};

class Denoiser {
 public:
  // The first library that is there. Fails (failed) if none is, or if it lacks a function.
  static Result<std::shared_ptr<const Denoiser>> load(
      std::span<const char* const> libraries = kDenoiseLibraries);
  virtual ~Denoiser() = default;

  // Filters albedo and normal first, each by itself, and the color by them. Pixels with a value that is not
  // finite count as black. Runs on processors, on all of this machine.
  virtual Result<std::vector<float>> denoise(const DenoiseImages& images) const = 0;
};

// The images of the two halves of an EXR's samples, as EXRs. Empty: they are not there.
struct HalfExrs {
  std::string a, b;
};

// The bytes of an EXR with the layer 'denoised', and the three values of each of its pixels.
struct DenoisedExr {
  std::string bytes;
  std::vector<float> rgb;
  std::uint32_t width = 0, height = 0;
  std::string guides;  // "albedo, normal", "albedo", or empty
  // The estimated error of `rgb`, with the bias of the denoiser; NaN without halves, or if it is too small to
  // be seen in them.
  double relmse = std::numeric_limits<double>::quiet_NaN();
};
// True if the halves hold the samples that the EXR names (candela:indices_a, candela:indices_b).
Result<bool> halves_are_of(std::string_view exr, const HalfExrs& halves);

// Reads the EXR in memory, denoises its image by the layers with its albedo and normals, and adds the result
// as a layer: other channels keep their values, as 32-bit floats. The guides are the AOVs of these kinds
// (candela:aovs) or, in EXRs of other programs, the layers 'albedo' and 'normal'. Replaces a layer 'denoised'
// of an earlier call. Fails (input) on another layer of that name, and on EXRs of several parts, with a data
// window of their own or with other primaries.
// With `halves`, each is denoised by itself, and the layer is their mean by iterations (candela:iterations).
// Their difference then tells the error of the layer. Halves of other samples count as absent.
Result<DenoisedExr> denoise_exr(std::string_view exr, const Denoiser& denoiser, const HalfExrs& halves = {});

}  // namespace candela::image
