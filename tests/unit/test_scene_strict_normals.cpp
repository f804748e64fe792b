// The scene's strict_normals: what the bsdfs of a surface with shading normals lose by it, and what they
// keep.
#include <gtest/gtest.h>

#include <string>

#include "scene_fixture.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::uniform_direction;

// A square at z = 3 that faces the camera; its shading normal leans by 53 degrees.
constexpr const char* kSquare =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "property float nx\nproperty float ny\nproperty float nz\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n"
    "-9 -9 3 0.8 0 -0.6\n-9 9 3 0.8 0 -0.6\n9 9 3 0.8 0 -0.6\n9 -9 3 0.8 0 -0.6\n4 0 1 2 3\n";

std::unique_ptr<Scene> square(const std::string& bsdf, const std::string& strict) {
  auto scene = build_scene("<integrator type='path'>" + strict +
                               "</integrator><shape type='ply'><string name='filename' value='s.ply'/>" +
                               bsdf + "</shape>",
                           {{"s.ply", kSquare}});
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return scene.ok() ? std::move(*scene) : nullptr;
}

std::string strict(const std::string& value) {
  return "<boolean name='strict_normals' value='" + value + "'/>";
}

SurfaceHit met(const Scene& scene, Vec3 direction) {
  SurfaceHit hit;
  EXPECT_TRUE(scene.intersect({{0, 0, 0}, normalize(direction)}, hit));
  return hit;
}

// Claim: f is the bsdf's own where both directions lie on one side of both planes each, and zero elsewhere;
// without the parameter, or with false, it is the bsdf's own everywhere.
TEST(StrictNormals, LightThatPassesByShadingNormalsIsDropped) {
  for (const std::string bsdf :
       {"<bsdf type='diffuse'/>", "<bsdf type='twosided'><bsdf type='roughplastic'/></bsdf>",
        "<bsdf type='roughdielectric'><float name='alpha' value='0.6'/></bsdf>"}) {
    const auto with = square(bsdf, strict("true"));
    const auto without = square(bsdf, strict("false"));
    const auto absent = square(bsdf, "");
    ASSERT_TRUE(with && without && absent);
    const SurfaceHit hit = met(*with, {0.1f, 0.2f, 1});
    ASSERT_LT(dot(hit.ng, hit.shading.n), 0.7f);
    rng::Stream stream(11);
    int kept = 0, dropped = 0;
    for (int i = 0; i < 4000; ++i) {
      const Vec3 wo_world = uniform_direction(stream), wi_world = uniform_direction(stream);
      const Vec3 wo = hit.shading.to_local(wo_world), wi = hit.shading.to_local(wi_world);
      const TransportMode mode = i % 2 == 0 ? TransportMode::radiance : TransportMode::importance;
      const auto value = [&](const Scene& scene, float& pdf) {
        ClosureArena arena;
        return scene.closure(hit, wo, arena).eval_pdf(wo, wi, mode, pdf);
      };
      float pdf = 0, own_pdf = 0, absent_pdf = 0;
      const Spectrum f = value(*with, pdf), own = value(*without, own_pdf);
      EXPECT_EQ(own, value(*absent, absent_pdf));
      const bool agree = dot(wo_world, hit.ng) * wo.z > 1e-6f && dot(wi_world, hit.ng) * wi.z > 1e-6f;
      const bool disagree = dot(wo_world, hit.ng) * wo.z < -1e-6f || dot(wi_world, hit.ng) * wi.z < -1e-6f;
      if (agree) {
        EXPECT_EQ(f, own);
        EXPECT_EQ(pdf, own_pdf);
        kept += own.is_black() ? 0 : 1;
      } else if (disagree) {
        EXPECT_TRUE(f.is_black());
        EXPECT_EQ(pdf, 0);
        dropped += own.is_black() ? 0 : 1;
      }
    }
    EXPECT_GT(kept, 100) << bsdf;
    EXPECT_GT(dropped, 100) << bsdf;
  }
}

// Claim: what passes straight on is the same, from all sides, by passthrough() and by samples.
TEST(StrictNormals, StraightLightStays) {
  const auto scene = square(
      "<bsdf type='mask'><float name='opacity' value='0.25'/><bsdf type='diffuse'/></bsdf>", strict("true"));
  ASSERT_TRUE(scene);
  const SurfaceHit hit = met(*scene, {0.1f, 0.2f, 1});
  rng::Stream stream(12);
  int passed = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wo_world = uniform_direction(stream);
    const Vec3 wo = hit.shading.to_local(wo_world);
    EXPECT_EQ(scene->passthrough(hit, wo_world), Spectrum(0.75f));
    ClosureArena arena;
    BsdfSample sample;
    const float lobe = stream.next_float(), x = stream.next_float();
    if (scene->closure(hit, wo, arena)
            .sample(wo, lobe, {x, stream.next_float()}, TransportMode::radiance, sample) &&
        sample.passthrough) {
      ++passed;
      EXPECT_EQ(sample.wi, -wo);
    }
  }
  EXPECT_NEAR(passed, 1500, 120);  // six standard deviations
}

// Claim: of an integrator whose parameters nobody has checked, a value that is no flag is not read as one.
TEST(StrictNormals, OtherValuesAreNoFlag) {
  const auto scene = build_scene(
      "<integrator type='photonmapper'><string name='strict_normals' value='true'/></integrator>"
      "<shape type='ply'><string name='filename' value='s.ply'/></shape>",
      {{"s.ply", kSquare}});
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const SurfaceHit hit = met(**scene, {0, 0, 1});
  ClosureArena arena;
  const Vec3 wo = hit.shading.to_local({0, 0, -1});
  const Vec3 wi = hit.shading.to_local(normalize(Vec3{1, 0, 0.5f}));  // above the leaning plane alone
  ASSERT_GT(wi.z, 0);
  EXPECT_FALSE((*scene)->closure(hit, wo, arena).eval(wo, wi, TransportMode::radiance).is_black());
}

}  // namespace
}  // namespace candela::scene
