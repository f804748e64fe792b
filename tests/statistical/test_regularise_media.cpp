// Mollified connections in media: the other end of a mollified edge is a place in a medium, or a medium lies
// in between. Single scattering against quadrature. [regularisation note, section 10]
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <string>

#include "tests/proofs/proofs.h"
#include "tests/regularised_scenes.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/moments.h"
#include "worker/scene/features.h"

namespace candela::statistical {
namespace {

using test::camera;
using test::kMirror;
using test::mirrored;
using test::point;
using test::square;

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"RegularisedMedia"});

// A pinhole sees in mirror A (at the origin) the x axis, of which a cube of fog holds a part, and mirror B
// sends the light of a spot there: letters SDSDSDS, with a place in the fog for the D in the middle. Each
// edge has a length of its own, so that one is the longest.
struct FogBeam {
  double eye, near, far, lamp;  // lengths of edges: eye - A, A - fog's middle, fog's middle - B, B - lamp
  static constexpr double kHalf = 0.3, kIntensity = 5, kG = 0.4;
  static constexpr std::array kSigma{0.5, 0.9, 1.6}, kAlbedo{0.9, 0.8, 0.6};

  Vec3d middle() const { return {near, 0, 0}; }
  Vec3d at_b() const { return middle() + normalize(Vec3d(0.2, 1, 0.35)) * far; }
  Vec3d at_lamp() const { return at_b() + normalize(Vec3d(0.8, -0.3, 0.9)) * lamp; }
  Vec3d normal_b() const { return normalize(normalize(middle() - at_b()) + normalize(at_lamp() - at_b())); }

  std::string text() const {
    const Vec3d to_eye = normalize(Vec3d(0.4, -1, -0.2)), a{};
    const auto rgb = [](const std::array<double, 3>& c) {
      return fmt::format("{}, {}, {}", c[0], c[1], c[2]);
    };
    return "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" value=\"4\"/>"
           "</integrator>" +
           camera(to_eye * eye, -to_eye, 0.3) + square(a, normalize(to_eye + Vec3d(1, 0, 0)), 0.1, kMirror) +
           square(at_b(), normal_b(), 1, kMirror) +
           fmt::format(
               "<shape type=\"cube\"><transform name=\"to_world\"><scale value=\"{}\"/><translate x=\"{}\"/>"
               "</transform><bsdf type=\"null\"/><medium type=\"homogeneous\" name=\"interior\"><rgb "
               "name=\"sigma_t\" value=\"{}\"/><rgb name=\"albedo\" value=\"{}\"/><phase type=\"hg\"><float "
               "name=\"g\" value=\"{}\"/></phase></medium></shape>"
               "<emitter type=\"spot\"><rgb name=\"intensity\" value=\"{}\"/><float name=\"cutoff_angle\" "
               "value=\"10\"/><float name=\"beam_width\" value=\"9.5\"/><transform name=\"to_world\"><lookat "
               "origin=\"{}\" target=\"{}\" up=\"0.1,0.2,1\"/></transform></emitter></scene>",
               kHalf, near, rgb(kSigma), rgb(kAlbedo), kG, kIntensity, point(at_lamp()), point(at_b()));
  }

