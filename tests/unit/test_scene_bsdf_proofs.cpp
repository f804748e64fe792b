// Every bsdf, through every proof of bsdf_proofs.h. A new bsdf adds its lines to configurations().
#include <gtest/gtest.h>

#include <sstream>

#include "bsdf_proofs.h"
#include "tests/proofs/proofs.h"

namespace candela::test {
namespace {

// All statistical tests of this file share one false-alarm rate over seeds; the seeds are fixed.
constexpr double kFalseAlarm = 1e-4;
constexpr double kMaxTests = 20000;

constexpr double kGlass = 1.5046 / 1.000277;

std::string number(const std::string& name, const std::string& value) {
  return "<float name='" + name + "' value='" + value + "'/>";
}

void add_rough_dielectrics(std::vector<BsdfConfiguration>& all) {
  const auto rough = [&](const std::string& name, const std::string& parameters, double eta, double least,
                         const std::vector<std::string>& visibles) {
    for (const std::string distribution : {"beckmann", "ggx"}) {
      for (const std::string& visible : visibles) {
        all.push_back(
            {.name =
                 "roughdielectric_" + name + "_" + distribution + (visible == "true" ? "_visible" : "_all"),
             .xml = "<bsdf type='roughdielectric'><string name='distribution' value='" + distribution +
                    "'/><boolean name='sample_visible' value='" + visible + "'/>" + parameters + "</bsdf>",
             .eta = eta,
             .least_albedo = least});
      }
    }
  };
  rough("narrow", number("alpha", "0.01"), kGlass, 0.98, {"true"});
  rough("middling", number("alpha", "0.2"), kGlass, 0.7, {"true", "false"});
  rough("wide", number("alpha", "0.8"), kGlass, 0.3, {"true"});
  rough("brushed", number("alpha_u", "0.07") + number("alpha_v", "0.3"), kGlass, 0.6, {"true"});
  rough("denser_outside", number("alpha", "0.3") + number("int_ior", "1") + number("ext_ior", "2.4"), 1 / 2.4,
        0.5, {"true"});
  const auto one = [&](const std::string& name, const std::string& parameters, double eta, double least) {
    all.push_back({.name = "roughdielectric_" + name,
                   .xml = "<bsdf type='roughdielectric'>" + parameters + "</bsdf>",
                   .eta = eta,
                   .least_albedo = least});
  };
  one("coloured",
      "<rgb name='specular_reflectance' value='0.9 0.1 0.5'/>"
      "<rgb name='specular_transmittance' value='0.2 1 0'/>",
      kGlass, 0);
  one("only_passes", "<rgb name='specular_reflectance' value='0 0 0'/>", kGlass, 0);
  one("only_reflects", "<rgb name='specular_transmittance' value='0 0 0'/>", kGlass, 0);
  one("nearly_matched", number("int_ior", "1.01") + number("ext_ior", "1"), 1.01, 0.9);
  one("hardly_there", number("int_ior", "1.0002") + number("ext_ior", "1") + number("alpha", "0.5"), 1.0002,
      0.9);
  one("matched", number("int_ior", "1.3") + number("ext_ior", "1.3"), 1, 1);
  one("denormal", number("alpha", "1e-40"), kGlass, 0.98);
  one("dense", number("int_ior", "4") + number("ext_ior", "1") + number("alpha", "0.1"), 4, 0.8);
}

void add_plastics(std::vector<BsdfConfiguration>& all) {
  const std::string white = "<rgb name='diffuse_reflectance' value='1 1 1'/>";
  const std::string red = "<rgb name='diffuse_reflectance' value='0.9 0.5 0.1'/>";
  const std::string nonlinear = "<boolean name='nonlinear' value='true'/>";
  const auto one = [&](const std::string& plugin, const std::string& name, const std::string& parameters,
                       double least) {
    all.push_back({.name = plugin + "_" + name,
                   .xml = "<bsdf type='" + plugin + "'>" + parameters + "</bsdf>",
                   .least_albedo = least});
  };
  one("plastic", "white", white, 1);
  one("plastic", "white_nonlinear", white + nonlinear, 1);
  one("plastic", "red", red, 0);
  one("plastic", "red_nonlinear", red + nonlinear, 0);
  one("plastic", "denser_outside", white + number("int_ior", "1") + number("ext_ior", "1.5"), 1);
  one("plastic", "dense", white + number("int_ior", "900") + number("ext_ior", "1"), 1);
  one("plastic", "matched", red + number("int_ior", "1.2") + number("ext_ior", "1.2"), 0);
  one("plastic", "without_base", "<rgb name='diffuse_reflectance' value='0 0 0'/>", 0);
  one("plastic", "without_gloss", "<rgb name='specular_reflectance' value='0 0 0'/>" + red, 0);
  for (const std::string plugin : {"plastic", "roughplastic"}) {
    all.push_back(
        {.name = plugin + "_two_sided", .xml = "<bsdf type='twosided'><bsdf type='" + plugin + "'/></bsdf>"});
  }

  for (const std::string distribution : {"beckmann", "ggx"}) {
    const std::string type = "<string name='distribution' value='" + distribution + "'/>";
    one("roughplastic", "narrow_" + distribution, type + white + number("alpha", "0.01"), 0.95);
    one("roughplastic", "middling_" + distribution, type + white + number("alpha", "0.2"), 0.8);
    one("roughplastic", "wide_" + distribution, type + white + nonlinear + number("alpha", "0.9"), 0.5);
    one("roughplastic", "all_normals_" + distribution,
        type + red + number("alpha", "0.3") + "<boolean name='sample_visible' value='false'/>", 0);
  }
  one("roughplastic", "red_nonlinear", red + nonlinear, 0);
  one("roughplastic", "dense", white + number("int_ior", "20") + number("ext_ior", "1"), 0.8);
  all.push_back({.name = "roughplastic_denser_outside",
                 .xml = "<bsdf type='roughplastic'>" + white + number("int_ior", "1") +
                        number("ext_ior", "1.5") + "</bsdf>",
                 .least_albedo = 0.8,
                 .most_albedo = 1.005,
                 .why_more = "the coat's table is that coarse next to the critical angle"});
  one("roughplastic", "matched", red + number("int_ior", "1.2") + number("ext_ior", "1.2"), 0);
  one("roughplastic", "tight", white + number("alpha", "0.001"), 0.95);
  one("roughplastic", "without_base", "<rgb name='diffuse_reflectance' value='0 0 0'/>", 0);
  one("roughplastic", "without_gloss", "<rgb name='specular_reflectance' value='0 0 0'/>" + red, 0);
}

// The bsdfs of Mitsuba 0.6 that Mitsuba 3 lacks.
void add_old_bsdfs(std::vector<BsdfConfiguration>& all) {
  const auto one = [&](const std::string& plugin, const std::string& name, const std::string& inside,
                       double least = 0) {
    all.push_back({.name = plugin + "_" + name,
                   .xml = "<bsdf type='" + plugin + "'>" + inside + "</bsdf>",
                   .least_albedo = least});
  };
  const std::string gray = "<rgb name='reflectance' value='0.8 0.4 0.1'/>";
  one("roughdiffuse", "default", "", 0.4);
  one("roughdiffuse", "flat", gray + number("alpha", "0"));
  one("roughdiffuse", "coarse", gray + number("alpha", "0.7"));
  one("roughdiffuse", "fast",
      gray + number("alpha", "0.5") + "<boolean name='use_fast_approx' value='true'/>");
  all.push_back({.name = "roughdiffuse_two_sided",
                 .xml = "<bsdf type='twosided'><bsdf type='roughdiffuse'>" + gray + "</bsdf></bsdf>"});
  one("difftrans", "default", "");
  one("difftrans", "white", "<rgb name='transmittance' value='1'/>", 1);
  one("difftrans", "colored", "<rgb name='transmittance' value='0.9 0.3 0'/>");
  one("difftrans", "both",
      "<rgb name='transmittance' value='0.9 0.3 0'/><rgb name='reflectance' value='0.1 0.6 1'/>");
  const auto layer = [&](const std::string& name, const std::string& s, const std::string& a,
                         const std::string& more, double least = 0) {
    one("hk", name, "<rgb name='sigma_s' value='" + s + "'/><rgb name='sigma_a' value='" + a + "'/>" + more,
        least);
  };
  layer("thin", "0.5 0.8 0.2", "0 0.1 0.4", "");
  layer("thick", "9 5 7", "1 0 0", number("thickness", "2"));
  layer("forward", "1", "0.2", "<phase type='hg'><float name='g' value='0.7'/></phase>");
  layer("rayleigh", "1", "0", number("thickness", "0.3") + "<phase type='rayleigh'/>", 0.7);
  layer("nothing", "0", "0", "", 1);
  one("hk", "by_albedo", "<rgb name='sigma_t' value='2'/><rgb name='albedo' value='0.9 0.5 0'/>");
  const std::string white = "<bsdf type='diffuse'><rgb name='reflectance' value='1'/></bsdf>";
  one("coating", "white", white, 0.4);
  one("coating", "absorbing", "<rgb name='sigma_a' value='0.1 0.5 2'/>" + number("thickness", "0.5") + white);
  one("coating", "denser_outside", number("int_ior", "1") + number("ext_ior", "1.5") + white);
  one("coating", "matched", number("int_ior", "1.2") + number("ext_ior", "1.2") + white, 1);
  one("coating", "of_mirror", "<bsdf type='conductor'/>", 0.8);
  one("coating", "of_rough_metal", "<bsdf type='roughconductor'><float name='alpha' value='0.15'/></bsdf>",
      0.4);
  one("coating", "of_plastic", "<bsdf type='plastic'/>");
  one("coating", "without_gloss", "<rgb name='specular_reflectance' value='0'/>" + white);
  const std::string satin = "<bsdf type='roughconductor'><float name='alpha' value='0.15'/></bsdf>";
  one("roughcoating", "white", white, 0.4);
  one("roughcoating", "wide_ggx",
      "<string name='distribution' value='ggx'/>" + number("alpha", "0.6") + white, 0.3);
  one("roughcoating", "narrow", number("alpha", "0.01") + white, 0.4);
  one("roughcoating", "all_normals",
      number("alpha", "0.3") + "<boolean name='sample_visible' value='false'/>" + white);
  one("roughcoating", "absorbing",
      "<rgb name='sigma_a' value='0.1 0.5 2'/><rgb name='specular_reflectance' value='1 0.5 0'/>" + white);
  one("roughcoating", "of_mirror", "<bsdf type='conductor'/>", 0.6);
  one("roughcoating", "of_rough_metal", number("alpha", "0.3") + satin, 0.3);
  one("roughcoating", "matched", number("int_ior", "1.2") + number("ext_ior", "1.2") + white, 0.9);
  one("roughcoating", "without_gloss", "<rgb name='specular_reflectance' value='0'/>" + white);
  all.push_back(
      {.name = "roughcoating_two_sided",
       .xml = "<bsdf type='twosided'><bsdf type='roughcoating'><bsdf type='plastic'/></bsdf></bsdf>"});
  one("roughcoating", "of_two_sides",
      "<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='conductor'/></bsdf>");
  all.push_back({.name = "coating_two_sided",
                 .xml = "<bsdf type='twosided'><bsdf type='coating'><bsdf type='blendbsdf'><bsdf "
                        "type='conductor'/><bsdf type='diffuse'/></bsdf></bsdf></bsdf>"});
  one("coating", "of_two_sides",
      "<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='conductor'/></bsdf>");
}

// On a surface whose geometric normal leans by 37 degrees.
void add_strict_normals(std::vector<BsdfConfiguration>& all) {
  const auto one = [&](const std::string& name, const std::string& xml, double eta = 1) {
    all.push_back({.name = "strict_normals_" + name, .xml = xml, .eta = eta, .ng = {0.48f, -0.36f, 0.8f}});
  };
  one("diffuse", "<bsdf type='diffuse'><rgb name='reflectance' value='0.2 0.5 1'/></bsdf>");
  one("two_sided", "<bsdf type='twosided'><bsdf type='roughplastic'/></bsdf>");
  one("glass", "<bsdf type='dielectric'/>", kGlass);
  one("rough_glass", "<bsdf type='roughdielectric'><float name='alpha' value='0.3'/></bsdf>", kGlass);
  one("mask",
      "<bsdf type='mask'><float name='opacity' value='0.7'/><bsdf type='blendbsdf'><bsdf type='diffuse'/>"
      "<bsdf type='conductor'/></bsdf></bsdf>");
}

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
                 .eta = kGlass,
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
                 .eta = kGlass});
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

  add_rough_dielectrics(all);
  add_plastics(all);
  add_old_bsdfs(all);
  add_strict_normals(all);

  all.push_back({.name = "thindielectric", .xml = "<bsdf type='thindielectric'/>", .least_albedo = 1});
  all.push_back({.name = "thindielectric_denser_outside",
                 .xml = "<bsdf type='thindielectric'><float name='int_ior' value='1'/>"
                        "<float name='ext_ior' value='1.5'/></bsdf>",
                 .least_albedo = 1});
  all.push_back({.name = "thindielectric_coloured",
                 .xml = "<bsdf type='thindielectric'><float name='int_ior' value='2'/>"
                        "<rgb name='specular_reflectance' value='0.9 0.1 0.5'/>"
                        "<rgb name='specular_transmittance' value='0.2 1 0'/></bsdf>"});
  all.push_back({.name = "thindielectric_matched",
                 .xml = "<bsdf type='thindielectric'><float name='int_ior' value='1.3'/>"
                        "<float name='ext_ior' value='1.3'/></bsdf>",
                 .least_albedo = 1});
  all.push_back({.name = "blend_of_panes",
                 .xml = "<bsdf type='mask'><float name='opacity' value='0.7'/><bsdf type='blendbsdf'>"
                        "<bsdf type='thindielectric'/><bsdf type='roughdielectric'/></bsdf></bsdf>",
                 .eta = kGlass});

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
                 .eta = kGlass});

  all.push_back({.name = "mask_opaque",
                 .xml = "<bsdf type='mask'><float name='opacity' value='1'/><bsdf type='diffuse'>"
                        "<rgb name='reflectance' value='0.8'/></bsdf></bsdf>"});
  all.push_back({.name = "mask_clear",
                 .xml = "<bsdf type='mask'><float name='opacity' value='0'/><bsdf type='diffuse'/></bsdf>",
                 .least_albedo = 1});
  all.push_back({.name = "mask_textured",
                 .xml = "<bsdf type='mask'><texture name='opacity' type='checkerboard'><rgb name='color0' "
                        "value='0.2 0.9 0.4'/><rgb name='color1' value='0.9 0.1 0.3'/></texture>"
                        "<bsdf type='dielectric'/></bsdf>",
                 .eta = 1.5046 / 1.000277,
                 .least_albedo = 1});
  all.push_back(
      {.name = "blend_two_deltas",
       .xml = "<bsdf type='blendbsdf'><float name='weight' value='0.3'/><bsdf type='dielectric'/>"
              "<bsdf type='conductor'><rgb name='specular_reflectance' value='0.9 0.5 0.1'/></bsdf></bsdf>",
       .eta = kGlass});
  all.push_back({.name = "blend_two_glasses",
                 .xml = "<bsdf type='blendbsdf'><float name='weight' value='0.3'/><bsdf "
                        "type='dielectric'><float name='int_ior' value='1.3'/></bsdf>"
                        "<bsdf type='dielectric'><float name='int_ior' value='2'/></bsdf></bsdf>",
                 .eta = 0,
                 .least_albedo = 1});
  all.push_back({.name = "blend_of_sides_and_null",
                 .xml = "<bsdf type='blendbsdf'><float name='weight' value='0.25'/><bsdf type='twosided'>"
                        "<bsdf type='roughconductor'><float name='alpha' value='0.3'/></bsdf>"
                        "<bsdf type='diffuse'/></bsdf><bsdf type='null'/></bsdf>"});
  all.push_back({.name = "blend_weight_zero",
                 .xml = "<bsdf type='blendbsdf'><float name='weight' value='0'/><bsdf type='diffuse'/>"
                        "<bsdf type='conductor'/></bsdf>"});
  all.push_back(
      {.name = "blend_nested",
       .xml = "<bsdf type='twosided'><bsdf type='blendbsdf'><float name='weight' value='0.4'/>"
              "<bsdf type='blendbsdf'><float name='weight' value='0.1'/><bsdf type='diffuse'/>"
              "<bsdf type='conductor'/></bsdf><bsdf type='blendbsdf'><float name='weight' value='0.7'/>"
              "<bsdf type='roughconductor'><float name='alpha' value='0.1'/></bsdf>"
              "<bsdf type='conductor'><rgb name='specular_reflectance' value='0.3'/></bsdf></bsdf>"
              "</bsdf></bsdf>"});

  const auto turned = [](const std::string& normal, const std::string& options, const std::string& nested) {
    return "<bsdf type='normalmap'><rgb name='normalmap' value='" + normal + "'/>" + options + nested +
           "</bsdf>";
  };
  const std::string plain =
      "<boolean name='flip_invalid_normals' value='false'/><boolean name='use_shadowing_function' "
      "value='false'/>";
  const std::string why_turned = "cos theta is that of the turned normal";
  all.push_back(
      {.name = "normalmap_flat",
       .xml = turned("0.5 0.5 1", "", "<bsdf type='roughconductor'><float name='alpha' value='0.2'/></bsdf>"),
       .least_albedo = 0.85});
  all.push_back(
      {.name = "normalmap_diffuse",
       .xml = turned("0.7 0.4 0.9", "", "<bsdf type='diffuse'><rgb name='reflectance' value='1'/></bsdf>"),
       .not_reciprocal = why_turned,
       .unbounded_adjoint = true});
  all.push_back({.name = "normalmap_diffuse_plain",
                 .xml = turned("0.7 0.4 0.9", plain, "<bsdf type='diffuse'/>"),
                 .not_reciprocal = why_turned,
                 .unbounded_adjoint = true});
  all.push_back(
      {.name = "normalmap_mirror",
       .xml = "<bsdf type='twosided'>" + turned("0.7 0.4 0.9", "", "<bsdf type='conductor'/>") + "</bsdf>",
       .not_reciprocal = why_turned,
       .unbounded_adjoint = true});
  all.push_back({.name = "normalmap_glass",
                 .xml = turned("0.6 0.4 0.95", "", "<bsdf type='dielectric'/>"),
                 .eta = kGlass,
                 .not_reciprocal = why_turned,
                 .unbounded_adjoint = true});
  all.push_back(
      {.name = "normalmap_two_sides_masked",
       .xml = turned("0.3 0.45 0.8", "",
                     "<bsdf type='mask'><bsdf type='twosided'><bsdf type='roughconductor'>"
                     "<float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.3'/></bsdf></bsdf>"
                     "</bsdf>"),
       .not_reciprocal = why_turned,
       .unbounded_adjoint = true});

  const auto phong = [](const std::string& exponent, const std::string& diffuse,
                        const std::string& specular) {
    return "<bsdf type='phong'><float name='exponent' value='" + exponent +
           "'/><rgb name='diffuse_reflectance' value='" + diffuse +
           "'/><rgb name='specular_reflectance' value='" + specular + "'/></bsdf>";
  };
  all.push_back({.name = "phong", .xml = "<bsdf type='phong'/>", .least_albedo = 0.5});
  all.push_back({.name = "phong_two_sided",
                 .xml = "<bsdf type='twosided'>" + phong("5", "0.1 0.5 0", "0.2 0.3 0.9") + "</bsdf>"});
  all.push_back({.name = "phong_narrow", .xml = phong("3000", "0", "1"), .least_albedo = 0.4});
  all.push_back({.name = "phong_zero", .xml = phong("0", "0", "0.9")});
  all.push_back({.name = "phong_too_bright", .xml = phong("20", "0.9", "0.8 0.8 0.4"), .least_albedo = 0.6});

  const auto ward = [](const std::string& variant, const std::string& more) {
    return "<bsdf type='ward'><string name='variant' value='" + variant + "'/>" + more + "</bsdf>";
  };
  const std::string brushed =
      "<float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.4'/>"
      "<rgb name='diffuse_reflectance' value='0.1'/>"
      "<rgb name='specular_reflectance' value='0.9 0.5 0.2'/>";
  all.push_back({.name = "ward", .xml = "<bsdf type='ward'/>", .least_albedo = 0.5});
  all.push_back({.name = "ward_balanced_brushed", .xml = ward("balanced", brushed)});
  all.push_back({.name = "ward_duer_brushed",
                 .xml = ward("ward-duer", brushed),
                 .most_albedo = 1e9,
                 .why_more = "its albedo has no bound at grazing angles"});
  all.push_back({.name = "ward_original_brushed",
                 .xml = ward("ward", brushed),
                 .most_albedo = 1e9,
                 .why_more = "its albedo has no bound at grazing angles"});
  all.push_back({.name = "ward_narrow", .xml = ward("balanced", "<float name='alpha' value='0.02'/>")});

  const auto disney = [](const std::string& plugin, const std::string& parameters) {
    std::string xml = "<bsdf type='" + plugin + "'>";
    std::istringstream in(parameters);
    for (std::string name, value; in >> name >> value;)
      xml += (name == "base_color" ? "<rgb name='" : "<float name='") + name + "' value='" + value + "'/>";
    return xml + "</bsdf>";
  };
  const auto principled = [&](const std::string& parameters) { return disney("principled", parameters); };
  const std::string added = "its lobes are added";
  all.push_back({.name = "principled", .xml = principled("")});
  all.push_back({.name = "principled_metal",
                 .xml = principled("metallic 1 roughness 0.4 anisotropic 0.7 base_color 0.9,0.6,0.2")});
  all.push_back({.name = "principled_narrow", .xml = principled("metallic 0.8 roughness 0.12")});
  all.push_back({.name = "principled_cloth",
                 .xml = principled("base_color 0.7,0.1,0.3 sheen 1 sheen_tint 0.6 roughness 0.9 flatness 0.7 "
                                   "spec_tint 0.8"),
                 .most_albedo = 2,
                 .why_more = added});
  all.push_back({.name = "principled_coated",
                 .xml = principled("clearcoat 1 clearcoat_gloss 0 metallic 0.3 specular 0.8 "
                                   "clearcoat_sampling_rate 2 main_specular_sampling_rate 0"),
                 .most_albedo = 2,
                 .why_more = added});
  all.push_back(
      {.name = "principled_coat_alone",
       .xml = principled("clearcoat 1 clearcoat_gloss 0.5 metallic 1 main_specular_sampling_rate 0"),
       .most_albedo = 2,
       .why_more = added});
  all.push_back({.name = "principled_glass",
                 .xml = principled("spec_trans 1 roughness 0.5 eta 1.5 base_color 1,0.8,0.5"),
                 .eta = 1.5});
  all.push_back({.name = "principled_mixed",
                 .xml = principled("spec_trans 0.5 metallic 0.2 roughness 0.6 anisotropic 0.5 spec_tint 0.4 "
                                   "clearcoat 0.5 sheen 0.3 eta 1.33 base_color 0.3,0.8,0.6"),
                 .eta = 1.33,
                 .most_albedo = 2,
                 .why_more = added});
  all.push_back({.name = "principled_denser_outside",
                 .xml = principled("spec_trans 1 roughness 0.4 eta 0.7"),
                 .eta = 0.7});
  all.push_back({.name = "principled_black",
                 .xml = principled("base_color 0,0,0 spec_tint 1 sheen 1 sheen_tint 1"),
                 .most_albedo = 2,
                 .why_more = added});
  const auto thin = [&](const std::string& name, const std::string& parameters, double most_albedo = 1) {
    all.push_back({.name = "principledthin_" + name,
                   .xml = disney("principledthin", parameters),
                   .not_reciprocal = "light that grazes is cut by its own direction",
                   .most_albedo = most_albedo,
                   .why_more = most_albedo > 1 ? added : std::string()});
  };
  thin("default", "");
  thin("passing", "diff_trans 1.2 base_color 0.9,0.5,0.2");
  thin("opposite", "diff_trans 2 base_color 0.9,0.5,0.2");
  thin("clear", "spec_trans 1 roughness 0.3 eta 1.5");
  thin("clear_brushed",
       "spec_trans 1 roughness 0.4 anisotropic 0.8 eta 1.3 spec_tint 0.7 base_color 0.8,0.3,0.2");
  thin("thinner_inside", "spec_trans 0.8 roughness 0.5 eta 0.7");
  thin("cloth", "sheen 1 sheen_tint 0.5 flatness 0.6 diff_trans 0.5 roughness 0.8", 2);
  thin("mixed",
       "spec_trans 0.5 diff_trans 1 roughness 0.4 base_color 0.3,0.8,0.6 sheen 0.2 spec_tint 0.3 "
       "specular_reflectance_sampling_rate 2 diffuse_transmittance_sampling_rate 0",
       2);
  return all;
}

