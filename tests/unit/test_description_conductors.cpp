// Named conductors: the table against the measurements, and what becomes of the name.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/description/colorimetry.h"
#include "common/description/conductors.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

struct Measured {
  std::string name;
  std::vector<double> wavelengths, eta, k;
};

std::vector<Measured> measured() {
  return {
#include "test_description_conductors.inc"
  };
}

ObjectPtr bsdf(const std::string& content, const std::string& version = "3.0.0") {
  const auto result =
      parse_text("<scene version='" + version + "'><bsdf type='conductor'>" + content + "</bsdf></scene>");
  EXPECT_TRUE(result.ok()) << outcome(result) << " for " << content;
  return result.ok() ? result->scene->children.at(0).object : std::make_shared<const Object>();
}

std::string refusal(const std::string& content, const std::string& version = "3.0.0") {
  return outcome(
      parse_text("<scene version='" + version + "'><bsdf type='conductor'>" + content + "</bsdf></scene>"));
}

std::string material(const std::string& name) {
  return "<string name='material' value='" + name + "'/>";
}

void expect_near(const Vec3& got, const Vec3& expected, double tolerance) {
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(got[c], expected[c], tolerance) << "component " << c;
}

// Reflectance at normal incidence.
double reflectance(double eta, double k) {
  return ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
}

// Claim: the table's rows are the integrals of the measurements (those kept here), clamped at 0.
TEST(DescriptionConductors, TableIsTheMeasurements) {
  for (const Measured& metal : measured()) {
    const auto index = named_conductor(metal.name);
    ASSERT_TRUE(index) << metal.name;
    for (const auto& [values, row] : {std::pair(metal.eta, index->eta), std::pair(metal.k, index->k)}) {
      Vec3 expected = colorimetry::emitted({metal.wavelengths, values});
      for (double& component : expected) component = std::max(component, 0.0);
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(row[c], expected[c], 6e-5 * std::max(1.0, expected[c]))
            << metal.name << " component " << c;
    }
  }
}

// Claim: silver is what Mitsuba 3 makes of its file in an RGB variant (numbers published from it).
TEST(DescriptionConductors, SilverIsMitsubas) {
  const ConductorIndex silver = *named_conductor("Ag");
  expect_near(silver.eta, {0.155276, 0.116728, 0.138388}, 1e-5);
  expect_near(silver.k, {4.828354, 3.122222, 2.146901}, 1e-4);
}

// Claim: metals have the colours metals have.
TEST(DescriptionConductors, Colours) {
  const auto at = [](std::string_view name, std::size_t c) {
    const ConductorIndex index = *named_conductor(name);
    return reflectance(index.eta[c], index.k[c]);
  };
  EXPECT_GT(at("Au", 0), 0.95);  // gold: yellow
  EXPECT_LT(at("Au", 2), 0.4);
  EXPECT_GT(at("Cu", 0), 0.9);  // copper: red
  EXPECT_LT(at("Cu", 1), at("Au", 1));
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_GT(at("Ag", c), 0.9);
    EXPECT_NEAR(at("Al", c), 0.92, 0.01);
    EXPECT_GT(at("W", c), 0.4);
    EXPECT_LT(at("W", c), 0.6);
  }
}

