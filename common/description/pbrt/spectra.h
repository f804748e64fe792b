// pbrt's spectra as linear Rec.709: rgb in a color space, black bodies, samples, files, and names.
#pragma once

#include <optional>
#include <string_view>

#include "common/description/pbrt/context.h"
#include "common/description/spectra.h"

namespace candela::description::pbrt {

// The color space of rgb values in a file. The description keeps all values as linear Rec.709.
enum class ColorSpace { srgb, dci_p3, rec2020, aces };
std::optional<ColorSpace> color_space(std::string_view name);
std::span<const std::string_view> color_space_names();
double luminance(const Vec3& rec709);

// A color of a surface or of a medium.
Result<Rgb> color_of(Context& context, const Parameter& parameter, SpectrumUse use, ColorSpace space);

// The light of a lamp. pbrt scales each spectrum but rgb to a luminance of 1.
Result<Rgb> light_of(Context& context, const Parameter& parameter, ColorSpace space);

// An index of refraction: the spectrum at 589.3 nm, for there is no dispersion here.
Result<double> index_of(Context& context, ParameterList& parameters, std::string_view name, double otherwise);

// eta and k of "metal-Cu-eta", "metal-Cu-k": the metal's name and the part; nothing if it names no metal.
struct MetalPart {
  std::string metal;
  bool is_k = false;
};
std::optional<MetalPart> metal_part(std::string_view name);

}  // namespace candela::description::pbrt
