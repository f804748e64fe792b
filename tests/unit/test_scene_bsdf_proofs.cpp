// Every bsdf, through every proof of bsdf_proofs.h. A new bsdf adds its lines to configurations().
#include <gtest/gtest.h>

#include "bsdf_proofs.h"

namespace candela::test {
namespace {

// All statistical tests of this file share one false-alarm rate over seeds; the seeds are fixed.
constexpr double kFalseAlarm = 1e-4;
constexpr double kMostTests = 20000;

std::vector<BsdfConfiguration> configurations() {
  std::vector<BsdfConfiguration> all;

  all.push_back(
      {.name = "diffuse", .xml = "<bsdf type='diffuse'><rgb name='reflectance' value='0.2 0.5 1'/></bsdf>"});
  all.push_back({.name = "diffuse_white",
                 .xml = "<bsdf type='twosided'><bsdf type='diffuse'><rgb name='reflectance' value='1 1 1'/>"
                        "</bsdf></bsdf>",
                 .least_albedo = 1});
  all.push_back({.name = "diffuse_black",
                 .xml = "<bsdf type='diffuse'><rgb name='reflectance' value='0 0 0'/></bsdf>"});

  all.push_back({.name = "dielectric",
                 .xml = "<bsdf type='dielectric'/>",
                 .eta = 1.5046 / 1.000277,
                 .least_albedo = 1,
                 .more_cosines = {0.01}});
  all.push_back({.name = "dielectric_denser_outside",
                 .xml = "<bsdf type='dielectric'><float name='int_ior' value='1'/>"
                        "<float name='ext_ior' value='2.4'/></bsdf>",
                 .eta = 1 / 2.4,
                 .least_albedo = 1});
  all.push_back({.name = "dielectric_coloured",
                 .xml = "<bsdf type='dielectric'><rgb name='specular_reflectance' value='0.9 0.1 0.5'/>"
                        "<rgb name='specular_transmittance' value='0.2 1 0'/></bsdf>",
                 .eta = 1.5046 / 1.000277});
  all.push_back({.name = "dielectric_matched",
                 .xml = "<bsdf type='dielectric'><float name='int_ior' value='1.3'/>"
                        "<float name='ext_ior' value='1.3'/></bsdf>",
                 .least_albedo = 1});

  all.push_back({.name = "conductor_perfect", .xml = "<bsdf type='conductor'/>"});
  all.push_back({.name = "conductor_copper",
                 .xml = "<bsdf type='twosided'><bsdf type='conductor'>"
                        "<rgb name='eta' value='0.2004 0.9240 1.1022'/>"
                        "<rgb name='k' value='3.9129 2.4528 2.1421'/></bsdf></bsdf>",
                 .least_albedo = 0.4});

  // Roughness below 0.01 has tests with a chart of its own in test_scene_bsdf.cpp.
  const auto rough = [&](const std::string& name, const std::string& alpha, double least) {
    for (const std::string distribution : {"beckmann", "ggx"}) {
      for (const std::string visible : {"true", "false"}) {
        all.push_back(
            {.name =
                 "roughconductor_" + name + "_" + distribution + (visible == "true" ? "_visible" : "_all"),
             .xml = "<bsdf type='roughconductor'><string name='distribution' value='" + distribution +
                    "'/><boolean name='sample_visible' value='" + visible + "'/>" + alpha + "</bsdf>",
             .least_albedo = least});
      }
    }
  };
  rough("narrow", "<float name='alpha' value='0.01'/>", 0.99);
  rough("middling", "<float name='alpha' value='0.2'/>", 0.85);
  rough("wide", "<float name='alpha' value='1'/>", 0.3);
  rough("brushed", "<float name='alpha_u' value='0.05'/><float name='alpha_v' value='0.4'/>", 0.8);
  all.push_back({.name = "roughconductor_denormal",
                 .xml = "<bsdf type='twosided'><bsdf type='roughconductor'>"
                        "<float name='alpha' value='1e-40'/></bsdf></bsdf>",
                 .least_albedo = 0.99});

  all.push_back({.name = "null", .xml = "<bsdf type='null'/>", .least_albedo = 1});
  all.push_back({.name = "mask",
                 .xml = "<bsdf type='mask'><float name='opacity' value='0.3'/>"
                        "<bsdf type='roughconductor'><float name='alpha' value='0.05'/></bsdf></bsdf>",
                 .least_albedo = 0.69});
  all.push_back({.name = "mask_of_two_sides",
                 .xml = "<bsdf type='mask'><float name='opacity' value='0.8'/><bsdf type='twosided'>"
                        "<bsdf type='diffuse'/><bsdf type='conductor'/></bsdf></bsdf>"});
  all.push_back({.name = "blend_rough_diffuse",
                 .xml = "<bsdf type='twosided'><bsdf type='blendbsdf'><float name='weight' value='0.3'/>"
                        "<bsdf type='roughconductor'><float name='alpha' value='0.02'/></bsdf>"
                        "<bsdf type='diffuse'><rgb name='reflectance' value='1 0.5 0.1'/></bsdf>"
                        "</bsdf></bsdf>"});
  all.push_back({.name = "blend_with_delta",
                 .xml = "<bsdf type='blendbsdf'><float name='weight' value='0.6'/><bsdf type='conductor'/>"
                        "<bsdf type='blendbsdf'><bsdf type='diffuse'/><bsdf type='null'/></bsdf></bsdf>"});
  all.push_back({.name = "blend_glass_diffuse",
                 .xml = "<bsdf type='blendbsdf'><bsdf type='dielectric'/><bsdf type='diffuse'/></bsdf>",
                 .eta = 1.5046 / 1.000277});
  return all;
}

class BsdfProof : public testing::TestWithParam<BsdfConfiguration> {};

// Claims, for directions from normal to grazing on both sides, in both modes, and for the walk back:
// sample() has the density pdf_solid_angle() states and chooses delta lobes with `prob` (chi-squared over
// bins of the sphere, the delta lobes and the refusals); density and probabilities add up to at most 1;
// weights are value over density; values are reciprocal and each mode the adjoint of the other; no light is
// made; prob_reverse is what sampling backwards finds; straight() is what straight samples carry; eta, the
// flags and the facts are true; nothing is NaN, infinite or negative whatever the directions.
TEST_P(BsdfProof, Holds) {
  static_cast<void>(prove_bsdf(GetParam(), kFalseAlarm / kMostTests));
}

INSTANTIATE_TEST_SUITE_P(All, BsdfProof, testing::ValuesIn(configurations()),
                         [](const auto& tested) { return tested.param.name; });

TEST(BsdfProofs, ShareTheFalseAlarmRate) {
  // 2 modes, at most 4 ways back each, 8 directions and more.
  double most = 0;
  for (const BsdfConfiguration& c : configurations())
    most += 2 * 5 * 2 * (4 + static_cast<double>(c.more_cosines.size()));
  EXPECT_LE(most, kMostTests);
}

}  // namespace
}  // namespace candela::test
