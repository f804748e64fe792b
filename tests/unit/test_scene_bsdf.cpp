// Every bsdf must keep these: sampling matches its density, weights are value over density, reciprocity,
// energy, and finite values whatever is asked. Statistical tests have fixed seeds; their family-wise
// false-alarm rate over seeds is stated.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "chi_squared.h"
#include "common/rng/stream.h"
#include "worker/core/math.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {
namespace {

constexpr float kLast = 1 - 0x1p-24f;  // the largest number a sampler gives

Vec3 direction(double cos_theta, double phi) {
  const double s = std::sqrt(std::max(0.0, (1 - cos_theta) * (1 + cos_theta)));
  return {static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
          static_cast<float>(cos_theta)};
}

Closure make_diffuse(Spectrum reflectance) {
  Closure c;
  c.set(DiffuseClosure{reflectance});
  return c;
}
Closure make_rough(float alpha_u, float alpha_v, bool ggx, bool visible) {
  Closure c;
  c.set(RoughConductorClosure{Spectrum(1), Spectrum(0), Spectrum(1), alpha_u, alpha_v, ggx,
                              visible});  // reflects all
  return c;
}
Closure make_dielectric(float eta, float r = 1, float t = 1) {
  Closure c;
  c.set(DielectricClosure{Spectrum(r), Spectrum(t), eta});
  return c;
}

struct Case {
  Closure closure;
  double cos_o;
  double phi_o;
  std::string name;
};

std::vector<Case> rough_cases() {
  std::vector<Case> cases;
  const std::array<std::array<float, 2>, 7> alphas = {
      {{1e-4f, 1e-4f}, {0.01f, 0.01f}, {0.1f, 0.1f}, {0.5f, 0.5f}, {1, 1}, {0.05f, 0.4f}, {0.9f, 0.02f}}};
  for (const auto& a : alphas) {
    for (const bool ggx : {false, true}) {
      for (const bool visible : {false, true}) {
        for (const double cos_o : {1.0, 0.7, 0.2, 0.01}) {
          cases.push_back({make_rough(a[0], a[1], ggx, visible), cos_o, 0.7,
                           std::string(ggx ? "ggx" : "beckmann") + " alpha " + std::to_string(a[0]) + " " +
                               std::to_string(a[1]) + (visible ? " visible" : " all") + " cos " +
                               std::to_string(cos_o)});
        }
      }
    }
  }
  return cases;
}

// Facet slopes in units of alpha, (r, phi), where r^2 = t / (1 - t): a chart of all normals in which no lobe
// is narrow. Returns wi for t and phi, and the Jacobian d(solid angle of wi) / (dt dphi).
Vec3 chart(const Closure& c, Vec3 wo, double t, double phi, double& jacobian) {
  const auto& p = c.get<RoughConductorClosure>();
  const double r = std::sqrt(1 / ((1 - t) * (1 - t)) - 1);
  const double au = static_cast<double>(p.alpha_u);
  const double av = static_cast<double>(p.alpha_v);
  const Vec3d slope(au * r * std::cos(phi), av * r * std::sin(phi), 1);
  const Vec3d h = normalize(slope);
  const Vec3d o(wo);
  const double cos_d = dot(o, h);
  const Vec3d i = h * (2 * cos_d) - o;
  // dwi = 4 |wo.h| dh; dh = h.z^3 d(slopes); d(slopes) = au av r dr dphi; r dr = dt / (1 - t)^3.
  jacobian = 4 * std::abs(cos_d) * h.z * h.z * h.z * au * av / ((1 - t) * (1 - t) * (1 - t));
  return cos_d > 0 ? Vec3(i) : Vec3{0, 0, -1};
}
void inverse_chart(const Closure& c, Vec3 wo, Vec3 wi, double& t, double& phi) {
  const auto& p = c.get<RoughConductorClosure>();
  const Vec3d h = normalize(Vec3d(wo) + Vec3d(wi));
  const double x = h.x / h.z / static_cast<double>(p.alpha_u);
  const double y = h.y / h.z / static_cast<double>(p.alpha_v);
  const double r2 = x * x + y * y;
  t = 1 - 1 / std::sqrt(1 + r2);
  phi = std::atan2(y, x);
}

constexpr int kRadial = 12;
constexpr int kAngular = 8;

// Claim: roughconductor's sample() has the density that pdf_solid_angle() states, and what it refuses is just
// what that density leaves to 1. Chi-squared over 96 bins of facet slope and the refusals, against the
// density integrated by the midpoint rule; 112 cases share 1 % of false alarm.
TEST(RoughConductor, SamplingMatchesDensity) {
  constexpr int kFine = 20;
  const std::vector<Case> cases = rough_cases();
  const double alarm = 0.01 / static_cast<double>(cases.size());
  for (std::size_t n = 0; n < cases.size(); ++n) {
    const Closure& c = cases[n].closure;
    const Vec3 wo = direction(cases[n].cos_o, cases[n].phi_o);
    const int samples =
        cases[n].cos_o * static_cast<double>(c.get<RoughConductorClosure>().alpha_u) < 1e-5 ? 3000 : 15000;
    std::vector<double> expected(kRadial * kAngular + 1);
    double total = 0;
    for (int a = 0; a < kRadial; ++a) {
      for (int b = 0; b < kAngular; ++b) {
        double sum = 0;
        for (int i = 0; i < kFine; ++i) {
          for (int j = 0; j < kFine; ++j) {
            const double t = (a + (i + 0.5) / kFine) / kRadial;
            const double phi = ((b + (j + 0.5) / kFine) / kAngular * 2 - 1) * std::numbers::pi;
            double jacobian = 0;
            const Vec3 wi = chart(c, wo, t, phi, jacobian);
            sum += static_cast<double>(c.pdf_solid_angle(wo, wi, TransportMode::radiance)) * jacobian;
          }
        }
        const double cell = 2 * std::numbers::pi / (kRadial * kAngular) / (kFine * kFine);
        expected[static_cast<std::size_t>(a * kAngular + b)] = sum * cell * samples;
        total += sum * cell;
      }
    }
    EXPECT_LE(total, 1.01) << cases[n].name;
    expected.back() = std::max(0.0, 1 - total) * samples;

    std::vector<double> observed(expected.size());
    rng::Stream stream(rng::key(11, n));
    for (int i = 0; i < samples; ++i) {
      const float ux = stream.next_float();
      const float uy = stream.next_float();
      BsdfSample s;
      if (!c.sample(wo, 0, {ux, uy}, TransportMode::radiance, s)) {
        ++observed.back();
        continue;
      }
      double t = 0;
      double phi = 0;
      inverse_chart(c, wo, s.wi, t, phi);
      const int a = std::clamp(static_cast<int>(t * kRadial), 0, kRadial - 1);
      const int b =
          std::clamp(static_cast<int>((phi / std::numbers::pi + 1) / 2 * kAngular), 0, kAngular - 1);
      ++observed[static_cast<std::size_t>(a * kAngular + b)];
    }
    EXPECT_GT(test::chi_squared_p(observed, expected), alarm)
        << cases[n].name << ", density integrates to " << total;
  }
}

// Claim: the weight is value over density, and the sample's density is pdf_solid_angle's. In float the half
// vector of a narrow lobe is known to about 1e-7 / (alpha cos theta) of its width; the density follows that,
// the ratio does not.
TEST(RoughConductor, WeightIsValueOverDensity) {
  for (const Case& k : rough_cases()) {
    const Vec3 wo = direction(k.cos_o, k.phi_o);
    const float alpha = std::min(k.closure.get<RoughConductorClosure>().alpha_u,
                                 k.closure.get<RoughConductorClosure>().alpha_v);
    rng::Stream stream(rng::key(12));
    for (int i = 0; i < 300; ++i) {
      const float ux = stream.next_float();
      const float uy = stream.next_float();
      BsdfSample s;
      if (!k.closure.sample(wo, 0, {ux, uy}, TransportMode::radiance, s)) continue;
      float pdf = 0;
      const Spectrum f = k.closure.eval_pdf(wo, s.wi, TransportMode::radiance, pdf);
      ASSERT_GT(s.pdf_solid_angle, 0) << k.name;
      if (s.wi.z < 1e-3f || s.pdf_solid_angle < 1e-6f)
        continue;  // the float direction itself has too few digits there
      ASSERT_NEAR(f.r / pdf / s.weight.r, 1, 2e-3f + 1e-6f / alpha) << k.name << " wi.z " << s.wi.z;
      ASSERT_NEAR(pdf / s.pdf_solid_angle, 1, 2e-3f + 1e-6f / (alpha * wo.z)) << k.name << " wi.z " << s.wi.z;
      ASSERT_EQ(f.r, k.closure.eval(wo, s.wi, TransportMode::importance).r);
      ASSERT_EQ(pdf, k.closure.pdf_solid_angle(wo, s.wi, TransportMode::importance));
    }
  }
}

// Claim: no light is made: with a perfect reflector inside, every weight of visible-normal sampling is at
// most 1, and the integral of f cos over wi (midpoint rule) is at most 1, for all wo and alpha; at normal
// view and low roughness it is close to 1.
TEST(RoughConductor, WhiteFurnaceLosesNotGains) {
  for (const Case& k : rough_cases()) {
    const Vec3 wo = direction(k.cos_o, k.phi_o);
    double albedo = 0;
    constexpr int kSteps = 100;
    for (int i = 0; i < kSteps; ++i) {
      for (int j = 0; j < kSteps; ++j) {
        double jacobian = 0;
        const Vec3 wi =
            chart(k.closure, wo, (i + 0.5) / kSteps, (j + 0.5) / kSteps * 2 * std::numbers::pi, jacobian);
        albedo += static_cast<double>(k.closure.eval(wo, wi, TransportMode::radiance).g) * jacobian;
      }
    }
    albedo *= 2 * std::numbers::pi / (kSteps * kSteps);
    EXPECT_LE(albedo, 1.003) << k.name;  // 0.003: the quadrature's error at the horizon
    const float alpha = std::max(k.closure.get<RoughConductorClosure>().alpha_u,
                                 k.closure.get<RoughConductorClosure>().alpha_v);
    if (k.cos_o > 0.5 && alpha <= 0.1f) {
      EXPECT_GE(albedo, 0.97) << k.name;
    }
    if (!k.closure.get<RoughConductorClosure>().sample_visible) continue;
    rng::Stream stream(rng::key(13));
    for (int i = 0; i < 1000; ++i) {
      const float ux = stream.next_float();
      const float uy = stream.next_float();
      BsdfSample s;
      if (k.closure.sample(wo, 0, {ux, uy}, TransportMode::radiance, s)) {
        ASSERT_LE(s.weight.max_component(), 1.000001f) << k.name;
      }
    }
  }
}

// Claim: f(wo, wi) = f(wi, wo) for all reflecting bsdfs.
TEST(Bsdf, Reciprocity) {
  std::vector<Closure> closures = {make_diffuse({0.2f, 0.5f, 0.9f})};
  for (const Case& k : rough_cases()) {
    Closure c = k.closure;
    RoughConductorClosure metal = c.get<RoughConductorClosure>();
    metal.eta = {1.6f, 0.9f, 0.5f};
    metal.k = {9.2f, 6.3f, 4.8f};
    c.set(metal);
    closures.push_back(c);
  }
  rng::Stream stream(rng::key(14));
  for (const Closure& c : closures) {
    for (int i = 0; i < 100; ++i) {
      const Vec3 wo = direction(0.02 + 0.98 * stream.next_double(), 6.28 * stream.next_double());
      const Vec3 wi = direction(0.02 + 0.98 * stream.next_double(), 6.28 * stream.next_double());
      const Spectrum a = c.eval(wo, wi, TransportMode::radiance) / wi.z;
      const Spectrum b = c.eval(wi, wo, TransportMode::radiance) / wo.z;
      ASSERT_NEAR(a.r, b.r, 1e-4f * (a.r + b.r));
      ASSERT_NEAR(a.b, b.b, 1e-4f * (a.b + b.b));
    }
  }
}

// Claim: diffuse reflects its reflectance, samples the cosine, and only on the front.
TEST(Diffuse, IsLambert) {
  const Closure c = make_diffuse({0.25f, 0.5f, 1});
  rng::Stream stream(rng::key(15));
  constexpr int kBins = 10;
  constexpr int kSamples = 50000;
  std::vector<double> observed(kBins);
  for (int i = 0; i < kSamples; ++i) {
    const Vec3 wo = direction(0.001 + 0.999 * stream.next_double(), 6.28 * stream.next_double());
    const float ux = stream.next_float();
    const float uy = stream.next_float();
    BsdfSample s;
    ASSERT_TRUE(c.sample(wo, 0, {ux, uy}, TransportMode::radiance, s));
    ASSERT_EQ(s.weight, (Spectrum{0.25f, 0.5f, 1}));
    float pdf = 0;
    const Spectrum f = c.eval_pdf(wo, s.wi, TransportMode::radiance, pdf);
    ASSERT_EQ(pdf, s.pdf_solid_angle);
    ASSERT_NEAR(f.g, 0.5f * s.wi.z * math::kInvPi, 1e-7f);
    ASSERT_TRUE(c.eval(wo, -s.wi, TransportMode::radiance).is_black());
    ASSERT_TRUE(c.eval(-wo, s.wi, TransportMode::radiance).is_black());
    ++observed[std::min<std::size_t>(kBins - 1, static_cast<std::size_t>((1 - s.wi.z * s.wi.z) * kBins))];
    ASSERT_FALSE(c.sample(-wo, 0, {ux, uy}, TransportMode::radiance, s));
  }
  // sin^2 is uniform under a cosine density; one test, false alarm 1 %.
  EXPECT_GT(test::chi_squared_p(observed, std::vector<double>(kBins, double{kSamples} / kBins)), 0.01);
}

// Fresnel's equations in double, by the textbook's angles.
double fresnel_reference(double cos_i, double eta) {
  const double sin_t = std::sqrt(1 - cos_i * cos_i) / eta;
  if (sin_t >= 1) return 1;
  const double ti = std::acos(cos_i);
  const double tt = std::asin(sin_t);
  if (ti < 1e-6) return std::pow((eta - 1) / (eta + 1), 2);
  const double s = std::sin(ti - tt) / std::sin(ti + tt);
  const double p = std::tan(ti - tt) / std::tan(ti + tt);
  return 0.5 * (s * s + p * p);
}

// Claim: reflection is chosen with Fresnel's probability and weight 1, refraction with the rest (R + T = 1),
// it obeys Snell, scales radiance by 1 / eta^2 and importance by 1, and beyond the critical angle all is
// reflected.
TEST(Dielectric, ObeysFresnelAndSnell) {
  rng::Stream stream(rng::key(16));
  for (const float eta : {1.5046f, 2.4f, 1.0f / 1.5f, 1.0001f, 0.5f}) {
    const Closure c = make_dielectric(eta);
    for (int i = 0; i < 400; ++i) {
      const double cos_o =
          i < 100 ? std::pow(10, -6 * stream.next_double()) : 0.001 + 0.999 * stream.next_double();
      for (const bool outside : {true, false}) {
        Vec3 wo = direction(cos_o, 6.28 * stream.next_double());
        if (!outside) wo.z = -wo.z;
        const double relative = outside ? static_cast<double>(eta) : 1 / static_cast<double>(eta);
        const double r = fresnel_reference(static_cast<double>(std::abs(wo.z)), relative);
        // The choice flips here, found by bisection: the probability of reflection.
        float low = 0;
        float high = 1;
        BsdfSample s;
        for (int b = 0; b < 30; ++b) {
          const float u = 0.5f * (low + high);
          ASSERT_TRUE(c.sample(wo, std::min(u, kLast), {}, TransportMode::radiance, s));
          (s.transmitted ? high : low) = u;
        }
        ASSERT_NEAR(low, r, 2e-5 + 1e-3 * r) << eta << " " << wo.z;
        ASSERT_TRUE(c.sample(wo, 0, {}, TransportMode::radiance, s) || r == 0);
        ASSERT_TRUE(s.delta);
        if (!s.transmitted) {
          ASSERT_NEAR(s.weight.r, 1, 1e-5f);
          ASSERT_EQ(s.wi, (Vec3{-wo.x, -wo.y, wo.z}));
          ASSERT_EQ(s.eta, 1);
        }
        ASSERT_TRUE(c.sample(wo, kLast, {}, TransportMode::radiance, s));
        if (r == 1) {
          ASSERT_FALSE(s.transmitted);
          continue;
        }
        if (!s.transmitted) continue;  // reflection's probability rounds to 1
        BsdfSample importance;
        ASSERT_TRUE(c.sample(wo, kLast, {}, TransportMode::importance, importance));
        ASSERT_NEAR(importance.weight.g, 1, 1e-4f);
        ASSERT_NEAR(s.weight.g * relative * relative, importance.weight.g, 1e-4);
        ASSERT_NEAR(s.eta, relative, 1e-5 * relative);
        ASSERT_EQ(s.wi.z > 0, !outside);
        ASSERT_NEAR(length(s.wi), 1, 1e-5f);
        // Snell: n sin is kept, and the plane of incidence.
        ASSERT_NEAR(s.wi.x * relative, -wo.x, 1e-5);
        ASSERT_NEAR(s.wi.y * relative, -wo.y, 1e-5);
        // And back along the same path: the same transmittance, the inverse scale.
        BsdfSample back;
        ASSERT_TRUE(c.sample(s.wi, kLast, {}, TransportMode::radiance, back));
        if (back.transmitted && std::abs(wo.z) > 1e-2f) {
          ASSERT_NEAR(back.weight.g * s.weight.g, 1, 1e-3f);
          ASSERT_NEAR(dot(back.wi, wo), 1, 1e-4f);
        }
      }
    }
  }
}

// Claim: as the indices match, the surface vanishes: straight on, weight 1, no reflection, at grazing angles
// too.
TEST(Dielectric, IndexMatchedBoundaryVanishes) {
  const Closure c = make_dielectric(1);
  for (const double cos_o : {1.0, 0.5, 1e-3, 1e-6}) {
    for (const float u : {0.0f, 0.5f, kLast}) {
      const Vec3 wo = direction(cos_o, 1);
      BsdfSample s;
      ASSERT_TRUE(c.sample(wo, u, {}, TransportMode::radiance, s));
      EXPECT_TRUE(s.transmitted);
      EXPECT_NEAR(s.wi.x, -wo.x, 1e-7f);
      EXPECT_NEAR(s.wi.z, -wo.z, 3e-4f);
      EXPECT_EQ(s.weight.r, 1);
    }
  }
  for (const float eta : {1 + 1e-6f, 1 - 1e-6f}) {
    BsdfSample s;
    ASSERT_TRUE(make_dielectric(eta).sample(direction(0.3, 1), 1e-6f, {}, TransportMode::radiance, s));
    EXPECT_TRUE(s.transmitted);
    EXPECT_NEAR(s.weight.r, 1, 1e-5f);
  }
}

// Claim: the lobes' colours weigh their choice, and the estimate stays reflectance * R + transmittance * T.
TEST(Dielectric, ColouredLobes) {
  const Vec3 wo = direction(0.4, 2);
  const double r = fresnel_reference(static_cast<double>(wo.z), 1.5);
  const Closure c = make_dielectric(1.5f, 0.2f, 0.6f);
  double reflected = 0;
  double transmitted = 0;
  constexpr int kSteps = 100000;
  for (int i = 0; i < kSteps; ++i) {
    BsdfSample s;
    ASSERT_TRUE(c.sample(wo, (static_cast<float>(i) + 0.5f) / kSteps, {}, TransportMode::importance, s));
    (s.transmitted ? transmitted : reflected) += static_cast<double>(s.weight.r) / kSteps;
  }
  EXPECT_NEAR(reflected, 0.2 * r, 1e-4);
  EXPECT_NEAR(transmitted, 0.6 * (1 - r), 1e-4);
  BsdfSample s;
  EXPECT_TRUE(make_dielectric(1.5f, 0, 1).sample(wo, 0, {}, TransportMode::radiance, s));
  EXPECT_TRUE(s.transmitted);
  EXPECT_TRUE(make_dielectric(1.5f, 1, 0).sample(wo, kLast, {}, TransportMode::radiance, s));
  EXPECT_FALSE(s.transmitted);
  EXPECT_FALSE(make_dielectric(1.5f, 0, 0).sample(wo, 0.5f, {}, TransportMode::radiance, s));
}

// Claim: a smooth conductor mirrors, with the complex Fresnel reflectance. Oracle: the textbook's
// normal-incidence value and the dielectric limit k = 0.
TEST(Conductor, MirrorsWithComplexFresnel) {
  Closure c;
  const auto normal = [](double eta, double k) {
    return ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
  };
  c.set(ConductorClosure{Spectrum(1), {0.2f, 1.5f, 3}, {3.9f, 0, 4.5f}});
  BsdfSample s;
  ASSERT_TRUE(c.sample({0, 0, 1}, 0, {}, TransportMode::radiance, s));
  EXPECT_NEAR(s.weight.r, normal(0.2, 3.9), 1e-5);
  EXPECT_NEAR(s.weight.b, normal(3, 4.5), 1e-5);
  for (const double cos_o : {1.0, 0.8, 0.5, 0.1, 1e-3}) {
    const Vec3 wo = direction(cos_o, 1);
    ASSERT_TRUE(c.sample(wo, 0, {}, TransportMode::radiance, s));
    EXPECT_TRUE(s.delta);
    EXPECT_EQ(s.wi, (Vec3{-wo.x, -wo.y, wo.z}));
    EXPECT_NEAR(s.weight.g, fresnel_reference(cos_o, 1.5), 1e-5) << cos_o;
  }
  // Mitsuba's material "none": reflects all.
  c.set(ConductorClosure{Spectrum(0.7f), Spectrum(0), Spectrum(1)});
  for (const double cos_o : {1.0, 0.5, 1e-3, 1e-6}) {
    ASSERT_TRUE(c.sample(direction(cos_o, 1), 0, {}, TransportMode::radiance, s));
    EXPECT_NEAR(s.weight.r, 0.7f, 1e-6f);
  }
  EXPECT_FALSE(c.sample({0, 0, -1}, 0, {}, TransportMode::radiance, s));
}

// Claim: a flipped closure (two-sided, from behind) is the front mirrored in z.
TEST(Bsdf, FlippedIsMirrored) {
  for (const Closure& front : {make_diffuse(Spectrum(0.5f)), make_rough(0.3f, 0.1f, true, true),
                               make_rough(0.2f, 0.2f, false, false)}) {
    Closure back = front;
    back.flipped = true;
    const Vec3 wo = direction(0.6, 0.3);
    const Vec3 mirrored = {wo.x, wo.y, -wo.z};
    BsdfSample a;
    BsdfSample b;
    ASSERT_TRUE(front.sample(wo, 0, {0.3f, 0.4f}, TransportMode::radiance, a));
    ASSERT_TRUE(back.sample(mirrored, 0, {0.3f, 0.4f}, TransportMode::radiance, b));
    EXPECT_EQ(b.wi, (Vec3{a.wi.x, a.wi.y, -a.wi.z}));
    EXPECT_EQ(a.weight, b.weight);
    EXPECT_EQ(a.pdf_solid_angle, b.pdf_solid_angle);
    EXPECT_EQ(front.eval(wo, a.wi, TransportMode::radiance),
              back.eval(mirrored, b.wi, TransportMode::radiance));
    EXPECT_TRUE(back.eval(wo, a.wi, TransportMode::radiance).is_black());
  }
}

// Claim: whatever the parameters and directions, results are finite and not negative, directions are unit:
// roughness from 1e-4 to 100, grazing to 1e-7, random numbers at both ends.
TEST(Bsdf, RandomInputNeverGivesNaN) {
  rng::Stream stream(rng::key(17));
  const auto unit_number = [&] {
    switch (stream.next_u32() % 8) {
      case 0:
        return 0.0f;
      case 1:
        return kLast;
      case 2:
        return 0x1p-24f;
      default:
        return stream.next_float();
    }
  };
  const auto any_direction = [&] {
    const double choice = stream.next_double();
    double cos_theta = 2 * stream.next_double() - 1;
    if (choice < 0.3)
      cos_theta = std::pow(10, -7 * stream.next_double()) * (stream.next_double() < 0.5 ? -1 : 1);
    if (choice > 0.97) cos_theta = 1;
    if (choice > 0.99) cos_theta = 0;
    return direction(cos_theta, stream.next_double() < 0.1 ? 0 : 6.2832 * stream.next_double());
  };
  const auto fine = [](Spectrum s) {
    return std::isfinite(s.r) && std::isfinite(s.g) && std::isfinite(s.b) && s.r >= 0 && s.g >= 0 && s.b >= 0;
  };
  const auto number = [&](double low, double high) {  // log-uniform
    return static_cast<float>(low * std::pow(high / low, stream.next_double()));
  };
  for (int n = 0; n < 300000; ++n) {
    Closure c;
    const std::uint32_t kind = stream.next_u32() % 4;
    const Spectrum reflectance = Spectrum(unit_number());
    const Spectrum eta = {stream.next_u32() % 5 == 0 ? 0 : number(1e-3, 10), 1, number(1e-6, 1e6)};
    const Spectrum k = {stream.next_u32() % 5 == 0 ? 0 : number(1e-3, 10), 0, number(1e-6, 1e6)};
    if (kind == 0) {
      c = make_diffuse(reflectance);
    } else if (kind == 1) {
      c = make_dielectric(
          stream.next_u32() % 4 == 0 ? 1 + (stream.next_float() - 0.5f) * 1e-5f : number(1e-3, 1e3),
          reflectance.r, unit_number());
    } else if (kind == 2) {
      c.set(ConductorClosure{reflectance, eta, k});
    } else {
      c.set(RoughConductorClosure{reflectance, eta, k, number(1e-4, 100), number(1e-4, 100),
                                  stream.next_u32() % 2 == 0, stream.next_u32() % 3 != 0});
    }
    c.flipped = stream.next_u32() % 4 == 0 && kind != 1;
    const Vec3 wo = any_direction();
    Vec3 wi = any_direction();
    if (stream.next_u32() % 8 == 0) wi = {-wo.x, -wo.y, wo.z};
    if (stream.next_u32() % 16 == 0) wi = -wo;
    const TransportMode mode =
        stream.next_u32() % 2 == 0 ? TransportMode::radiance : TransportMode::importance;
    float pdf = 0;
    ASSERT_TRUE(fine(c.eval_pdf(wo, wi, mode, pdf))) << n;
    ASSERT_TRUE(std::isfinite(pdf) && pdf >= 0) << n;
    BsdfSample s;
    const float ux = unit_number();
    const float uy = unit_number();
    if (!c.sample(wo, unit_number(), {ux, uy}, mode, s)) continue;
    ASSERT_TRUE(fine(s.weight)) << n << " kind " << kind;
    ASSERT_NEAR(length(s.wi), 1, 2e-5f) << n << " kind " << kind;
    ASSERT_TRUE(s.delta || (std::isfinite(s.pdf_solid_angle) && s.pdf_solid_angle > 0))
        << n << " kind " << kind;
    ASSERT_TRUE(fine(c.eval_pdf(wo, s.wi, mode, pdf)) && std::isfinite(pdf)) << n;
  }
}

// Claim: the masking functions are Smith's: G1 cos theta = integral of D over the visible normals, by
// quadrature in slopes.
TEST(Microfacets, MaskingIsSmiths) {
  for (const bool ggx : {false, true}) {
    for (const float alpha : {0.1f, 0.5f, 1.0f}) {
      for (const double cos_theta : {0.9, 0.5, 0.1, 0.02}) {
        const Microfacets m{alpha, 0.7f * alpha, ggx};
        const Vec3 w = direction(cos_theta, 0.4);
        double visible = 0;
        constexpr int kSteps = 200;
        for (int i = 0; i < kSteps; ++i) {
          for (int j = 0; j < kSteps; ++j) {
            const double t = (i + 0.5) / kSteps;
            const double phi = (j + 0.5) / kSteps * 2 * std::numbers::pi;
            const double r = std::sqrt(1 / ((1 - t) * (1 - t)) - 1);
            const Vec3d h = normalize(Vec3d(static_cast<double>(m.alpha_u) * r * std::cos(phi),
                                            static_cast<double>(m.alpha_v) * r * std::sin(phi), 1));
            const double area =
                h.z * h.z * h.z * static_cast<double>(m.alpha_u * m.alpha_v) / ((1 - t) * (1 - t) * (1 - t));
            visible += std::max(0.0, dot(Vec3d(w), h)) * static_cast<double>(m.D(Vec3(h))) * area;
          }
        }
        visible *= 2 * std::numbers::pi / (kSteps * kSteps);
        EXPECT_NEAR(cos_theta / visible, static_cast<double>(m.G1(w)), 0.001)
            << ggx << " " << alpha << " " << cos_theta;
      }
    }
  }
}

}  // namespace
}  // namespace candela::scene
