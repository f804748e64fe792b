#include "common/description/pbrt/spectra.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/description/check.h"
#include "common/description/colorimetry.h"
#include "common/description/conductors.h"
#include "common/description/text.h"

namespace candela::description::pbrt {
namespace {

constexpr double sodium_line = 589.3;  // nanometers
constexpr std::size_t max_spectrum_bytes = std::size_t{16} << 20;

struct Space {
  std::string_view name;
  ColorSpace space;
  std::array<Vec3, 3> matrix;  // to linear Rec.709
};

constexpr std::array<std::string_view, 4> space_names = {"srgb", "dci-p3", "rec2020", "aces2065-1"};

// From the primaries and white points of the standards; ACES with Bradford's adaptation from its D60 to D65.
constexpr std::array<Space, 4> spaces = {{
    {"srgb", ColorSpace::srgb, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}},
    {"dci-p3",
     ColorSpace::dci_p3,
     {{{1.2249402, -0.2249402, 0}, {-0.0420570, 1.0420570, 0}, {-0.0196376, -0.0786361, 1.0982736}}}},
    {"rec2020",
     ColorSpace::rec2020,
     {{{1.6604910, -0.5876411, -0.0728499},
       {-0.1245505, 1.1328999, -0.0083494},
       {-0.0181508, -0.1005789, 1.1187297}}}},
    {"aces2065-1",
     ColorSpace::aces,
     {{{2.5216494, -1.1340882, -0.3875612},
       {-0.2764799, 1.3727191, -0.0962392},
       {-0.0153781, -0.1529753, 1.1683534}}}},
}};

struct NamedIndex {
  std::string_view name;
  double index;  // at the sodium or helium line, of Schott's data sheets
};
constexpr std::array<NamedIndex, 10> glasses = {{{"glass-BK7", 1.5168},
                                                 {"glass-BAF10", 1.67003},
                                                 {"glass-FK51A", 1.48656},
                                                 {"glass-LASF9", 1.85025},
                                                 {"glass-F5", 1.67271},
                                                 {"glass-SF5", 1.67271},
                                                 {"glass-F10", 1.72828},
                                                 {"glass-SF10", 1.72828},
                                                 {"glass-F11", 1.78472},
                                                 {"glass-SF11", 1.78472}}};

// Chromaticities of the CIE's fluorescent lamps, and of the white of ACES.
struct NamedWhite {
  std::string_view name;
  double x, y;
};
constexpr std::array<NamedWhite, 13> whites = {{{"stdillum-F1", 0.3131, 0.3371},
                                                {"stdillum-F2", 0.3721, 0.3751},
                                                {"stdillum-F3", 0.4091, 0.3941},
                                                {"stdillum-F4", 0.4402, 0.4031},
                                                {"stdillum-F5", 0.3138, 0.3452},
                                                {"stdillum-F6", 0.3779, 0.3882},
                                                {"stdillum-F7", 0.3129, 0.3292},
                                                {"stdillum-F8", 0.3458, 0.3586},
                                                {"stdillum-F9", 0.3741, 0.3727},
                                                {"stdillum-F10", 0.3458, 0.3588},
                                                {"stdillum-F11", 0.3805, 0.3769},
                                                {"stdillum-F12", 0.4370, 0.4042},
                                                {"illum-acesD60", 0.32168, 0.33767}}};

std::optional<double> named_glass(std::string_view name) {
  for (const NamedIndex& glass : glasses)
    if (glass.name == name) return glass.index;
  return std::nullopt;
}

// The color of a named illuminant, of luminance 1.
std::optional<Vec3> named_illuminant(std::string_view name) {
  if (name == "stdillum-D65") return Vec3{1, 1, 1};
  if (name == "stdillum-D50") return Vec3{1.17599, 0.97570, 0.72212};
  if (name == "stdillum-A") return colorimetry::blackbody(2856);
  for (const NamedWhite& white : whites)
    if (white.name == name) {
      const double x = white.x / white.y, z = (1 - white.x - white.y) / white.y;
      return Vec3{3.2404542 * x - 1.5371385 - 0.4985314 * z, -0.9692660 * x + 1.8760108 + 0.0415560 * z,
                  0.0556434 * x - 0.2040259 + 1.0572252 * z};
    }
  return std::nullopt;
}

Rgb clamped(Vec3 rgb) {
  for (double& component : rgb) component = std::max(component, 0.0);
  return {rgb};
}

// Samples given as "wavelength value ..." or in a file.
Result<colorimetry::Spectrum> samples_of(Context& context, const Parameter& parameter) {
  if (!parameter.strings.empty()) {
    CANDELA_ASSIGN(const std::string key, context.find_file(parameter.where, parameter.strings[0]));
    CANDELA_ASSIGN(const FileSource::Bytes bytes, context.open(key, max_spectrum_bytes));
    if (bytes.view.size() > max_spectrum_bytes)
      return error_at(parameter.where,
                      fmt::format("{} has {} bytes, more than the limit of {} for a spectrum",
                                  text::quote(key), bytes.view.size(), max_spectrum_bytes));
    return parse_spectrum_file(key, bytes.view);
  }
  colorimetry::Spectrum spectrum;
  const std::vector<double>& n = parameter.numbers;
  for (std::size_t i = 0; i + 1 < n.size(); i += 2) {
    if (i > 0 && !(n[i] > n[i - 2]))
      return error_at(parameter.where, "the wavelengths of a spectrum do not increase");
    spectrum.wavelengths.push_back(n[i]);
    spectrum.values.push_back(n[i + 1]);
  }
  if (n.size() < 4 || n.size() % 2 != 0)
    return error_at(parameter.where, "a spectrum has two or more pairs of wavelength and value");
  return spectrum;
}

double value_at(const colorimetry::Spectrum& spectrum, double wavelength) {
  const auto& w = spectrum.wavelengths;
  if (wavelength <= w.front()) return spectrum.values.front();
  for (std::size_t i = 0; i + 1 < w.size(); ++i)
    if (wavelength <= w[i + 1]) {
      const double t = (wavelength - w[i]) / (w[i + 1] - w[i]);
      return spectrum.values[i] + t * (spectrum.values[i + 1] - spectrum.values[i]);
    }
  return spectrum.values.back();
}

Result<void> needs_one(Context& context, const Parameter& parameter) {
  const bool is_rgb = parameter.type == "rgb";
  const std::size_t numbers = is_rgb ? 3 : 1;
  // Files of version 3 have a scale behind the temperature.
  if (parameter.type == "blackbody" && parameter.numbers.size() > 1) {
    context.warn(parameter.where,
                 fmt::format("parameter {} has {} values: the first is the temperature, and the "
                             "others are passed over, as in pbrt",
                             text::quote(parameter.name), parameter.numbers.size()));
    return {};
  }
  const bool fits =
      parameter.type == "spectrum" ? parameter.strings.size() <= 1 : parameter.numbers.size() == numbers;
  if (fits) return {};
  return error_at(parameter.where, fmt::format("parameter {} needs one {}", text::quote(parameter.name),
                                               parameter.type == "rgb" ? "color" : "value"));
}

Result<Vec3> blackbody_of(const Parameter& parameter) {
  const double kelvins = parameter.numbers[0];
  if (!(kelvins > 0 && kelvins <= 1e9))
    return error_at(parameter.where, fmt::format("{} is no temperature in kelvins", kelvins));
  return colorimetry::blackbody(kelvins);
}

Result<Rgb> of_unit_luminance(const Vec3& rgb, const Location& where) {
  const double y = luminance(rgb);
  if (!(y > 0)) return error_at(where, "the spectrum of a light has no luminance");
  return clamped({rgb[0] / y, rgb[1] / y, rgb[2] / y});
}

}  // namespace

