// Bump and normal maps: what the turned frame must be, from numbers one can work out by hand, and that both
// modes of transport speak of the same f.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "scene_fixture.h"
#include "worker/core/math.h"
#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::scene {
namespace {

using test::uniform_direction;

// A bsdf from its XML, over an image 'map.pfm' if there is one.
struct Built {
  test::TextFiles files;
  TextureStore textures;
  std::optional<Bsdf> bsdf;
  std::string error;
  Built(const std::string& xml, const std::string& map, const std::string& version)
      : files({{"scene.xml",
                fmt::format("<scene version='{}'><sensor type='perspective'/><shape type='sphere'>{}"
                            "</shape></scene>",
                            version, xml)},
               {"map.pfm", map}}),
        textures(files) {
    const auto parsed = description::parse_scene(files, "scene.xml", {});
    if (!parsed.ok()) {
      error = parsed.error().to_string();
      return;
    }
    for (const auto& shape : parsed->scene->children_of("shape")) {
      auto built = Bsdf::build(*shape->children_of("bsdf").at(0), textures);
      if (built.ok()) {
        bsdf = std::move(*built);
      } else {
        error = built.error().to_string();
      }
    }
  }
};
std::unique_ptr<Built> build(const std::string& xml, const std::string& map = "",
                             const std::string& version = "3.0.0") {
  auto built = std::make_unique<Built>(xml, map, version);
  EXPECT_TRUE(built->bsdf) << built->error;
  return built;
}

// A float image of one channel, rows from the top.
std::string pfm(int width, int height, const std::vector<float>& values) {
  std::string out = fmt::format("Pf\n{} {}\n-1.0\n", width, height);
  for (int row = height - 1; row >= 0; --row) {
    for (int x = 0; x < width; ++x) {
      char bytes[4];
      std::memcpy(bytes, &values[static_cast<std::size_t>(row * width + x)], 4);
      out.append(bytes, 4);
    }
  }
  return out;
}
// h(u, v) = u: texels' centres at (x + 1/2) / width; inside of them the gradient is (1, 0).
std::string ramp(float height = 1) {
  return pfm(4, 1, {height / 8, height * 3 / 8, height * 5 / 8, height * 7 / 8});
}
const std::string kRampTexture =
    "<texture type='bitmap'><string name='filename' value='map.pfm'/><boolean name='raw' "
    "value='true'/></texture>";

SurfaceHit hit_at(Vec2 uv, Vec3 dp_du = {1, 0, 0}, Vec3 dp_dv = {0, 1, 0}) {
  SurfaceHit hit;
  hit.ng = {0, 0, 1};
  hit.shading = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  hit.uv = uv;
  hit.dp_du = dp_du;
  hit.dp_dv = dp_dv;
  return hit;
}

struct Prepared {
  ClosureArena arena;
  Closure closure;
  Prepared(const Bsdf& bsdf, const SurfaceHit& hit, Vec3 wo) { bsdf.prepare(hit, wo, arena, closure); }
};

std::string normal_map(Vec3 n, const std::string& nested, const std::string& options = "") {
  return fmt::format("<bsdf type='normalmap'><rgb name='normalmap' value='{} {} {}'/>{}{}</bsdf>",
                     0.5 + 0.5 * n.x, 0.5 + 0.5 * n.y, 0.5 + 0.5 * n.z, options, nested);
}
const std::string kPlain =
    "<boolean name='flip_invalid_normals' value='false'/><boolean name='use_shadowing_function' "
    "value='false'/>";
const std::string kRough =
    "<bsdf type='roughconductor'><float name='alpha_u' value='0.1'/><float name='alpha_v' "
    "value='0.4'/></bsdf>";

Vec3 upper(rng::Stream& stream) {
  Vec3 w = uniform_direction(stream);
  w.z = std::abs(w.z);
  return w;
}

// Claim: a map of the unchanged normal and a flat displacement change nothing.
TEST(PerturbedBsdf, FlatMapsChangeNothing) {
  const auto plain = build(kRough);
  const std::vector<std::unique_ptr<Built>> flat = [] {
    std::vector<std::unique_ptr<Built>> all;
    all.push_back(build(normal_map({0, 0, 1}, kRough)));
    all.push_back(
        build("<bsdf type='bumpmap'>" + kRampTexture + kRough + "</bsdf>", pfm(2, 2, {3, 3, 3, 3})));
    all.push_back(build(
        "<bsdf type='bumpmap'><float name='scale' value='0'/>" + kRampTexture + kRough + "</bsdf>", ramp()));
    return all;
  }();
  rng::Stream stream(rng::key(41));
  for (int i = 0; i < 500; ++i) {
    const Vec3 wo = upper(stream);
    const Vec3 wi = upper(stream);
    const Vec2 u = {stream.next_float(), stream.next_float()};
    const Prepared reference(*plain->bsdf, hit_at({0.4f, 0.5f}), wo);
    for (const auto& built : flat) {
      const Prepared p(*built->bsdf, hit_at({0.4f, 0.5f}), wo);
      float pdf = 0;
      float expected_pdf = 0;
      const Spectrum f = p.closure.eval_pdf(wo, wi, TransportMode::radiance, pdf);
      EXPECT_EQ(f, reference.closure.eval_pdf(wo, wi, TransportMode::radiance, expected_pdf));
      EXPECT_EQ(pdf, expected_pdf);
      BsdfSample a;
      BsdfSample b;
      const bool valid = p.closure.sample(wo, 0.3f, u, TransportMode::radiance, a);
      ASSERT_EQ(valid, reference.closure.sample(wo, 0.3f, u, TransportMode::radiance, b));
      if (!valid) continue;
      EXPECT_LT(length(a.wi - b.wi), 1e-6f);
      EXPECT_EQ(a.weight, b.weight);
    }
  }
}

// Claim: where the surface is h(u, v) = k u above the plane, the shading is that of the tilted plane with
// normal (-k, 0, 1), tangent along (1, 0, k); in units of the surface, so that dp/du of length 2 halves the
// slope; and `scale` multiplies k.
TEST(PerturbedBsdf, RampIsTiltedPlane) {
  const auto plain = build(kRough);
  struct Case {
    double scale;
    Vec3 dp_du;
    double slope;
  };
  for (const Case& c :
       {Case{1, {1, 0, 0}, 1}, Case{0.5, {1, 0, 0}, 0.5}, Case{1, {2, 0, 0}, 0.5},
        Case{-0.25, {1, 0, 0}, -0.25}, Case{1e-12, {2e-12f, 0, 0}, 0.5}, Case{1, {1, 0, 0.3f}, 1}}) {
    const auto bumped =
        build(fmt::format("<bsdf type='bumpmap'><float name='scale' value='{}'/>{}{}{}</bsdf>", c.scale,
                          kPlain, kRampTexture, kRough),
              ramp());
    const Vec3 n = Vec3(normalize(Vec3d{-c.slope, 0, 1}));
    const Frame tilted = {{n.z, 0, -n.x}, {0, 1, 0}, n};
    rng::Stream stream(rng::key(42));
    for (int i = 0; i < 200; ++i) {
      const Vec3 wo = upper(stream);
      const Vec3 wi = upper(stream);
      const Prepared p(*bumped->bsdf, hit_at({0.4f, 0.5f}, c.dp_du, Vec3{0, c.dp_du.x, 0}), wo);
      const Prepared reference(*plain->bsdf, hit_at({0.4f, 0.5f}), {0, 0, 1});
      const Vec3 o = tilted.to_local(wo);
      const Vec3 in = tilted.to_local(wi);
      float pdf = 0;
      float expected_pdf = 0;
      const Spectrum f = p.closure.eval_pdf(wo, wi, TransportMode::radiance, pdf);
      Spectrum expected;
      if (o.z > 0 && in.z > 0)
        expected = reference.closure.eval_pdf(o, in, TransportMode::radiance, expected_pdf);
      EXPECT_NEAR(f.g, expected.g, 1e-4f * expected.g + 1e-6f) << c.scale << " " << c.dp_du.x;
      EXPECT_NEAR(pdf, expected_pdf, 1e-4f * expected_pdf + 1e-6f);
    }
  }
}

// Claim: a mirrored parameterisation (dp/du x dp/dv against the normal) tilts to the same side in space, and
// the frame stays right-handed.
TEST(PerturbedBsdf, MirroredParameterisation) {
  const auto bumped =
      build("<bsdf type='bumpmap'>" + kPlain + kRampTexture + "<bsdf type='diffuse'/></bsdf>", ramp());
  const Prepared p(*bumped->bsdf, hit_at({0.4f, 0.5f}), {0, 0, 1});
  const Prepared q(*bumped->bsdf, hit_at({0.4f, 0.5f}, {1, 0, 0}, {0, -1, 0}), {0, 0, 1});
  for (const Prepared* each : {&p, &q}) {
    const Frame& f = each->closure.get<PerturbedClosure>().frame;
    EXPECT_NEAR(f.n.x, -std::sqrt(0.5f), 1e-6f);
    EXPECT_NEAR(f.n.z, std::sqrt(0.5f), 1e-6f);
    EXPECT_LT(length(cross(f.s, f.t) - f.n), 1e-6f);
  }
}

// Claim: a diffuse surface under a normal map reflects as Lambert's law says of the turned normal, attenuated
// as Estevez et al. have it; with flipping, a viewer behind the normal sees the mirrored one.
TEST(PerturbedBsdf, NormalMapByHand) {
  const Vec3 n = normalize(Vec3{0.6f, -0.2f, 0.5f});
  const std::string white = "<bsdf type='diffuse'><rgb name='reflectance' value='1'/></bsdf>";
  const auto full = build(normal_map(n, white));
  const auto bare = build(normal_map(n, white, kPlain));
  const float alpha2 = std::min(1.0f, (1 - n.z * n.z) / (8 * n.z * n.z));
  const Vec3 mirrored = {-n.x, -n.y, n.z};
  rng::Stream stream(rng::key(43));
  int behind = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wo = upper(stream);
    const Vec3 wi = upper(stream);
    const bool flips = dot(wo, n) <= 0;
    behind += flips ? 1 : 0;
    const float tan2 = (1 - wi.z * wi.z) / (wi.z * wi.z);
    const float shadow = 2 / (1 + std::sqrt(1 + alpha2 * tan2));
    const float expected = std::max(0.0f, dot(wi, flips ? mirrored : n)) * math::kInvPi * shadow;
    const Prepared p(*full->bsdf, hit_at({0, 0}), wo);
    EXPECT_NEAR(p.closure.eval(wo, wi, TransportMode::radiance).g, expected, 2e-6f);
    const Prepared q(*bare->bsdf, hit_at({0, 0}), wo);
    const float lambert = flips ? 0.0f : std::max(0.0f, dot(wi, n)) * math::kInvPi;
    EXPECT_NEAR(q.closure.eval(wo, wi, TransportMode::radiance).g, lambert, 1e-6f);
  }
  EXPECT_GT(behind, 200);
}

