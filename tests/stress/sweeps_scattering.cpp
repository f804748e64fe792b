// Near-delta and index-matched scattering, grazing and critical angles, shading normals.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

constexpr double kPi = std::numbers::pi;

// The albedo at normal incidence of a rough perfect mirror with one reflection, by quadrature over the slopes
// of its microfacets: a slope p reflects to the angle 2 atan p, of which Smith's term lets G1 pass.
double mirror_albedo(double alpha, bool ggx) {
  constexpr int kSteps = 200000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    // Equal shares of the distribution of slopes, by its inverse.
    const double u = (i + 0.5) / kSteps;
    const double slope = alpha * (ggx ? std::sqrt(u / (1 - u)) : std::sqrt(-std::log1p(-u)));
    if (slope >= 1) continue;  // goes below the horizon
    const double tangent = 2 * slope / (1 - slope * slope);
    if (ggx) {
      sum += 2 / (1 + std::sqrt(1 + alpha * alpha * tangent * tangent));
    } else {
      const double a = 1 / (alpha * tangent);
      sum += 2 / (1 + std::erf(a) + std::exp(-a * a) / (a * std::sqrt(kPi)));
    }
  }
  return sum / kSteps;
}

const std::vector<double> kRoughness = {1, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4};

Sweep rough_mirror(bool ggx) {
  Sweep sweep;
  sweep.name = ggx ? "rough-mirror-ggx" : "rough-mirror";
  sweep.hazard = "near-delta scattering";
  sweep.parameter = ggx ? "roughness (GGX)" : "roughness (Beckmann)";
  sweep.holds = "perfect mirror under a constant sky: its albedo, by quadrature";
  sweep.values = kRoughness;
  sweep.benign = 1;
  sweep.thin = {1, 0.1, 1e-2, 1e-4};
  sweep.shot = [ggx](double value) {
    return uniform_shot(
        orthographic({0, 0, 2}, {0, 0, 0}, {0, 1, 0}, 0.5) + constant_sky(1) +
            plate("", fmt::format(R"(<bsdf type="roughconductor"><float name="alpha" value="{}"/>
                  <string name="distribution" value="{}"/></bsdf>)",
                                  value, ggx ? "ggx" : "beckmann")),
        mirror_albedo(value, ggx));
  };
  sweep.claims = claims_of(kEveryone);
  add_path_states(sweep);
  return sweep;
}

Sweep rough_glass() {
  Sweep sweep;
  sweep.name = "rough-glass";
  sweep.hazard = "near-delta scattering";
  sweep.parameter = "roughness";
  sweep.holds = "a pane of frosted glass, seen straight on, vanishes under a constant sky";
  sweep.values = {0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4};
  sweep.benign = 0.03;
  sweep.thin = {0.03, 1e-3, 1e-4};
  sweep.shot = [](double value) {
    return uniform_shot(
        orthographic({0, 0, 2}, {0, 0, 0}, {0, 1, 0}, 0.3) + constant_sky(1) +
            fmt::format(
                R"(<shape type="cube"><transform name="to_world"><scale x="2" y="2" z="0.2"/></transform>
                  <bsdf type="roughdielectric"><float name="alpha" value="{}"/><float name="int_ior" value="1.5"/>
                  <float name="ext_ior" value="1"/></bsdf></shape>)",
                value),
        1);
  };
  sweep.claims = claims_of(kEveryone);
  add_path_states(sweep);
  return sweep;
}

Sweep index_matched(bool rough) {
  Sweep sweep;
  sweep.name = rough ? "index-matched-rough" : "index-matched";
  sweep.hazard = "index-matched (eta -> 1) scattering";
  sweep.parameter = "index of refraction - 1";
  sweep.holds = rough ? "a shell of frosted glass around a matt ball vanishes"
                      : "a shell of glass around a matt ball vanishes";
  sweep.values = {1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-9, 1e-12, 0};
  sweep.benign = 1e-3;
  sweep.thin = {1e-3, 1e-6, 1e-7, 0};
  sweep.shot = [rough](double value) {
    // A convex ball under a constant sky has its reflectance times the sky's radiance everywhere.
    return uniform_shot(
        orthographic({0, 0, 3}, {0, 0, 0}, {0, 1, 0}, 0.25) + constant_sky(1) +
            sphere({0, 0, 0}, 0.5, diffuse(0.5)) +
            sphere({0, 0, 0}, 1,
                   fmt::format(R"(<bsdf type="{}dielectric">{}<float name="int_ior" value="{:.17g}"/>
                         <float name="ext_ior" value="1"/></bsdf>)",
                               rough ? "rough" : "", rough ? R"(<float name="alpha" value="0.2"/>)" : "",
                               1 + value)),
        0.5);
  };
  if (rough) {
    sweep.claims = claims_of(kEveryone);
  } else {
    sweep.claims = claims_of(everyone_but({"light"}));
    sweep.excuses = {{"light", "sees nothing through smooth glass"}};
  }
  return sweep;
}

// A camera of parallel rays that meets the plane z = 0 at the origin under an angle of this cosine.
std::string slanting_camera(double cosine) {
  const double sine = std::sqrt(1 - cosine * cosine);
  return orthographic({10 * sine, 0, 10 * cosine}, {0, 0, 0}, {0, 1, 0}, 2 * cosine, 10);
}