  // Length of the ray from o along d in the cube; o is in it or before it.
  double inside(Vec3d o, Vec3d d) const {
    double enter = 0, leave = std::numeric_limits<double>::max();
    const auto slab = [&](double at, double along, double middle_of) {
      if (along == 0) return;
      const double one = (middle_of - kHalf - at) / along, other = (middle_of + kHalf - at) / along;
      enter = std::max(enter, std::min(one, other));
      leave = std::min(leave, std::max(one, other));
    };
    slab(o.x, d.x, near);
    slab(o.y, d.y, 0);
    slab(o.z, d.z, 0);
    return std::max(0.0, leave - enter);
  }
  // Single scattering along the x axis, of light that comes from the lamp's image in B.
  double exact(std::size_t channel) const {
    const Vec3d image = mirrored(at_lamp(), at_b(), normal_b());
    const double sigma = kSigma[channel], scattering = sigma * kAlbedo[channel];
    constexpr int kSteps = 4000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double t = 2 * kHalf * (i + 0.5) / kSteps;
      const Vec3d p{near - kHalf + t, 0, 0}, to = image - p;
      const double distance = length(to), passed = t + inside(p, to / distance);
      // Light goes on along -to, and then along -x.
      const double cosine = to.x / distance;
      const double phase =
          (1 - kG * kG) / (4 * std::numbers::pi * std::pow(1 + kG * kG - 2 * kG * cosine, 1.5));
      sum += std::exp(-sigma * passed) * scattering * phase * kIntensity / (distance * distance);
    }
    return sum * 2 * kHalf / kSteps;
  }
};

// Claim: light that a place in a medium gets from a lamp over a mirror, and sends to the eye over another, is
// that of single scattering, if the longest edge is that from the eye's mirror to the fog, from the fog to
// the other mirror, or from that to the lamp. A place in a medium is D, its phase function is the value of
// its end, and media multiply by their transmittance. (Path tracing mollifies mirror B at the lamp alone.)
// The bias is that of the theory, -(r / l)^2 / 4. If A is mollified, its cone passes through fog that is lit
// and dimmed otherwise than the axis, which adds 0.005 at most.
TEST(RegularisedMedia, SingleScatteringBetweenMirrors) {
  struct Case {
    const char* longest;
    const char* integrator;
    FogBeam beam;
    double ratio;  // r / l
    double short_error, other_bias = 0.001;
    bool in_gate = true;
  };
  for (const Case& one : {Case{"near", "bdpt", {1, 2.4, 1.2, 1.1}, 0.05, 0.02, 0.005},
                          {"far", "bdpt", {1, 1.1, 2.4, 1.2}, 0.1, 0.02},
                          {"lamp", "bdpt", {1, 1.1, 1.2, 2.4}, 0.3, 0.06, 0.001, false},
                          {"lamp", "path", {1, 1.1, 1.2, 2.4}, 0.3, 0.06},
                          {"far", "erpt", {1, 1.1, 2.4, 1.2}, 0.1, 0.06}}) {
    if (!long_form() && !one.in_gate) continue;
    SCOPED_TRACE(fmt::format("{} {}", one.longest, one.integrator));
    const TestScene plain = scene_from_xml(one.beam.text(), 8, 8);
    const double radius = static_cast<double>(make_renderer(plain)->features()->radius);
    SettingsMap settings{{"regularise", "on"},
                         {"regularise_exponent", "0"},
                         {"regularise_radius", fmt::format("{}", one.ratio * 2.4 / radius)}};
    if (std::string(one.integrator) == "erpt") settings["direct"] = "chain";
    const TestScene scene = with_integrator(plain, one.integrator, settings);
    std::array<Moments, 3> mean;
    for (const auto& image : render_batches(scene, 4700, 16, long_form() ? 6000 : 500)) {
      std::array<double, 3> sum{};
      for (std::size_t i = 0; i < image.size(); ++i) sum[i % 3] += static_cast<double>(image[i]);
      for (std::size_t c = 0; c < 3; ++c) mean[c].add(sum[c] / (static_cast<double>(image.size()) / 3));
    }
    const double q = one.ratio * one.ratio;
    for (std::size_t c = 0; c < 3; ++c) {
      const double exact = one.beam.exact(c), error = mean[c].error() / exact;
      std::printf("%s %s channel %zu: bias %.4f +- %.4f, predicted %.4f\n", one.longest, one.integrator, c,
                  mean[c].mean() / exact - 1, error, -q / 4);
      EXPECT_NEAR(mean[c].mean() / exact - 1, -q / 4, 5 * error + q * q / 2 + one.other_bias);
      EXPECT_LT(error, one.short_error / (long_form() ? 3 : 1));
    }
  }
}

}  // namespace
}  // namespace candela::statistical