double luminance(const Vec3& rgb) {
  return 0.212671 * rgb[0] + 0.715160 * rgb[1] + 0.072169 * rgb[2];
}

std::span<const std::string_view> color_space_names() {
  return space_names;
}

std::optional<ColorSpace> color_space(std::string_view name) {
  for (const Space& space : spaces)
    if (space.name == name) return space.space;
  return std::nullopt;
}

namespace {

// A wider space has colors that linear Rec.709 lacks; the nearest ones take their place. Reflectances end at
// 1.
Rgb to_rec709(Context& context, const Parameter& parameter, ColorSpace space, bool is_reflectance) {
  constexpr double rounding = 1e-5;  // of the matrices
  const std::vector<double>& n = parameter.numbers;
  if (space == ColorSpace::srgb) return Rgb{{n[0], n[1], n[2]}};
  const auto& m = spaces[static_cast<std::size_t>(space)].matrix;
  Vec3 result{};
  bool is_outside = false;
  for (std::size_t i = 0; i < 3; ++i) {
    result[i] = m[i][0] * n[0] + m[i][1] * n[1] + m[i][2] * n[2];
    const double highest = is_reflectance ? std::max({1.0, n[0], n[1], n[2]}) : result[i];
    const double nearest = std::clamp(result[i], 0.0, std::max(highest, 0.0));
    is_outside = is_outside || std::abs(nearest - result[i]) > rounding;
    result[i] = nearest;
  }
  if (is_outside)
    context.differs(parameter.where,
                    fmt::format("the color {}, {}, {} of {} is outside of Rec.709: {:.4g}, {:.4g}, {:.4g} is "
                                "taken",
                                n[0], n[1], n[2], space_names[static_cast<std::size_t>(space)], result[0],
                                result[1], result[2]));
  return Rgb{result};
}

}  // namespace