// Claim: what a walk from the light sees is what a walk from the eye sees with the roles exchanged: f(wo, wi)
// in importance mode = f(wi, wo) in radiance mode, flips and shadows included;
// the adjoint's sampling estimates it without bias: for 40 light directions the mean weight is the integral
// of the value within 6 standard errors (false alarm 1e-7).
TEST(PerturbedBsdf, AdjointIsExact) {
  const Vec3 n = normalize(Vec3{0.6f, -0.2f, 0.5f});
  const auto built = build(normal_map(n, "<bsdf type='diffuse'><rgb name='reflectance' value='1'/></bsdf>"));
  rng::Stream stream(rng::key(44));
  for (int i = 0; i < 2000; ++i) {
    const Vec3 wo = upper(stream);
    const Vec3 wi = upper(stream);
    const Prepared from_light(*built->bsdf, hit_at({0, 0}), wo);
    const Prepared from_eye(*built->bsdf, hit_at({0, 0}), wi);
    if (wo.z < 1e-3f || wi.z < 1e-3f) continue;
    const float a = from_light.closure.eval(wo, wi, TransportMode::importance).g / wi.z;
    const float b = from_eye.closure.eval(wi, wo, TransportMode::radiance).g / wo.z;
    EXPECT_NEAR(a, b, 1e-4f * b + 1e-6f);
  }
  for (int k = 0; k < 40; ++k) {
    const Vec3 light = upper(stream);
    const Prepared p(*built->bsdf, hit_at({0, 0}), light);
    double by_weight = 0, by_weight2 = 0, by_sphere = 0, by_sphere2 = 0;
    constexpr int kSamples = 4000;
    for (int i = 0; i < kSamples; ++i) {
      BsdfSample s;
      const float u_lobe = stream.next_float();
      const Vec2 u = {stream.next_float(), stream.next_float()};
      double w = 0;
      if (p.closure.sample(light, u_lobe, u, TransportMode::importance, s)) {
        w = static_cast<double>(s.weight.g);
        EXPECT_NEAR(s.pdf_solid_angle, p.closure.pdf_solid_angle(light, s.wi, TransportMode::importance),
                    1e-4f * s.pdf_solid_angle);
      }
      by_weight += w;
      by_weight2 += w * w;
      const Vec3 d = upper(stream);
      const double v =
          static_cast<double>(p.closure.eval(light, d, TransportMode::importance).g) * 2 * std::numbers::pi;
      by_sphere += v;
      by_sphere2 += v * v;
    }
    const double mean = by_weight / kSamples;
    const double other = by_sphere / kSamples;
    const double variance =
        (by_weight2 / kSamples - mean * mean + by_sphere2 / kSamples - other * other) / kSamples;
    EXPECT_NEAR(mean, other, 6 * std::sqrt(variance) + 1e-5);
  }
}

