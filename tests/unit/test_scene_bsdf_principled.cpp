// principled, phong and ward against their definitions, written out from the parameters as Mitsuba's
// documents and papers name them, without what the renderer combines before; and what builds.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>

#include "scene_fixture.h"
#include "worker/scene/bsdfs/bsdf_build.h"

namespace candela::scene {
namespace {

constexpr double kPi = std::numbers::pi;
using Rgb = std::array<double, 3>;

struct Built {
  test::TextFiles files;
  TextureStore textures;
  std::optional<Bsdf> bsdf;
  std::string error;
  explicit Built(const std::string& xml, const std::string& version = "3.0.0")
      : files({{"scene.xml",
                fmt::format("<scene version='{}'><shape type='sphere'>{}</shape></scene>", version, xml)}}),
        textures(files) {
    const auto parsed = description::parse_scene(files, "scene.xml", {});
    if (!parsed.ok()) {
      error = parsed.error().to_string();
      return;
    }
    const auto shapes = parsed->scene->children_of("shape");
    auto built = Bsdf::build(*shapes.at(0)->children_of("bsdf").at(0), textures);
    if (built.ok()) {
      bsdf = std::move(*built);
    } else {
      error = built.error().to_string();
    }
  }
  Closure prepared(Vec3 wo) {
    SurfaceHit hit;
    hit.ng = {0, 0, 1};
    hit.shading = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    ClosureArena arena;
    Closure closure;
    bsdf->prepare(hit, wo, arena, closure);
    return closure;
  }
};

struct Principled {
  Rgb base{0.5, 0.5, 0.5};
  double roughness = 0.5, anisotropic = 0, metallic = 0, spec_trans = 0, eta = 1.5, spec_tint = 0, sheen = 0,
         sheen_tint = 0, flatness = 0, clearcoat = 0, clearcoat_gloss = 0;
  std::string xml() const {
    return fmt::format(
        "<bsdf type='principled'><rgb name='base_color' value='{} {} {}'/><float name='roughness' "
        "value='{}'/>"
        "<float name='anisotropic' value='{}'/><float name='metallic' value='{}'/><float name='spec_trans' "
        "value='{}'/>"
        "<float name='eta' value='{}'/><float name='spec_tint' value='{}'/><float name='sheen' value='{}'/>"
        "<float name='sheen_tint' value='{}'/><float name='flatness' value='{}'/><float name='clearcoat' "
        "value='{}'/>"
        "<float name='clearcoat_gloss' value='{}'/></bsdf>",
        base[0], base[1], base[2], roughness, anisotropic, metallic, spec_trans, eta, spec_tint, sheen,
        sheen_tint, flatness, clearcoat, clearcoat_gloss);
  }
};

double mix(double a, double b, double t) {
  return a * (1 - t) + b * t;
}
double weight5(double c) {
  return std::pow(std::clamp(1 - c, 0.0, 1.0), 5);
}
// c: cosine on the near side; eta: far over near.
double fresnel(double c, double eta, double& cos_t) {
  const double t2 = 1 - (1 - c * c) / (eta * eta);
  if (t2 <= 0) {
    cos_t = 0;
    return 1;
  }
  cos_t = std::sqrt(t2);
  const double s = (c - eta * cos_t) / (c + eta * cos_t);
  const double p = (eta * c - cos_t) / (eta * c + cos_t);
  return (s * s + p * p) / 2;
}
double ggx_masking(Vec3d w, double ax, double ay) {
  const double tan2 = (ax * ax * w.x * w.x + ay * ay * w.y * w.y) / (w.z * w.z);
  return 2 / (1 + std::sqrt(1 + tan2));
}

// The value in radiance mode, the cosine included, of directions of unit length.
Rgb value_of(const Principled& p, Vec3d o, Vec3d i) {
  Rgb value{};
  const bool front = o.z > 0;
  const double eta = front ? p.eta : 1 / p.eta;
  const double dielectric = (1 - p.metallic) * (1 - p.spec_trans);
  const double glass = (1 - p.metallic) * p.spec_trans;
  const double aspect = std::sqrt(1 - 0.9 * p.anisotropic);
  const double ax = std::max(0.001, p.roughness * p.roughness / aspect);
  const double ay = std::max(0.001, p.roughness * p.roughness * aspect);
  const bool reflects = o.z * i.z > 0;
  Vec3d h = normalize(o + i * (reflects ? 1.0 : eta));
  if (h.z < 0) h = -h;
  const double oh = std::abs(dot(o, h));
  const double ih = std::abs(dot(i, h));
  double cos_t = 0;
  const double f = fresnel(oh, eta, cos_t);
  const double slope = h.x * h.x / (ax * ax) + h.y * h.y / (ay * ay) + h.z * h.z;
  const double d = 1 / (kPi * ax * ay * slope * slope);
  const double g = ggx_masking(o, ax, ay) * ggx_masking(i, ax, ay);
  const double luminance = 0.212671 * p.base[0] + 0.715160 * p.base[1] + 0.072169 * p.base[2];
  for (std::size_t k = 0; k < 3; ++k) {
    if (!reflects) {
      // [Walter 2007, Eq. 21], radiance over eta^2
      const double bottom = dot(o, h) + eta * dot(i, h);
      value[k] = glass * std::sqrt(p.base[k]) * (1 - f) * d * g * oh * ih / (std::abs(o.z) * bottom * bottom);
      continue;
    }
    if (!front) {
      value[k] = glass * f * d * g / (4 * std::abs(o.z));
      continue;
    }
    const double w = weight5(eta > 1 ? oh : cos_t);
    const double hue = luminance > 0 ? p.base[k] / luminance : 1;
    const double r0 = std::pow((eta - 1) / (eta + 1), 2);
    const double fresnel_all = p.metallic * mix(p.base[k], 1, w) +
                               (1 - p.metallic) * (p.spec_tint * mix(hue * r0, 1, w) + (1 - p.spec_tint) * f);
    value[k] = fresnel_all * d * g / (4 * o.z);
    const double alpha = mix(0.1, 0.001, p.clearcoat_gloss);
    const double a2 = alpha * alpha;
    const double gtr1 = (a2 - 1) / (kPi * std::log(a2) * (1 + (a2 - 1) * h.z * h.z));
    value[k] += 0.25 * p.clearcoat * mix(0.04, 1, w) * gtr1 * ggx_masking(o, 0.25, 0.25) *
                ggx_masking(i, 0.25, 0.25) * i.z;
    if (dielectric == 0) continue;
    const double wi = weight5(i.z), wo = weight5(o.z);
    const double rr = 2 * p.roughness * oh * oh;
    const double lambert = (1 - wi / 2) * (1 - wo / 2) + rr * (wi + wo + wi * wo * (rr - 1));
    const double ss = 1.25 * (mix(1, rr / 2, wi) * mix(1, rr / 2, wo) * (1 / (i.z + o.z) - 0.5) + 0.5);
    value[k] += dielectric * p.base[k] / kPi * mix(lambert, ss, p.flatness) * i.z;
    value[k] += p.sheen * (1 - p.metallic) * weight5(oh) * mix(1, hue, p.sheen_tint) * i.z;
  }
  return value;
}

Vec3d random_direction(rng::Stream& stream) {
  return normalize(Vec3d(test::uniform_direction(stream)));
}

// Claim: principled has the value of its definition for random parameters and directions, above and below,
// reflected and refracted: within 1e-3, but for peaks that a rounding of the directions shifts.
TEST(PrincipledBsdf, IsItsDefinition) {
  rng::Stream stream(rng::key(51));
  const auto number = [&] {
    const std::uint32_t choice = stream.next_u32() % 4;
    return choice == 0 ? 0.0 : choice == 1 ? 1.0 : std::round(stream.next_double() * 1000) / 1000;
  };
  int refracted = 0, below = 0;
  for (int n = 0; n < 400; ++n) {
    Principled p;
    p.base = {number(), number(), number()};
    p.roughness = std::max(0.2, number());
    for (double* each : {&p.anisotropic, &p.metallic, &p.spec_trans, &p.spec_tint, &p.sheen, &p.sheen_tint,
                         &p.flatness, &p.clearcoat, &p.clearcoat_gloss})
      *each = number();
    p.eta = n % 3 == 0 ? 0.7 : 1.1 + stream.next_double();
    Built built(p.xml());
    ASSERT_TRUE(built.bsdf) << built.error;
    for (int i = 0; i < 50; ++i) {
      const Vec3d o = random_direction(stream);
      const Closure closure = built.prepared(Vec3(o));
      Vec3d in = random_direction(stream);
      BsdfSample s;
      const float u_lobe = stream.next_float();
      const Vec2 u = {stream.next_float(), stream.next_float()};
      if (i % 2 == 0 && closure.sample(Vec3(o), u_lobe, u, TransportMode::radiance, s))
        in = normalize(Vec3d(s.wi));
      if (std::abs(in.z) < 0.01 || std::abs(o.z) < 0.01) continue;
      const Rgb expected = value_of(p, normalize(Vec3d(Vec3(o))), normalize(Vec3d(Vec3(in))));
      const Spectrum value = closure.eval(Vec3(o), Vec3(in), TransportMode::radiance);
      const bool refracts = o.z * in.z < 0;
      // Half vectors of refraction on the wrong side, and Fresnel's total reflection.
      if (refracts && value.is_black()) continue;
      refracted += refracts ? 1 : 0;
      below += o.z < 0 ? 1 : 0;
      // The clearcoat of full gloss is 0.001 wide.
      const double slack = p.clearcoat_gloss > 0.9 && p.clearcoat > 0 ? 2e-2 : 2e-3;
      EXPECT_NEAR(static_cast<double>(value.r), expected[0], slack * expected[0] + 1e-6) << p.xml();
      EXPECT_NEAR(static_cast<double>(value.g), expected[1], slack * expected[1] + 1e-6) << p.xml();
      EXPECT_NEAR(static_cast<double>(value.b), expected[2], slack * expected[2] + 1e-6) << p.xml();
      if (testing::Test::HasFailure()) return;
    }
  }
  EXPECT_GT(refracted, 500);
  EXPECT_GT(below, 2000);
}

// Claim: `specular` is 0.08 of reflectance at normal incidence; index-matched refraction is taken apart; eta
// and specular exclude each other; a black base has white hue; facts follow the textures.
TEST(PrincipledBsdf, Builds) {
  Built plain("<bsdf type='principled'/>");
  EXPECT_NEAR(plain.prepared({0, 0, 1}).get<PrincipledClosure>().eta, 1.5, 1e-6);
  EXPECT_TRUE(plain.prepared({0, 0, -1}).black);
  EXPECT_FALSE(plain.bsdf->facts().transmissive);
  Built matched(
      "<bsdf type='principled'><float name='eta' value='1'/><float name='spec_trans' value='0.5'/></bsdf>");
  EXPECT_EQ(matched.prepared({0, 0, 1}).get<PrincipledClosure>().eta, 1.001f);
  EXPECT_TRUE(matched.bsdf->facts().transmissive);
  EXPECT_TRUE(matched.prepared({0, 0, -1}).scatters_through());
  Built both(
      "<bsdf type='principled'><float name='eta' value='1.2'/><float name='specular' value='0.5'/></bsdf>");
  EXPECT_NE(both.error.find("has both 'eta' and 'specular'"), std::string::npos) << both.error;
  Built wide("<bsdf type='principled'><float name='metallic' value='1.5'/></bsdf>");
  EXPECT_NE(wide.error.find("at most 1"), std::string::npos) << wide.error;
  Built two(
      "<bsdf type='twosided'><bsdf type='principled'><float name='spec_trans' value='1'/></bsdf></bsdf>");
  EXPECT_NE(two.error.find("let no light through"), std::string::npos) << two.error;
  Built one("<bsdf type='twosided'><bsdf type='principled'/></bsdf>");
  EXPECT_TRUE(one.bsdf) << one.error;
}

// Claim: phong is Lafortune and Willems's, in 0.6's words; reflectances that add up to more than 1 are scaled
// to 0.99.
TEST(PhongBsdf, IsItsDefinition) {
  Built old(
      "<bsdf type='phong'><float name='exponent' value='12'/><spectrum name='diffuseReflectance' "
      "value='0.3'/>"
      "<srgb name='specularReflectance' value='#ffffff'/></bsdf>",
      "0.6.0");
  ASSERT_TRUE(old.bsdf) << old.error;
  const double scale = 0.99 / 1.3;
  rng::Stream stream(rng::key(52));
  for (int i = 0; i < 1000; ++i) {
    Vec3d o = random_direction(stream);
    Vec3d in = random_direction(stream);
    o.z = std::abs(o.z);
    in.z = std::abs(in.z);
    const double cosine = std::max(0.0, -o.x * in.x - o.y * in.y + o.z * in.z);
    const double expected = scale * in.z * (0.3 / kPi + 14 / (2 * kPi) * std::pow(cosine, 12));
    const Closure c = old.prepared(Vec3(o));
    EXPECT_NEAR(static_cast<double>(c.eval(Vec3(o), Vec3(in), TransportMode::radiance).g), expected,
                1e-4 * expected);
  }
  Built modern("<bsdf type='phong'/>");
  const Closure c = modern.prepared({0, 0, 1});
  EXPECT_EQ(c.get<PhongClosure>().exponent, 30);
  EXPECT_EQ(c.get<PhongClosure>().diffuse.g, 0.5f);
  EXPECT_EQ(c.get<PhongClosure>().specular.g, 0.2f);
  Built off("<bsdf type='phong'><boolean name='ensure_energy_conservation' value='false'/></bsdf>");
  EXPECT_FALSE(off.error.empty());
}

// Claim: ward's three variants are their papers', in 0.6's words.
TEST(WardBsdf, IsItsDefinition) {
  for (const std::string variant : {"ward", "ward-duer", "balanced"}) {
    Built old("<bsdf type='ward'><string name='variant' value='" + variant +
                  "'/><float name='alphaU' value='0.2'/><float name='alphaV' value='0.5'/></bsdf>",
              "0.6.0");
    ASSERT_TRUE(old.bsdf) << old.error;
    rng::Stream stream(rng::key(53));
    for (int i = 0; i < 1000; ++i) {
      Vec3d o = random_direction(stream);
      Vec3d in = random_direction(stream);
      o.z = std::abs(o.z) + 1e-3;
      in.z = std::abs(in.z) + 1e-3;
      o = normalize(o);
      in = normalize(in);
      const Vec3d h = o + in;
      const double e = std::exp(-(h.x * h.x / 0.04 + h.y * h.y / 0.25) / (h.z * h.z));
      const double bottom = 4 * kPi * 0.2 * 0.5;
      const double lobe = variant == "ward"        ? e / (bottom * std::sqrt(o.z * in.z))
                          : variant == "ward-duer" ? e / (bottom * o.z * in.z)
                                                   : e * dot(h, h) / (bottom / 4 * std::pow(h.z, 4));
      const double expected = in.z * (0.5 / kPi + 0.2 * lobe);
      const Closure c = old.prepared(Vec3(o));
      EXPECT_NEAR(static_cast<double>(c.eval(Vec3(o), Vec3(in), TransportMode::radiance).g), expected,
                  1e-3 * expected)
          << variant;
    }
  }
  Built one("<bsdf type='ward'><float name='alpha' value='0.3'/><float name='alpha_v' value='0.4'/></bsdf>");
  ASSERT_TRUE(one.bsdf) << one.error;
  EXPECT_EQ(one.prepared({0, 0, 1}).get<WardClosure>().alpha_u, 0.3f);
  EXPECT_EQ(one.prepared({0, 0, 1}).get<WardClosure>().alpha_v, 0.4f);
}

}  // namespace
}  // namespace candela::scene
