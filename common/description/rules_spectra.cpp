// Spectra, from Mitsuba's documentation. They become linear Rec.709 when the scene is read.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_spectra(std::vector<PluginRule>& table) {
  constexpr std::string_view spectral_only =
      "Mitsuba's RGB variants do not render the plugin; its color is that of the same values in a "
      "<spectrum>";
  const auto bound = [](std::string_view name, std::string_view doc) {
    return PropertyRule{.name = name, .types = {number}, .doc = doc, .minimum = 0};
  };
  const auto unused = [](std::string_view name) {
    return ignored(name, {number}, "a flat spectrum is a color here, as in Mitsuba's RGB variants");
  };
  const auto color = [](bool required, std::string_view doc) {
    return PropertyRule{.name = "color", .types = {rgb}, .required = required, .doc = doc, .minimum = 0};
  };
  table.push_back(
      {.category = "spectrum",
       .name = "uniform",
       .properties =
           {{.name = "value", .types = {number}, .required = true, .doc = "value of all components"},
            unused("wavelength_min"),
            unused("wavelength_max")},
       .child_categories = {},
       .doc = "the same value v at all wavelengths: the color v, v, v"});
  table.push_back(
      {.category = "spectrum",
       .name = "irregular",
       .properties =
           {{.name = "wavelengths",
             .types = {string},
             .required = true,
             .doc = "nanometers, increasing, two or more"},
            {.name = "values", .types = {string}, .required = true, .doc = "one for each wavelength"}},
       .child_categories = {},
       .doc = "values at given wavelengths, linear between them, zero outside",
       .differs = spectral_only});
  table.push_back(
      {.category = "spectrum",
       .name = "regular",
       .properties = {bound("wavelength_min", "nanometers of the first value (default 360)"),
                      bound("wavelength_max", "nanometers of the last value (default 830)"),
                      {.name = "values", .types = {string}, .required = true, .doc = "two or more"}},
       .child_categories = {},
       .doc = "values at even distances, linear between them, zero outside",
       .differs = spectral_only});
  table.push_back(
      {.category = "spectrum",
       .name = "blackbody",
       .properties = {{.name = "temperature",
                       .types = {number},
                       .required = true,
                       .doc = "kelvins",
                       .minimum = 0,
                       .maximum = 1e9,
                       .above_minimum = true},
                      bound("wavelength_min", "first wavelength with light, in nanometers (default 360)"),
                      bound("wavelength_max", "last wavelength with light, in nanometers (default 830)")},
       .child_categories = {},
       .doc = "Planck's law in W/(m^2 sr nm), for emitters",
       .differs = "Mitsuba has it in its spectral variants only; the color is theirs"});
  for (const std::string_view name : {"rgb", "srgb"})
    table.push_back({.category = "spectrum",
                     .name = name,
                     .properties = {color(true, "linear Rec.709")},
                     .child_categories = {},
                     .doc = "a color"});
  table.push_back(
      {.category = "spectrum",
       .name = "d65",
       .properties = {color(false, "factor, linear Rec.709 (default 1)"),
                      {.name = "scale", .types = {number}, .doc = "factor (default 1)", .minimum = 0}},
       .child_categories = {},
       .doc = "the white of Rec.709"});
}

}  // namespace candela::description::rules