// Claim: no light is made: every weight of a white diffuse surface or perfect mirror is at most 1.
TEST(PerturbedBsdf, NoWeightAboveOne) {
  rng::Stream stream(rng::key(45));
  for (const std::string& nested :
       {std::string("<bsdf type='diffuse'><rgb name='reflectance' value='1'/></bsdf>"),
        std::string("<bsdf type='conductor'/>"), std::string("<bsdf type='roughconductor'/>")}) {
    for (const Vec3 n :
         {Vec3{0.3f, 0, 0.9f}, Vec3{-0.7f, 0.5f, 0.2f}, Vec3{0, 0.9f, -0.4f}, Vec3{0, 0, 0}, Vec3{1, 0, 0}}) {
      const auto built = build("<bsdf type='twosided'>" + normal_map(n, nested) + "</bsdf>");
      for (int i = 0; i < 2000; ++i) {
        const Vec3 wo = uniform_direction(stream);
        const Prepared p(*built->bsdf, hit_at({0, 0}), wo);
        BsdfSample s;
        const float u_lobe = stream.next_float();
        const Vec2 u = {stream.next_float(), stream.next_float()};
        if (p.closure.black || !p.closure.sample(wo, u_lobe, u, TransportMode::radiance, s)) continue;
        EXPECT_LE(s.weight.max_component(), 1.00001f);
        EXPECT_GT(s.wi.z * wo.z, 0);
        EXPECT_NEAR(length(s.wi), 1, 1e-5f);
      }
    }
  }
}

