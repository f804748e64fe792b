#include "common/description/spectra.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr double max_temperature = 1e9;
constexpr std::string_view daylight_note =
    "the spectrum is weighed by daylight, as Mitsuba 3 does: RGB builds of 0.6 weigh it evenly, which tints "
    "it";

Result<double> number(std::string_view word) {
  const std::optional<double> value = text::to_number(word);
  if (!value) return input_error(fmt::format("{} is not a finite number", text::quote(word)));
  return *value;
}

// The rules of a list, for each way of writing one.
Result<void> append(colorimetry::Spectrum& spectrum, double wavelength, double value) {
  if (!(wavelength > 0)) return input_error(fmt::format("the wavelength {} is not above 0", wavelength));
  if (!spectrum.wavelengths.empty() && !(wavelength > spectrum.wavelengths.back()))
    return input_error(fmt::format("wavelengths must increase, but {} comes after {}", wavelength,
                                   spectrum.wavelengths.back()));
  spectrum.wavelengths.push_back(wavelength);
  spectrum.values.push_back(value);
  return {};
}

Result<void> check_length(const colorimetry::Spectrum& spectrum) {
  if (spectrum.wavelengths.size() >= 2) return {};
  return input_error(fmt::format("a spectrum needs two or more pairs of wavelength and value, not {}",
                                 spectrum.wavelengths.size()));
}

Result<ConvertedSpectrum> clamp(const Vec3& linear, SpectrumUse use) {
  ConvertedSpectrum result{{linear}, {}};
  const double most = use == SpectrumUse::reflectance ? 1 : std::numeric_limits<double>::infinity();
  double moved = 0;
  double largest = 0;
  for (double& component : result.rgb.value) {
    if (!std::isfinite(component)) return input_error("the spectrum's values are too large");
    const double kept = std::clamp(component, 0.0, most);
    moved = std::max(moved, std::fabs(component - kept));
    largest = std::max(largest, std::fabs(component));
    component = kept;
  }
  // Below this it is the rounding of the tables.
  if (moved > 1e-3 * largest)
    result.note = fmt::format(
        "the spectrum is out of Rec.709's range: {:.4g}, {:.4g}, {:.4g} was clamped to "
        "{:.4g}, {:.4g}, {:.4g}, as by Mitsuba's RGB variants",
        linear[0], linear[1], linear[2], result.rgb.value[0], result.rgb.value[1], result.rgb.value[2]);
  return result;
}

Error located(Error error, const Element& element) {
  return std::move(error).at(element.where.file, element.where.line);
}

Result<double> temperature_of(double kelvins) {
  if (!(kelvins > 0 && kelvins <= max_temperature))
    return input_error(
        fmt::format("the temperature {} is not above 0 and at most {} K", kelvins, max_temperature));
  return kelvins;
}

Result<colorimetry::Spectrum> parse_regular(const Object& object) {
  const double from = object.get_number("wavelength_min", colorimetry::min_wavelength);
  const double to = object.get_number("wavelength_max", colorimetry::max_wavelength);
  const std::string values = object.get_string("values", "");
  const std::vector<std::string_view> words = text::tokens(values);
  if (!(to > from))
    return input_error(fmt::format("wavelength_max {} is not above wavelength_min {}", to, from));
  colorimetry::Spectrum spectrum;
  for (std::size_t i = 0; i < words.size(); ++i) {
    CANDELA_ASSIGN(const double value, number(words[i]));
    const double t = words.size() < 2 ? 0 : static_cast<double>(i) / static_cast<double>(words.size() - 1);
    CANDELA_TRY(append(spectrum, (1 - t) * from + t * to, value));
  }
  CANDELA_TRY(check_length(spectrum));
  return spectrum;
}

Result<colorimetry::Spectrum> parse_irregular(const Object& object) {
  const std::string wavelengths = object.get_string("wavelengths", "");
  const std::string values = object.get_string("values", "");
  const std::vector<std::string_view> at = text::tokens(wavelengths);
  const std::vector<std::string_view> value = text::tokens(values);
  if (at.size() != value.size())
    return input_error(fmt::format("there are {} wavelengths but {} values", at.size(), value.size()));
  colorimetry::Spectrum spectrum;
  for (std::size_t i = 0; i < at.size(); ++i) {
    CANDELA_ASSIGN(const double wavelength, number(at[i]));
    CANDELA_ASSIGN(const double here, number(value[i]));
    CANDELA_TRY(append(spectrum, wavelength, here));
  }
  CANDELA_TRY(check_length(spectrum));
  return spectrum;
}

