// The CIE 1931 2-degree standard observer and standard illuminant D65, every 5 nm, and the step from the
// spectra of light and of reflection to linear Rec.709. Doubles, and no function of libm whose last bit
// depends on the machine.
#pragma once

#include <vector>

#include "common/description/object.h"

namespace candela::description::colorimetry {

constexpr double min_wavelength = 360;  // nanometers: the observer's range
constexpr double max_wavelength = 830;

// A piecewise linear spectrum, zero outside of its wavelengths (nanometers, strictly increasing, two or
// more).
struct Spectrum {
  std::vector<double> wavelengths;
  std::vector<double> values;
};

// Linear Rec.709 of light with this spectral density per nanometer, scaled so that a density of 1 has
// luminance 1 (its color is not white, for white is D65). Not clamped: components may be negative.
Vec3 emitted(const Spectrum& spectrum);

// Linear Rec.709 of what reflects, transmits or scatters this part of each wavelength, lit by D65 of
// luminance 1: a flat spectrum of value v gives v, v, v within the tables' rounding. Not clamped.
Vec3 reflected(const Spectrum& spectrum);

// Linear Rec.709 of the equal-energy spectrum of density 1, as Mitsuba has it: XYZ of 1, 1, 1.
Vec3 equal_energy();

// Planck's law: spectral radiance in W m^-2 sr^-1 nm^-1 at a wavelength in nanometers and a temperature in
// kelvins, both above 0.
double planck(double wavelength, double temperature);

// Linear Rec.709 of a black body's light between two wavelengths, scaled as `emitted` is. Not clamped.
Vec3 blackbody(double temperature, double from = min_wavelength, double to = max_wavelength);

// CIE XYZ of a spectral density per nanometer, with the equal-energy density 1 at Y = 1; for tests and
// tables.
Vec3 emitted_xyz(const Spectrum& spectrum);
Vec3 blackbody_xyz(double temperature, double from = min_wavelength, double to = max_wavelength);

// The tables, linear between their entries, zero outside of them.
Vec3 observer(double wavelength);
double d65(double wavelength);  // 100 at 560 nm

}  // namespace candela::description::colorimetry