Sweep grazing(bool glass) {
  Sweep sweep;
  sweep.name = glass ? "grazing-glass" : "grazing-matt";
  sweep.hazard = "grazing angles";
  sweep.parameter = "cosine of the angle of incidence";
  sweep.holds = glass ? "a slab of glass vanishes under a constant sky"
                      : "a matt plane under a constant sky has its reflectance";
  sweep.values = {1, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6};
  sweep.benign = 1;
  sweep.thin = {1, 1e-3, 1e-6};
  sweep.shot = [glass](double value) {
    return uniform_shot(slanting_camera(value) + constant_sky(1) +
                            (glass ? R"(<shape type="cube"><transform name="to_world"><translate z="-1"/>
                             <scale x="1000" y="1000" z="1"/></transform><bsdf type="dielectric"/></shape>)"
                                   : plate("<scale value=\"30\"/>", diffuse(0.5))),
                        glass ? 1 : 0.5);
  };
  if (glass) {
    sweep.claims = claims_of(everyone_but({"light"}));
    sweep.excuses = {{"light", "sees nothing through smooth glass"}};
  } else {
    sweep.claims = claims_of(kEveryone);
  }
  add_path_states(sweep);
  return sweep;
}

Sweep critical_angle() {
  Sweep sweep;
  sweep.name = "critical-angle";
  sweep.hazard = "total internal reflection";
  sweep.parameter =
      "relative distance of the index from the one at which a side of a block turns into a mirror";
  sweep.holds = "a block of glass vanishes under a constant sky";
  sweep.values = {-0.1, -1e-3, -1e-5, -1e-7, 0, 1e-7, 1e-5, 1e-3, 0.1};
  sweep.benign = 0;
  sweep.thin = {-1e-3, -1e-7, 0, 1e-7, 1e-3};
  sweep.shot = [](double value) {
    // Seen under 60 degrees, light inside meets the sides at the critical angle for index^2 = 1 + sin^2 60.
    const double sine = std::sqrt(0.75);
    return uniform_shot(
        orthographic({0.9 + 3 * sine, 0, 1 + 1.5}, {0.9, 0, 1}, {0, 1, 0}, 0.05) + constant_sky(1) +
            fmt::format(R"(<shape type="cube"><bsdf type="dielectric"><float name="int_ior" value="{:.17g}"/>
                  <float name="ext_ior" value="1"/></bsdf></shape>)",
                        std::sqrt(1.75) * (1 + value)),
        1);
  };
  sweep.claims = claims_of(everyone_but({"light"}));
  sweep.excuses = {{"light", "sees nothing through smooth glass"}};
  add_path_states(sweep);
  return sweep;
}

// [-1, 1]^2 in the plane z = 0 with one shading normal everywhere.
std::string tilted_mesh(double degrees) {
  const double nx = std::sin(degrees * kPi / 180), nz = std::cos(degrees * kPi / 180);
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\nelement face 2\n"
      "property list uchar int vertex_indices\nend_header\n";
  for (const auto& [x, y] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)})
    text += fmt::format("{} {} 0 {} 0 {}\n", x, y, nx, nz);
  return text + "3 0 1 2\n3 0 2 3\n";
}

Sweep shading_normal(bool grazing_light) {
  Sweep sweep;
  sweep.name = grazing_light ? "shading-grazing" : "shading-tilt";
  sweep.hazard = "shading-normal adjoints";
  sweep.parameter = grazing_light ? "cosine of parallel light with the true normal"
                                  : "degrees between the true and the shading normal";
  sweep.holds = "a matt plane in parallel light: reflectance / pi times the cosine with the shading normal";
  sweep.values = grazing_light ? std::vector<double>{1, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4}
                               : std::vector<double>{0, 30, 60, 75, 85, 89, 89.9};
  sweep.benign = sweep.values.front();
  sweep.thin = grazing_light ? std::vector<double>{1, 0.1, 0.01} : std::vector<double>{0, 60, 85, 89};
  sweep.shot = [grazing_light](double value) {
    const double tilt = grazing_light ? 45 : value, cosine = grazing_light ? value : 1;
    const double sine = std::sqrt(1 - cosine * cosine);  // the light comes from the side of the normal
    const double angle = tilt * kPi / 180;
    Shot shot = uniform_shot(
        orthographic({0, 0, 2}, {0, 0, 0}, {0, 1, 0}, 0.5) +
            fmt::format(
                R"(<emitter type="directional"><vector name="direction" value="{}"/><rgb name="irradiance" value="1"/></emitter>
          <shape type="ply"><string name="filename" value="plate.ply"/>{}</shape>)",
                triple({-sine, 0, -cosine}), diffuse(0.5)),
        0.5 / kPi * (std::sin(angle) * sine + std::cos(angle) * cosine));
    shot.files["plate.ply"] = tilted_mesh(tilt);
    return shot;
  };
  sweep.claims = claims_of(kEveryone);
  return sweep;
}

}  // namespace

std::vector<Sweep> scattering_sweeps() {
  return {rough_mirror(false),   rough_mirror(true),  rough_glass(), index_matched(false),
          index_matched(true),   grazing(false),      grazing(true), critical_angle(),
          shading_normal(false), shading_normal(true)};
}

}  // namespace candela::stress