Result<ConvertedSpectrum> convert_plugin(const Object& object, SpectrumUse use) {
  if (object.plugin == "uniform") {
    const double value = object.get_number("value", 0);
    return ConvertedSpectrum{{{value, value, value}}, {}};
  }
  if (object.plugin == "rgb" || object.plugin == "srgb")
    return ConvertedSpectrum{object.get_rgb("color").value_or(Rgb{}), {}};
  if (object.plugin == "d65") {
    Rgb color = object.get_rgb("color").value_or(Rgb{{1, 1, 1}});
    for (double& component : color.value) component *= object.get_number("scale", 1);
    return ConvertedSpectrum{color, {}};
  }
  if (object.plugin == "blackbody") {
    CANDELA_ASSIGN(const double kelvins, temperature_of(object.get_number("temperature", 0)));
    const double from = object.get_number("wavelength_min", colorimetry::min_wavelength);
    const double to = object.get_number("wavelength_max", colorimetry::max_wavelength);
    CANDELA_ASSIGN(ConvertedSpectrum result,
                   clamp(colorimetry::blackbody(kelvins, from, to), SpectrumUse::emission));
    if (use != SpectrumUse::emission) return input_error("a black body shines: it belongs into an emitter");
    return result;
  }
  if (object.plugin == "regular") {
    CANDELA_ASSIGN(const colorimetry::Spectrum spectrum, parse_regular(object));
    return convert_spectrum(spectrum, use);
  }
  CANDELA_ASSIGN(const colorimetry::Spectrum spectrum, parse_irregular(object));
  return convert_spectrum(spectrum, use);
}

}  // namespace

SpectrumUse spectrum_use(const Object& object, std::string_view name) {
  if (object.category == "emitter") return SpectrumUse::emission;
  if (const PluginRule* plugin = find_plugin(object.category, object.plugin))
    for (const PropertyRule& rule : plugin->properties)
      if (rule.name == name) return rule.maximum <= 1 ? SpectrumUse::reflectance : SpectrumUse::unbounded;
  const bool bounded =
      name.ends_with("reflectance") || name.ends_with("transmittance") || name.ends_with("albedo");
  return bounded ? SpectrumUse::reflectance : SpectrumUse::unbounded;
}

Result<colorimetry::Spectrum> parse_wavelength_pairs(std::string_view text) {
  colorimetry::Spectrum spectrum;
  for (const std::string_view word : text::tokens(text)) {
    const std::size_t colon = word.find(':');
    if (colon == std::string_view::npos || word.find(':', colon + 1) != std::string_view::npos)
      return input_error(fmt::format("{} is not a pair of wavelength and value", text::quote(word)))
          .with_mend("write nanometers and value as '550:0.5', without spaces inside");
    CANDELA_ASSIGN(const double wavelength, number(word.substr(0, colon)));
    CANDELA_ASSIGN(const double value, number(word.substr(colon + 1)));
    CANDELA_TRY(append(spectrum, wavelength, value));
  }
  CANDELA_TRY(check_length(spectrum));
  return spectrum;
}

Result<colorimetry::Spectrum> parse_spectrum_file(const std::string& key, std::string_view bytes) {
  colorimetry::Spectrum spectrum;
  int line_number = 0;
  const auto here = [&](Error error) { return std::move(error).at(key, line_number); };
  while (!bytes.empty()) {
    ++line_number;
    const std::size_t end = bytes.find('\n');
    std::string_view line = bytes.substr(0, end);
    bytes.remove_prefix(end == std::string_view::npos ? bytes.size() : end + 1);
    line = line.substr(0, line.find('#'));
    const std::vector<std::string_view> words = text::tokens(line);
    if (words.empty()) continue;
    if (words.size() != 2)
      return here(
          input_error(fmt::format("a line of a spectrum has two numbers, not {} words", words.size())));
    Result<double> wavelength = number(words[0]);
    if (!wavelength.ok()) return here(std::move(wavelength).error());
    Result<double> value = number(words[1]);
    if (!value.ok()) return here(std::move(value).error());
    Result<void> added = append(spectrum, *wavelength, *value);
    if (!added.ok()) return here(std::move(added).error());
  }
  Result<void> enough = check_length(spectrum);
  if (!enough.ok()) return std::move(enough).error().at(key, 0);
  return spectrum;
}

