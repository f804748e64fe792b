// Spectra against independent truth: published chromaticities, white points and sums of the tables.
#include <gtest/gtest.h>

#include <cmath>

#include "common/description/colorimetry.h"
#include "common/description/spectra.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

using colorimetry::Spectrum;

struct Chromaticity {
  double x, y;
};

Chromaticity chromaticity(const Vec3& xyz) {
  const double sum = xyz[0] + xyz[1] + xyz[2];
  return {xyz[0] / sum, xyz[1] / sum};
}

Spectrum d65_spectrum() {
  Spectrum spectrum;
  for (int nm = 360; nm <= 830; nm += 5) {
    spectrum.wavelengths.push_back(nm);
    spectrum.values.push_back(colorimetry::d65(nm));
  }
  return spectrum;
}

Spectrum band(double from, double to) {
  return {{from - 1e-6, from, to, to + 1e-6}, {0, 1, 1, 0}};
}

Vec3 colour_in(const std::string& parent, const std::string& name, const std::string& element,
               const std::map<std::string, std::string>& files = {}, const std::string& version = "3.0.0") {
  const auto result = parse_text("<scene version='" + version + "'>" + parent + element + "</" +
                                     parent.substr(1, parent.find(' ') - 1) + "></scene>",
                                 {}, files);
  EXPECT_TRUE(result.ok()) << outcome(result) << " for " << element;
  if (!result.ok()) return {};
  return result->scene->children.at(0).object->get_rgb(name).value().value;
}

Vec3 reflectance(const std::string& element, const std::map<std::string, std::string>& files = {}) {
  return colour_in("<bsdf type='diffuse'>", "reflectance", element, files);
}

Vec3 radiance(const std::string& element, const std::string& version = "3.0.0") {
  return colour_in("<emitter type='constant'>", "radiance", element, {}, version);
}

void expect_near(const Vec3& got, const Vec3& expected, double tolerance) {
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(got[c], expected[c], tolerance) << "component " << c;
}

// Claim: the observer's tables are the CIE's, by the sums that its publications give (CIE 015, at 1 nm:
// 106.8654, 106.8569, 106.8922) and by single entries that everybody prints.
TEST(DescriptionSpectra, ObserverHasTheSumsOfItsPublication) {
  Vec3 sum{};
  for (int nm = 360; nm <= 830; nm += 5)
    for (std::size_t c = 0; c < 3; ++c) sum[c] += 5 * colorimetry::observer(nm)[c];
  expect_near(sum, {106.8654, 106.8569, 106.8922}, 2e-3);
  EXPECT_EQ(colorimetry::observer(555), (Vec3{0.5120501, 1, 0.005749999}));
  EXPECT_EQ(colorimetry::observer(600), (Vec3{1.0622, 0.631, 0.0008}));
  EXPECT_EQ(colorimetry::observer(445), (Vec3{0.34806, 0.0298, 1.7826}));
  EXPECT_EQ(colorimetry::observer(359.9), (Vec3{}));
  EXPECT_EQ(colorimetry::observer(830.1), (Vec3{}));
  EXPECT_NEAR(colorimetry::observer(457.5)[1], 0.5 * (0.048 + 0.06), 1e-15);
}

// Claim: D65 has the chromaticity the CIE gives it (0.31272, 0.32903), and is white in Rec.709.
TEST(DescriptionSpectra, DaylightIsWhite) {
  const Chromaticity white = chromaticity(colorimetry::emitted_xyz(d65_spectrum()));
  EXPECT_NEAR(white.x, 0.31272, 5e-5);
  EXPECT_NEAR(white.y, 0.32903, 5e-5);
  const Vec3 light = colorimetry::emitted(d65_spectrum());
  const double luminance = colorimetry::emitted_xyz(d65_spectrum())[1];
  expect_near({light[0] / luminance, light[1] / luminance, light[2] / luminance}, {1, 1, 1}, 1e-3);
}

// Claim: what reflects all wavelengths alike has a neutral colour, however its list is cut.
TEST(DescriptionSpectra, FlatListsAreNeutral) {
  expect_near(colorimetry::reflected({{360, 830}, {0.5, 0.5}}), {0.5, 0.5, 0.5}, 1e-3);
  expect_near(colorimetry::reflected({{1, 400, 433.3, 433.4, 700, 5000}, {1, 1, 1, 1, 1, 1}}), {1, 1, 1},
              1e-3);
  expect_near(reflectance("<spectrum name='reflectance' value='300:0.25, 900:0.25'/>"), {0.25, 0.25, 0.25},
              3e-4);
  expect_near(reflectance("<spectrum name='reflectance' value='0.25'/>"), {0.25, 0.25, 0.25}, 0);
}