std::optional<MetalPart> metal_part(std::string_view name) {
  if (!name.starts_with("metal-")) return std::nullopt;
  name.remove_prefix(6);
  for (const auto& [ending, is_k] : {std::pair<std::string_view, bool>{"-eta", false}, {"-k", true}})
    if (name.ends_with(ending))
      return MetalPart{std::string(name.substr(0, name.size() - ending.size())), is_k};
  return std::nullopt;
}

Result<Rgb> color_of(Context& context, const Parameter& parameter, SpectrumUse use, ColorSpace space) {
  CANDELA_TRY(needs_one(context, parameter));
  const std::vector<double>& n = parameter.numbers;
  if (parameter.type == "float") return Rgb{{n[0], n[0], n[0]}};
  if (parameter.type == "rgb") return to_rec709(context, parameter, space, use == SpectrumUse::reflectance);
  if (parameter.type == "blackbody") {
    CANDELA_ASSIGN(const Vec3 rgb, blackbody_of(parameter));
    return of_unit_luminance(rgb, parameter.where);
  }
  if (!parameter.strings.empty()) {
    const std::string& name = parameter.strings[0];
    if (const std::optional<MetalPart> part = metal_part(name)) {
      // Brass at 650, 550 and 450 nm [Querry 1985]; the other metals are those that Mitsuba names too.
      std::optional<ConductorIndex> metal = named_conductor(part->metal);
      if (part->metal == "CuZn") metal = ConductorIndex{{0.444, 0.527, 1.094}, {3.695, 2.765, 1.829}};
      if (metal) return Rgb{part->is_k ? metal->k : metal->eta};
    }
    if (const std::optional<double> glass = named_glass(name)) return Rgb{{*glass, *glass, *glass}};
    if (const std::optional<Vec3> light = named_illuminant(name)) return clamped(*light);
  }
  CANDELA_ASSIGN(const colorimetry::Spectrum spectrum, samples_of(context, parameter));
  CANDELA_ASSIGN(const ConvertedSpectrum converted, convert_spectrum(spectrum, use));
  if (!converted.note.empty()) context.differs(parameter.where, converted.note);
  return converted.rgb;
}

Result<Rgb> light_of(Context& context, const Parameter& parameter, ColorSpace space) {
  CANDELA_TRY(needs_one(context, parameter));
  if (parameter.type == "rgb") return to_rec709(context, parameter, space, false);
  if (parameter.type == "blackbody") {
    CANDELA_ASSIGN(const Vec3 rgb, blackbody_of(parameter));
    return of_unit_luminance(rgb, parameter.where);
  }
  if (!parameter.strings.empty())
    if (const std::optional<Vec3> light = named_illuminant(parameter.strings[0]))
      return of_unit_luminance(*light, parameter.where);
  CANDELA_ASSIGN(const colorimetry::Spectrum spectrum, samples_of(context, parameter));
  return of_unit_luminance(colorimetry::emitted(spectrum), parameter.where);
}

Result<double> index_of(Context& context, ParameterList& parameters, std::string_view name,
                        double otherwise) {
  const Parameter* parameter = parameters.take(name, {"spectrum"});
  if (parameter == nullptr) return parameters.number(name, otherwise);
  CANDELA_TRY(needs_one(context, *parameter));
  double index = 0;
  const std::optional<double> glass =
      parameter->strings.empty() ? std::nullopt : named_glass(parameter->strings[0]);
  if (glass) {
    index = *glass;
  } else {
    CANDELA_ASSIGN(const colorimetry::Spectrum spectrum, samples_of(context, *parameter));
    index = value_at(spectrum, sodium_line);
  }
  context.differs(
      parameter->where,
      fmt::format("there is no dispersion: the index of refraction is {} at all wavelengths", index));
  return index;
}

}  // namespace candela::description::pbrt