// Claim: through a whole scene: a rectangle of 4 x 4 (u along x, half a unit per unit of u is a slope of
// 1/8), turned in space and mirrored, has the normal of the displaced surface; a sphere's map is read at its
// uv.
TEST(PerturbedBsdf, ThroughAScene) {
  const std::string map = "<bsdf type='bumpmap'><float name='scale' value='0.5'/>" + kPlain + kRampTexture +
                          "<bsdf type='twosided'><bsdf type='diffuse'/></bsdf></bsdf>";
  for (const double side : {1.0, -1.0}) {
    // Columns: x of the rectangle along +-x of the world, y along y, its normal towards the camera (-z).
    const auto built = test::build_scene(
        "<shape type='rectangle'>" + test::matrix({2 * side, 0, 0, 0, 0, 2, 0, 0, 0, 0, -1, 5, 0, 0, 0, 1}) +
            map + "</shape>",
        {{"map.pfm", ramp()}});
    ASSERT_TRUE(built.ok()) << built.error().to_string();
    SurfaceHit hit;
    ASSERT_TRUE((*built)->intersect({{-0.4f, 0.3f, 0}, {0, 0, 1}}, hit));
    ClosureArena arena;
    const Closure closure = (*built)->closure(hit, hit.shading.to_local({0, 0, -1}), arena);
    ASSERT_TRUE(closure.is<PerturbedClosure>());
    const Vec3 n = hit.shading.to_world(closure.get<PerturbedClosure>().frame.n);
    // The surface rises towards -z as u grows, along +-x.
    const Vec3d expected = normalize(Vec3d{-0.125 * side, 0, -1});
    EXPECT_NEAR(n.x, expected.x, 1e-5);
    EXPECT_NEAR(n.y, 0, 1e-5);
    EXPECT_NEAR(n.z, expected.z, 1e-5);
  }
}