Result<ConvertedSpectrum> convert_spectrum(const colorimetry::Spectrum& spectrum, SpectrumUse use,
                                           bool legacy) {
  if (use == SpectrumUse::emission) return clamp(colorimetry::emitted(spectrum), use);
  CANDELA_ASSIGN(ConvertedSpectrum result, clamp(colorimetry::reflected(spectrum), use));
  if (legacy) result.note += fmt::format("{}{}", result.note.empty() ? "" : "; ", daylight_note);
  return result;
}

Result<ConvertedSpectrum> convert_spectrum_value(const Element& element, SpectrumUse use) {
  if (element.legacy) {
    CANDELA_TRY(element.expect({"name", "value"}, {"intent"}));
  } else {
    CANDELA_TRY(element.expect({"name", "value"}));
  }
  CANDELA_TRY(check_intent(element));
  const std::vector<std::string_view> words = text::tokens(element.get("value"));
  if (words.empty()) return element.error("<spectrum> has an empty 'value'");
  const bool pairs = element.get("value").find(':') != std::string_view::npos;
  // Three numbers, which an RGB build of 0.6 reads as red, green and blue.
  if (element.legacy && words.size() == 3 && !pairs) {
    Rgb rgb;
    for (std::size_t i = 0; i < 3; ++i) {
      Result<double> component = number(words[i]);
      if (!component.ok()) return located(std::move(component).error(), element);
      rgb.value[i] = *component;
    }
    return ConvertedSpectrum{rgb, {}};
  }
  if (words.size() > 1 || pairs) {
    Result<colorimetry::Spectrum> spectrum = parse_wavelength_pairs(element.get("value"));
    if (!spectrum.ok()) return located(std::move(spectrum).error(), element);
    Result<ConvertedSpectrum> result = convert_spectrum(*spectrum, use, element.legacy);
    if (!result.ok()) return located(std::move(result).error(), element);
    return result;
  }
  const std::optional<double> value = text::to_number(words[0]);
  if (!value)
    return element.error(fmt::format("{} in <spectrum> is not a finite number", text::quote(words[0])));
  Rgb rgb{{*value, *value, *value}};
  // The same power at all wavelengths is not white: Mitsuba 3's RGB variants show it as its spectral ones do.
  // 0.6 takes the number for a multiple of D65.
  if (use == SpectrumUse::emission && !element.legacy) {
    rgb.value = colorimetry::equal_energy();
    for (double& component : rgb.value) component *= *value;
  }
  return ConvertedSpectrum{rgb, {}};
}

Result<ConvertedSpectrum> convert_blackbody(const Element& element) {
  CANDELA_TRY(element.expect({"name", "temperature"}, {"scale"}));
  std::string_view word = element.get("temperature");
  while (word.ends_with(' ')) word.remove_suffix(1);
  if (word.ends_with('K') || word.ends_with('k')) word.remove_suffix(1);
  Result<double> kelvins = number(word);
  if (kelvins.ok()) kelvins = temperature_of(*kelvins);
  if (!kelvins.ok()) return located(std::move(kelvins).error(), element);
  double scale = 1;
  if (element.find("scale") != nullptr) {
    Result<double> given = number(element.get("scale"));
    if (!given.ok()) return located(std::move(given).error(), element);
    scale = *given;
  }
  Vec3 light = colorimetry::blackbody(*kelvins);
  for (double& component : light) component *= scale;
  Result<ConvertedSpectrum> result = clamp(light, SpectrumUse::emission);
  if (!result.ok()) return located(std::move(result).error(), element);
  return result;
}

Result<ConvertedSpectrum> convert_spectrum_plugin(const Object& object, SpectrumUse use) {
  Result<ConvertedSpectrum> result = convert_plugin(object, use);
  if (!result.ok()) return std::move(result).error().at(object.where.file, object.where.line);
  return result;
}

}  // namespace candela::description
