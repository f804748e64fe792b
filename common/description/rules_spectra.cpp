// Spectra, from Mitsuba's documentation. They become linear Rec.709 when the scene is read.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_spectra(std::vector<PluginRule>& table) {
  Plugins spectra(table, "spectrum");
  constexpr std::string_view spectral_only =
      "Mitsuba's RGB variants do not render the plugin; its color is that of the same values in a "
      "<spectrum>";
  const auto bound = [](std::string_view name, std::string_view doc) {
    return value(name, {number}, doc, 0);
  };
  const auto unused = [](std::string_view name) {
    return ignored(name, {number}, "a flat spectrum is a color here, as in Mitsuba's RGB variants");
  };
  const auto color = [](bool required, std::string_view doc) {
    return PropertyRule{.name = "color", .types = {rgb}, .required = required, .doc = doc, .minimum = 0};
  };
  spectra.add("uniform", "the same value v at all wavelengths: the color v, v, v",
              {required(value("value", {number}, "value of all components")), unused("wavelength_min"),
               unused("wavelength_max")});
  spectra.add("irregular", "values at given wavelengths, linear between them, zero outside",
              {required(value("wavelengths", {string}, "nanometers, increasing, two or more")),
               required(value("values", {string}, "one for each wavelength"))},
              {}, spectral_only);
  spectra.add("regular", "values at even distances, linear between them, zero outside",
              {bound("wavelength_min", "nanometers of the first value (default 360)"),
               bound("wavelength_max", "nanometers of the last value (default 830)"),
               required(value("values", {string}, "two or more"))},
              {}, spectral_only);
  spectra.add("blackbody", "Planck's law in W/(m^2 sr nm), for emitters",
              {required(above(value("temperature", {number}, "kelvins", 0, 1e9))),
               bound("wavelength_min", "first wavelength with light, in nanometers (default 360)"),
               bound("wavelength_max", "last wavelength with light, in nanometers (default 830)")},
              {}, "Mitsuba has it in its spectral variants only; the color is theirs");
  for (const std::string_view name : {"rgb", "srgb"})
    spectra.add(name, "a color", {color(true, "linear Rec.709")});
  spectra.add("d65", "the white of Rec.709",
              {color(false, "factor, linear Rec.709 (default 1)"),
               value("scale", {number}, "factor (default 1)", 0)});
}

}  // namespace candela::description::rules