// Claim: names are unique, and each resolves to finite values that are not negative; both names of a
// measurement by Palik give the same, except copper's, which is another.
TEST(DescriptionConductors, NamesAreUniqueAndResolve) {
  std::vector<std::string> names = conductor_names();
  EXPECT_EQ(names.size(), 71U);
  for (const std::string& name : names) {
    const auto index = named_conductor(name);
    ASSERT_TRUE(index) << name;
    for (const Vec3& part : {index->eta, index->k})
      for (const double component : part) EXPECT_TRUE(component >= 0 && component < 12) << name;
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
  EXPECT_EQ(named_conductor("TiN")->eta, named_conductor("TiN_palik")->eta);
  EXPECT_NE(named_conductor("Cu")->eta, named_conductor("Cu_palik")->eta);
  EXPECT_FALSE(named_conductor("Au_palik"));
  EXPECT_FALSE(named_conductor("Na"));
  EXPECT_FALSE(named_conductor(""));
}

// Claim: a named material reaches the renderer as eta and k, and nothing else of it does.
TEST(DescriptionConductors, NameBecomesEtaAndK) {
  const ObjectPtr gold = bsdf(material("Au"));
  EXPECT_EQ(gold->find("material"), nullptr);
  EXPECT_EQ(gold->get_rgb("eta")->value, named_conductor("Au")->eta);
  EXPECT_EQ(gold->get_rgb("k")->value, named_conductor("Au")->k);
  // A perfect mirror: Mitsuba 3's default, by name or by silence.
  for (const std::string& none : {std::string(), material("none"), material("None")}) {
    EXPECT_EQ(bsdf(none)->find("eta"), nullptr);
    EXPECT_EQ(bsdf(none)->find("material"), nullptr);
  }
}

// Claim: unknown names are refused with the nearest, and a name excludes eta and k.
TEST(DescriptionConductors, Refusals) {
  EXPECT_EQ(refusal(material("au")),
            "scene.xml:1: 'au' is no material with measured indices of refraction (did you mean 'Au'?)");
  EXPECT_EQ(
      refusal(material("Unobtainium")),
      "scene.xml:1: 'Unobtainium' is no material with measured indices of refraction (give eta and k, or one "
      "of the names in docs/plugins.md)");
  EXPECT_EQ(refusal(material("Au") + "<rgb name='k' value='1'/>"),
            "scene.xml:1: bsdf 'conductor' has both 'material' and 'k' (leave one of them out)");
}

// Claim: before version 2 the default is copper, eta or k alone replace one of its parts, and ext_eta
// divides.
TEST(DescriptionConductors, OldFiles) {
  const ConductorIndex copper = *named_conductor("Cu");
  const ObjectPtr plain = bsdf("", "0.6.0");
  EXPECT_EQ(plain->get_rgb("eta")->value, copper.eta);
  EXPECT_EQ(plain->get_rgb("k")->value, copper.k);
  const ObjectPtr half = bsdf("<rgb name='eta' value='2'/>", "0.6.0");
  EXPECT_EQ(half->get_rgb("eta")->value, (Vec3{2, 2, 2}));
  EXPECT_EQ(half->get_rgb("k")->value, copper.k);
  const ObjectPtr mirror = bsdf(material("none"), "0.6.0");
  EXPECT_EQ(mirror->find("eta"), nullptr);
  const ObjectPtr wet = bsdf(material("Au") + "<string name='extEta' value='water'/>", "0.6.0");
  const ConductorIndex gold = *named_conductor("Au");
  expect_near(wet->get_rgb("eta")->value, {gold.eta[0] / 1.333, gold.eta[1] / 1.333, gold.eta[2] / 1.333},
              1e-12);
  expect_near(wet->get_rgb("k")->value, {gold.k[0] / 1.333, gold.k[1] / 1.333, gold.k[2] / 1.333}, 1e-12);
  EXPECT_EQ(wet->find("ext_eta"), nullptr);
  const ObjectPtr wet_mirror = bsdf(material("none") + "<float name='extEta' value='2'/>", "0.6.0");
  EXPECT_EQ(wet_mirror->get_rgb("k")->value, (Vec3{0.5, 0.5, 0.5}));
  EXPECT_EQ(refusal("<string name='extEta' value='mud'/>", "0.6.0"),
            "scene.xml:1: 'mud' is not a material with a known index of refraction");
  EXPECT_EQ(refusal("<float name='extEta' value='0'/>", "0.6.0"),
            "scene.xml:1: parameter 'ext_eta' is 0, but must be above 0");
}

}  // namespace
}  // namespace candela::description
