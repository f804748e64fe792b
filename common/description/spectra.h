// The elements <spectrum> and <blackbody>, and the spectrum plugins, turned into linear Rec.709 the way
// Mitsuba's RGB variants do it.
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/description/colorimetry.h"
#include "common/description/object.h"
#include "common/description/values.h"

namespace candela::description {

// Use of a spectrum. Light is weighed by the observer alone; everything else also by D65, the
// white of Rec.709, so that a flat spectrum has a neutral color. All are clamped to 0 below, reflectances to
// 1 above.
enum class SpectrumUse {
  emission,
  reflectance,  // of a parameter that ends at 1
  unbounded     // of one that does not (indices of refraction, extinction)
};

// Use of a parameter as it is written: the last word tells old names apart that the upgrade has yet to
// translate.
SpectrumUse spectrum_use(const Object& object, std::string_view name);

struct ConvertedSpectrum {
  Rgb rgb;
  std::string note;  // what was approximated or clamped; empty where nothing was
};

// "400:0.1, 500:0.2": two or more pairs of nanometers and value. Errors without a location.
Result<colorimetry::Spectrum> parse_wavelength_pairs(std::string_view text);

// Lines of two numbers, nanometers and value; empty lines and lines with # are skipped. `key` names the file.
Result<colorimetry::Spectrum> parse_spectrum_file(const std::string& key, std::string_view bytes);

// A <spectrum> with the attribute 'value': one number or pairs.
Result<ConvertedSpectrum> convert_spectrum_value(const Element& element, SpectrumUse use);

// The content of a file, already parsed.
Result<ConvertedSpectrum> convert_spectrum(const colorimetry::Spectrum& spectrum, SpectrumUse use,
                                           bool legacy = false);

// 0.6's <blackbody temperature="5000K" scale="0.1"/>.
Result<ConvertedSpectrum> convert_blackbody(const Element& element);

// A checked object of the category "spectrum".
Result<ConvertedSpectrum> convert_spectrum_plugin(const Object& object, SpectrumUse use);

}  // namespace candela::description