const proofs::FilmsDecide kBits({"BsdfProof"});

class BsdfProof : public testing::TestWithParam<BsdfConfiguration> {};

// Claims, for directions from normal to grazing on both sides, in both modes, and for the walk back:
// sample() has the density pdf_solid_angle() states and chooses delta lobes with `prob` (chi-squared over
// bins of the sphere, the delta lobes and the refusals); density and probabilities add up to at most 1;
// weights are value over density; values are reciprocal and each mode the adjoint of the other; no light is
// made; prob_reverse is what sampling backwards finds; passthrough() is what straight samples carry; eta, the
// flags and the facts are true; nothing is NaN, infinite or negative whatever the directions.
TEST_P(BsdfProof, Holds) {
  static_cast<void>(prove_bsdf(GetParam(), kFalseAlarm / kMaxTests));
}

INSTANTIATE_TEST_SUITE_P(All, BsdfProof, testing::ValuesIn(configurations()),
                         [](const auto& tested) { return tested.param.name; });

TEST(BsdfProofs, ShareTheFalseAlarmRate) {
  // 2 modes, at most 4 ways back each, 8 directions and more.
  double most = 0;
  for (const BsdfConfiguration& c : configurations())
    most += 2 * 5 * 2 * (4 + static_cast<double>(c.more_cosines.size()));
  EXPECT_LE(most, kMaxTests);
}

}  // namespace
}  // namespace candela::test