// Claim: light of the same power at all wavelengths has XYZ 1, 1, 1, which is no white in Rec.709; lists and
// Mitsuba's shorthand agree on it. In an old file the number is a multiple of white.
TEST(DescriptionSpectra, EqualEnergyIsNotWhite) {
  const Vec3 shown = {1.204794, 0.948291, 0.908916};
  expect_near(colorimetry::emitted({{360, 830}, {1, 1}}), shown, 5e-4);
  expect_near(radiance("<spectrum name='radiance' value='2'/>"), {2 * shown[0], 2 * shown[1], 2 * shown[2]},
              1e-12);
  EXPECT_EQ(radiance("<spectrum name='radiance' value='2'/>", "0.6.0"), (Vec3{2, 2, 2}));
  EXPECT_EQ(radiance("<spectrum name='radiance' value='2' intent='illuminant'/>", "0.6.0"), (Vec3{2, 2, 2}));
  EXPECT_EQ(radiance("<float name='radiance' value='2'/>"), (Vec3{2, 2, 2}));
}

// Claim: Planck's law in W m^-2 sr^-1 nm^-1 (values that Mitsuba's own test has), and against a long double
// evaluation over all temperatures and wavelengths, whichever branch of the exponential they take.
TEST(DescriptionSpectra, PlancksLaw) {
  EXPECT_NEAR(colorimetry::planck(456, 5000), 10997.9, 0.05);
  EXPECT_NEAR(colorimetry::planck(700, 5000), 11812, 0.5);
  const long double c = 2.99792458e8L, h = 6.62607004e-34L, k = 1.38064852e-23L;
  for (const double temperature : {100.0, 500.0, 1234.5, 3200.0, 6504.0, 2e4, 1e6, 1e9})
    for (double nm = 360; nm <= 830; nm += 7.3) {
      const long double metres = static_cast<long double>(nm) * 1e-9L;
      const long double expected =
          1e-9L * 2 * h * c * c / (std::pow(metres, 5.0L) * std::expm1(h * c / (metres * k * temperature)));
      const double got = colorimetry::planck(nm, temperature);
      EXPECT_NEAR(got / static_cast<double>(expected), 1, 2e-13) << nm << " nm, " << temperature << " K";
    }
  EXPECT_EQ(colorimetry::planck(400, 1), 0);
}

// Claim: black bodies have the chromaticities of the Planckian locus ([Wyszecki 1982], to the digits that
// the change of Planck's constants since leaves).
TEST(DescriptionSpectra, BlackbodiesLieOnThePlanckianLocus) {
  struct Point {
    double kelvins;
    Chromaticity at;
  };
  for (const Point& point :
       {Point{1000, {0.6528, 0.3444}}, Point{2000, {0.5267, 0.4133}}, Point{2856, {0.4476, 0.4074}},
        Point{5000, {0.3451, 0.3516}}, Point{6504, {0.3135, 0.3236}}, Point{10000, {0.2807, 0.2883}}}) {
    const Chromaticity got = chromaticity(colorimetry::blackbody_xyz(point.kelvins));
    EXPECT_NEAR(got.x, point.at.x, 2e-4) << point.kelvins << " K";
    EXPECT_NEAR(got.y, point.at.y, 2e-4) << point.kelvins << " K";
  }
}

// Claim: the two spellings of a black body are the same light, in physical units: at 6504 K as (0.3135,
// 0.3236) says, and its luminance is the integral of Planck's law under the observer's curve, by a plain sum.
TEST(DescriptionSpectra, BlackbodySpellings) {
  const Vec3 modern = radiance(
      "<spectrum name='radiance' type='blackbody'><float name='temperature' value='6504'/></spectrum>");
  const Vec3 old = radiance("<blackbody name='radiance' temperature='6504K' scale='0.5'/>", "0.6.0");
  for (std::size_t c = 0; c < 3; ++c) EXPECT_DOUBLE_EQ(modern[c], 2 * old[c]);
  double y = 0, normal = 0;
  for (double nm = 360; nm < 830; nm += 0.01) {
    y += colorimetry::planck(nm, 6504) * colorimetry::observer(nm)[1];
    normal += colorimetry::observer(nm)[1];
  }
  const double luminance = 0.212671 * modern[0] + 0.715160 * modern[1] + 0.072169 * modern[2];
  EXPECT_NEAR(luminance / (y / normal), 1, 1e-5);
  EXPECT_NEAR(modern[0] / luminance, 1.043, 0.003);
  EXPECT_NEAR(modern[2] / luminance, 1.036, 0.004);
}

// Claim: a black body cut to a band has the light of that band, and bands add up.
TEST(DescriptionSpectra, BlackbodyBands) {
  const Vec3 all = colorimetry::blackbody_xyz(4000);
  const Vec3 low = colorimetry::blackbody_xyz(4000, 0, 512.3);
  const Vec3 high = colorimetry::blackbody_xyz(4000, 512.3, 9999);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR((low[c] + high[c]) / all[c], 1, 1e-9);
  EXPECT_LT(low[0], high[0]);
}