// Claim: facts and errors; 0.6 knows neither flips nor shadows.
TEST(PerturbedBsdf, BuildsOnlyWhatHasMeaning) {
  const auto inside = build(
      "<bsdf type='bumpmap'><texture name='anything' type='checkerboard'/><bsdf type='twosided'>"
      "<bsdf type='diffuse'/></bsdf></bsdf>");
  const BsdfFacts facts = inside->bsdf->facts();
  EXPECT_TRUE(facts.reads_partials && facts.two_sided && facts.smooth && !facts.delta);
  EXPECT_FALSE(build(normal_map({0, 0, 1}, "<bsdf type='diffuse'/>"))->bsdf->facts().reads_partials);
  const auto old =
      build("<bsdf type='bumpmap'><texture type='checkerboard'/><bsdf type='diffuse'/></bsdf>", "", "0.6.0");
  const Prepared p(*old->bsdf, hit_at({0, 0}), {0, 0, 1});
  EXPECT_FALSE(p.closure.get<PerturbedClosure>().flips);

  const auto error = [](const std::string& xml) { return Built(xml, "", "3.0.0").error; };
  EXPECT_NE(error("<bsdf type='bumpmap'><bsdf type='diffuse'/></bsdf>").find("lacks a texture"),
            std::string::npos);
  EXPECT_NE(
      error("<bsdf type='normalmap'><bsdf type='diffuse'/></bsdf>").find("lacks the parameter 'normalmap'"),
      std::string::npos);
  EXPECT_NE(error("<bsdf type='bumpmap'><texture type='checkerboard'/><texture name='b' type='checkerboard'/>"
                  "<bsdf type='diffuse'/></bsdf>")
                .find("more than one texture"),
            std::string::npos);
  EXPECT_NE(error("<bsdf type='bumpmap'><texture type='checkerboard'/></bsdf>").find("needs one bsdf, not 0"),
            std::string::npos);
  EXPECT_NE(error(normal_map({0, 0, 1}, normal_map({0, 0, 1}, "<bsdf type='diffuse'/>")))
                .find("inside bsdf 'normalmap' is not supported"),
            std::string::npos);
  EXPECT_NE(error("<bsdf type='twosided'>" + normal_map({0, 0, 1}, "<bsdf type='dielectric'/>") + "</bsdf>")
                .find("let no light through"),
            std::string::npos);
}

}  // namespace
}  // namespace candela::scene