// Claim: a narrow band of light has the colour of the observer there; out of Rec.709's range it is clamped at
// zero, with a note that says so.
TEST(DescriptionSpectra, NarrowBands) {
  for (const double nm : {420.0, 455.0, 502.5, 555.0, 591.0, 640.0}) {
    const Vec3 xyz = colorimetry::emitted_xyz(band(nm - 0.5, nm + 0.5));
    const Vec3 seen = colorimetry::observer(nm);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(xyz[c] * 106.857, seen[c], 1e-3 + 0.01 * seen[c]) << nm;
  }
  const auto result = parse_text(
      "<scene version='3.0.0'><emitter type='constant'>\n<spectrum name='radiance' value='500:1, 510:1'/>"
      "</emitter></scene>");
  ASSERT_TRUE(result.ok()) << outcome(result);
  const Vec3 green = result->scene->children[0].object->get_rgb("radiance")->value;
  EXPECT_EQ(green[0], 0);
  EXPECT_GT(green[1], 0);
  ASSERT_EQ(result->notes.size(), 1U);
  EXPECT_EQ(result->notes[0].where.line, 2);
  EXPECT_TRUE(result->notes[0].text.starts_with("the spectrum is out of Rec.709's range"))
      << result->notes[0].text;
}

// Claim: integration is exact where a list has edges between the tables' entries: pieces add up to the whole.
TEST(DescriptionSpectra, PiecesAddUp) {
  const Spectrum whole = {{391.7, 523.4, 688.8}, {0.2, 1.7, 0.4}};
  const double t = (601.3 - 523.4) / (688.8 - 523.4);
  const double middle = 1.7 + t * (0.4 - 1.7);
  const Vec3 all = colorimetry::reflected(whole);
  const Vec3 a = colorimetry::reflected({{391.7, 523.4, 601.3}, {0.2, 1.7, middle}});
  const Vec3 b = colorimetry::reflected({{601.3, 688.8}, {middle, 0.4}});
  expect_near({a[0] + b[0], a[1] + b[1], a[2] + b[2]}, all, 1e-14);
}

// Claim: reflectances end at 1 and indices of refraction do not, and both are weighed by daylight; light is
// not.
TEST(DescriptionSpectra, UseDecidesWeightAndBounds) {
  const std::string list = "value='360:2, 830:2'/>";
  EXPECT_EQ(reflectance("<spectrum name='reflectance' " + list), (Vec3{1, 1, 1}));
  expect_near(colour_in("<bsdf type='conductor'>", "eta", "<spectrum name='eta' " + list), {2, 2, 2}, 1e-3);
  expect_near(radiance("<spectrum name='radiance' " + list), {2.41, 1.897, 1.818}, 2e-3);
}

// Claim: files, lists and both plugins of measured values say the same, and the file is one of the scene's.
TEST(DescriptionSpectra, SpellingsOfMeasuredValues) {
  const Vec3 list = reflectance("<spectrum name='reflectance' value='400:0.1, 500:0.2, 600:0.9'/>");
  EXPECT_GT(list[0], list[2]);
  EXPECT_EQ(reflectance("<spectrum name='reflectance' filename='a.spd'/>",
                        {{"a.spd", "# measured\n\n400 0.1\r\n500\t0.2 # here\n600 0.9"}}),
            list);
  EXPECT_EQ(reflectance("<spectrum name='reflectance' type='irregular'><string name='wavelengths' "
                        "value='400, 500, 600'/><string name='values' value='0.1, 0.2 0.9'/></spectrum>"),
            list);
  EXPECT_EQ(
      reflectance("<spectrum name='reflectance' type='regular'><string name='values' value='0.1 0.2 0.9'/>"
                  "<float name='wavelength_min' value='400'/><float name='wavelength_max' value='600'/>"
                  "</spectrum>"),
      list);
  const auto result = parse_text(
      "<scene version='3.0.0'><bsdf type='diffuse'><spectrum name='reflectance' "
      "filename='a.spd'/></bsdf></scene>",
      {}, {{"a.spd", "400 0.1\n500 0.2\n"}});
  ASSERT_TRUE(result.ok()) << outcome(result);
  EXPECT_EQ(result->files, (std::vector<std::string>{"a.spd", "scene.xml"}));
}

// Claim: the plugins that are colours in an RGB renderer are these colours.
TEST(DescriptionSpectra, ColourPlugins) {
  EXPECT_EQ(radiance("<spectrum name='radiance' type='d65'/>"), (Vec3{1, 1, 1}));
  EXPECT_EQ(radiance("<spectrum name='radiance' type='d65'><float name='scale' value='3'/></spectrum>"),
            (Vec3{3, 3, 3}));
  EXPECT_EQ(radiance("<spectrum name='radiance' type='d65'><rgb name='color' value='1 2 3'/>"
                     "<float name='scale' value='2'/></spectrum>"),
            (Vec3{2, 4, 6}));
  EXPECT_EQ(
      reflectance(
          "<spectrum name='reflectance' type='srgb'><rgb name='color' value='0.1 0.2 0.3'/></spectrum>"),
      (Vec3{0.1, 0.2, 0.3}));
  EXPECT_EQ(reflectance(
                "<spectrum name='reflectance' type='uniform'><float name='value' value='0.75'/></spectrum>"),
            (Vec3{0.75, 0.75, 0.75}));
}

}  // namespace
}  // namespace candela::description
