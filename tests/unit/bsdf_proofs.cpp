#include "bsdf_proofs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <ostream>

#include "bsdf_proof_steps.h"
#include "bsdf_quadrature.h"
#include "chi_squared.h"
#include "common/base/files.h"
#include "scene_fixture.h"
#include "tests/paths.h"
#include "tests/proofs/proofs.h"

namespace candela::test {
namespace {

using scene::BsdfSample;
using scene::Closure;
using scene::TransportMode;

constexpr float kLast = 1 - 0x1p-24f;  // the largest number a sampler gives
constexpr double kQuadrature = 5e-4;   // error aimed at
constexpr double kQuadratureMost = 2e-3;
constexpr double kTolerance = 1e-3;  // of ratios of floats, above what the directions' rounding makes of them

class Proof {
 public:
  Proof(const BsdfConfiguration& configuration, double alarm)
      : c_(configuration),
        files_({{"scene.xml",
                 "<scene version=\"3.0.0\"><shape type=\"sphere\">" + c_.xml + "</shape></scene>"}}),
        textures_(files_),
        alarm_(alarm),
        seed_(seed_of(configuration.name)),
        samples_(long_form() ? 200000 : 8000) {}

  int run() {
    if (!build()) return 0;
    std::vector<double> cosines = {1, 0.85, 0.5, 0.1};
    cosines.insert(cosines.end(), c_.more_cosines.begin(), c_.more_cosines.end());
    int index = 0;
    for (const double cosine : cosines) {
      for (const double side : {1.0, -1.0}) {
        scatter(direction(side * cosine, 0.7), ++index);
        if (testing::Test::HasFatalFailure()) return tests_;
      }
    }
    reciprocity();
    hostile();
    EXPECT_EQ(facts_.delta, seen_.delta);
    EXPECT_EQ(facts_.smooth, seen_.smooth);
    EXPECT_EQ(facts_.transmissive, seen_.transmissive);
    EXPECT_EQ(facts_.passthrough, seen_.passthrough);
    return tests_;
  }

  // The bits of what decides the proofs: samples, values and densities for the same directions in both modes,
  // there and back, for directions all over the sphere, and for those that numbers break on.
  std::vector<std::int64_t> bits() {
    Bits out;
    if (!build()) return out.words;
    for (const bool fact : {facts_.delta, facts_.smooth, facts_.transmissive, facts_.passthrough})
      out.add(fact);
    std::vector<double> cosines = {1, 0.85, 0.5, 0.1, 1e-3, 1e-20};
    cosines.insert(cosines.end(), c_.more_cosines.begin(), c_.more_cosines.end());
    int index = 0;
    for (const double cosine : cosines)
      for (const double side : {1.0, -1.0}) {
        const Vec3 wo = direction(side * cosine, 0.7);
        for (const TransportMode mode : {TransportMode::radiance, TransportMode::importance})
          add_bits(out, wo, mode, rng::key(seed_, 9, ++index));
      }
    rng::Stream stream(rng::key(seed_, 10));
    for (int i = 0; i < 400; ++i)
      add_bits(out, uniform_direction(stream),
               i % 2 == 0 ? TransportMode::radiance : TransportMode::importance, rng::key(seed_, 11, i), 4);
    return out.words;
  }

 private:
  // Floats as they are.
  struct Bits {
    void add(float value) { words.push_back(std::bit_cast<std::int32_t>(value)); }
    void add(Spectrum value) {
      for (const float v : {value.r, value.g, value.b}) add(v);
    }
    void add(Vec3 value) {
      for (const float v : {value.x, value.y, value.z}) add(v);
    }
    void add(bool value) { words.push_back(value ? 1 : 0); }
    std::vector<std::int64_t> words;
  };
  void add_bits(Bits& out, Vec3 wo, TransportMode mode, std::uint64_t key, int draws = 300) {
    const Closure closure = prepare(wo);
    for (const bool flag : {closure.black, closure.purely_delta(), closure.even(), closure.chooses_lobe()})
      out.add(flag);
    out.add(closure.passthrough(wo));
    rng::Stream stream(key);
    for (int i = 0; i < draws; ++i) {
      BsdfSample s;
      const bool valid = draw(closure, wo, stream, mode, s);
      const Vec3 wi = i % 4 == 0 || !valid || s.delta ? uniform_direction(stream) : s.wi;
      out.add(valid);
      if (valid) {
        for (const bool flag : {s.delta, s.transmitted, s.passthrough}) out.add(flag);
        for (const float v : {s.prob, s.prob_reverse, s.pdf_solid_angle, s.eta}) out.add(v);
        out.add(s.weight);
        out.add(s.wi);
      }
      for (const bool back : {false, true}) {
        const TransportMode in = back ? other(mode) : mode;
        float pdf = 0;
        out.add(back ? closure.eval_pdf(wi, wo, in, pdf) : closure.eval_pdf(wo, wi, in, pdf));
        out.add(pdf);
      }
    }
  }

  bool build() {
    auto description = description::parse_scene(files_, "scene.xml", {});
    if (!description.ok()) {
      ADD_FAILURE() << description.error().to_string();
      return false;
    }
    const auto shapes = description->scene->children_of("shape");
    const auto bsdfs = shapes.at(0)->children_of("bsdf");
    auto built = scene::Bsdf::build(*bsdfs.at(0), textures_);
    if (!built.ok()) {
      ADD_FAILURE() << built.error().to_string();
      return false;
    }
    if (c_.ng.z < 1) {
      built = scene::Bsdf::with_strict_normals(std::move(*built));
      if (!built.ok()) {
        ADD_FAILURE() << built.error().to_string();
        return false;
      }
    }
    bsdf_ = std::make_unique<scene::Bsdf>(std::move(*built));
    facts_ = bsdf_->facts();
    return true;
  }

  Closure prepare(Vec3 wo) {
    scene::SurfaceHit hit;
    hit.shading = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    hit.ng = c_.ng;
    hit.uv = {0.3f, 0.6f};
    hit.dp_du = {1, 0, 0};
    hit.dp_dv = {0, 1, 0};
    arena_.clear();
    Closure closure;
    bsdf_->prepare(hit, wo, arena_, closure);
    return closure;
  }

  // The index of wi's side over wo's.
  double relative_index(Vec3 wo, Vec3 wi) const {
    if ((wo.z < 0) == (wi.z < 0)) return 1;
    return wo.z < 0 ? 1 / c_.eta : c_.eta;
  }

  // Everything about one wo: its own samples in both modes, and those from where they lead, backwards.
  void scatter(Vec3 wo, int index) {
    const Closure closure = prepare(wo);
    for (const TransportMode mode : {TransportMode::radiance, TransportMode::importance}) {
      const std::string where = fmt::format("{} wo {} {}", c_.name, shown(wo),
                                            mode == TransportMode::radiance ? "radiance" : "importance");
      const std::uint64_t key = rng::key(seed_, index, static_cast<int>(mode));
      const std::vector<BsdfSample> kept = distribution(closure, wo, mode, key, where, true);
      int backwards = 0;
      if (!long_form() && mode == TransportMode::importance) continue;
      for (const BsdfSample& s : kept) {
        if (std::abs(s.wi.z) < 0.02f) continue;
        const std::string back = fmt::format("{}, back from {}", where, shown(s.wi));
        const std::vector<BsdfSample> returned =
            distribution(closure, s.wi, other(mode), rng::key(key, ++backwards), back, false);
        if (s.delta) delta_returns(wo, s, returned, back);
      }
    }
  }

  // sample() against pdf_solid_angle(), the energy of both, and what each sample says of itself. Returns one
  // sample of each delta lobe and one to each side of the others.
  std::vector<BsdfSample> distribution(const Closure& closure, Vec3 wo, TransportMode mode, std::uint64_t key,
                                       const std::string& where, bool forward) {
    std::vector<BsdfSample> kept;
    std::vector<BsdfSample> pilot;
    rng::Stream pilot_stream(rng::key(key, 1));
    for (int i = 0; i < 1200; ++i) {
      BsdfSample s;
      if (draw(closure, wo, pilot_stream, mode, s) && !s.delta) pilot.push_back(s);
    }
    std::vector<Vec3> where_to;
    for (const BsdfSample& s : pilot) where_to.push_back(s.wi);
    add_halo(where_to, rng::key(key, 8));
    add_hints(wo, where_to);
    const SphereBins bins(where_to, 40, 6);

    // The integrals of density and values, the latter as fractions of power.
    double error = 0;
    std::vector<Integrands> integrals(bins.count());
    if (!closure.black && !closure.purely_delta()) {
      integrals = bins.integrate(
          [&](Vec3 wi) {
            float pdf = 0;
            const Spectrum f = closure.eval_pdf(wo, wi, mode, pdf);
            const double scale = power_scale(wo, wi, mode);
            return Integrands{static_cast<double>(pdf), static_cast<double>(f.r) * scale,
                              static_cast<double>(f.g) * scale, static_cast<double>(f.b) * scale};
          },
          kQuadrature, 16000, error);
    }
    EXPECT_LT(error, kQuadratureMost) << where << ": the quadrature did not converge";
    double total = 0;
    std::array<double, 3> albedo{};
    for (const Integrands& i : integrals) {
      total += i[0];
      for (std::size_t k = 0; k < 3; ++k) albedo[k] += i[k + 1];
    }

    std::vector<double> observed(bins.count());
    std::vector<DeltaLobe> lobes;
    double refused = 0;
    rng::Stream stream(rng::key(key, 2));
    std::array<bool, 2> has_kept{};
    for (int i = 0; i < samples_; ++i) {
      BsdfSample s;
      if (!draw(closure, wo, stream, mode, s)) {
        ++refused;
        continue;
      }
      if (!s.delta) {
        ++observed[bins.bin_of(s.wi)];
        if (i < 400) check_sample(closure, wo, s, mode, rng::key(key, 3, i), where);
        const std::size_t side = s.transmitted ? 1 : 0;
        if (!has_kept[side] && std::abs(s.wi.z) > 0.02f) {
          has_kept[side] = true;
          kept.push_back(s);
        }
        continue;
      }
      count_delta(wo, s, lobes, where);
      if (testing::Test::HasFatalFailure()) return {};
    }

    // Delta lobes and refusals are bins of their own.
    std::vector<double> expected(bins.count());
    for (std::size_t i = 0; i < bins.count(); ++i) expected[i] = integrals[i][0] * samples_;
    std::array<double, 3> passthrough{};
    for (const DeltaLobe& lobe : lobes) {
      const BsdfSample& s = lobe.sample;
      kept.push_back(s);
      observed.push_back(lobe.count);
      expected.push_back(static_cast<double>(s.prob) * samples_);
      total += static_cast<double>(s.prob);
      const auto weight = channels(s.weight);
      for (std::size_t k = 0; k < 3; ++k) {
        const double passed = weight[k] * static_cast<double>(s.prob);
        albedo[k] += passed * (s.passthrough ? 1 : power_scale(wo, s.wi, mode));
        if (s.passthrough) passthrough[k] += passed;
      }
    }
    EXPECT_LE(total, 1 + kTolerance + error) << where << ": densities and probabilities add up to too much";
    observed.push_back(refused);
    expected.push_back(std::max(0.0, 1 - total) * samples_);
    EXPECT_GT(chi_squared_p(observed, expected), alarm_)
        << where << ": density and probabilities add up to " << total << ", refused " << refused / samples_;
    ++tests_;

    const auto passes = channels(closure.passthrough(wo));
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(passes[k], passthrough[k], 1e-5)
          << where << ": passthrough() is not what its samples carry";
    }
    if (c_.eta != 0 || mode == TransportMode::importance) {
      for (const double a : albedo) {
        if (mode == TransportMode::radiance || !c_.unbounded_adjoint) {
          EXPECT_LE(a, c_.most_albedo + kTolerance) << where << ": makes light";
        }
        if (forward && std::abs(wo.z) > 0.45f && !closure.black) {
          EXPECT_GE(a, c_.least_albedo - kTolerance) << where << ": loses light";
        }
      }
    }
    seen_.smooth |= total > 0 && !pilot.empty();
    return kept;
  }

  // Power refracted carries its radiance times the squared relative index.
  double power_scale(Vec3 wo, Vec3 wi, TransportMode mode) const {
    if (mode == TransportMode::importance || c_.eta == 0) return 1;
    const double eta = relative_index(wo, wi);
    return eta * eta;
  }

  // Points around the samples at multiples of their spacing, so that boxes grow gradually out of a lobe and
  // its flanks are not missed.
  static void add_halo(std::vector<Vec3>& directions, std::uint64_t key) {
    const std::size_t count = directions.size();
    constexpr std::size_t kNeighbours = 10;
    if (count < 2 * kNeighbours) return;
    rng::Stream stream(key);
    std::vector<float> distances(count);
    for (std::size_t i = 0; i < count; i += 4) {
      const Vec3 w = directions[i];
      for (std::size_t j = 0; j < count; ++j) distances[j] = length_squared(directions[j] - w);
      std::nth_element(distances.begin(), distances.begin() + kNeighbours, distances.end());
      const float spacing = std::sqrt(distances[kNeighbours]);
      for (const float scale : {1.0f, 2.0f, 4.0f})
        directions.push_back(normalize(w + uniform_direction(stream) * std::min(0.5f, scale * spacing)));
    }
  }

  // Where narrow lobes may be that the samples do not tell of: clouds of all widths around the mirror
  // direction, straight on, and the refracted one.
  void add_hints(Vec3 wo, std::vector<Vec3>& directions) const {
    std::vector<Vec3> centers = {{-wo.x, -wo.y, wo.z}, -wo};
    if (c_.eta != 0) {
      const auto ratio = static_cast<float>(wo.z < 0 ? c_.eta : 1 / c_.eta);
      const float x = -wo.x * ratio;
      const float y = -wo.y * ratio;
      const float cos2 = 1 - x * x - y * y;
      if (cos2 > 0) centers.push_back({x, y, wo.z < 0 ? std::sqrt(cos2) : -std::sqrt(cos2)});
    }
    rng::Stream stream(rng::key(seed_, 4));
    for (const Vec3 center : centers) {
      for (const float width : {0.3f, 0.1f, 0.03f, 0.01f, 0.003f, 0.001f, 3e-4f, 1e-4f}) {
        for (int i = 0; i < 8; ++i)
          directions.push_back(normalize(center + uniform_direction(stream) * width));
      }
    }
  }

  void check_common(Vec3 wo, const BsdfSample& s, const std::string& where) {
    EXPECT_TRUE(sound(s.weight)) << where;
    EXPECT_NEAR(static_cast<double>(length(s.wi)), 1, 2e-5) << where;
    EXPECT_EQ(s.transmitted, (s.wi.z < 0) != (wo.z < 0)) << where << " wi " << shown(s.wi);
    const double eta = s.passthrough || c_.eta == 0 ? 1 : relative_index(wo, s.wi);
    if (c_.eta != 0 || s.passthrough || !s.transmitted) {
      EXPECT_NEAR(static_cast<double>(s.eta), eta, 1e-5 * eta) << where;
    }
    seen_.transmissive |= s.transmitted && !s.passthrough;
    seen_.passthrough |= s.passthrough;
    seen_.delta |= s.delta && !s.passthrough;
  }

  // The weight is value over density, and the density is pdf_solid_angle's.
  void check_sample(const Closure& closure, Vec3 wo, const BsdfSample& s, TransportMode mode,
                    std::uint64_t key, const std::string& where) {
    // Once something failed, more of the same tells nothing.
    if (testing::Test::HasFailure() && ++checked_after_failure_ > 10) return;
    check_common(wo, s, where);
    EXPECT_FALSE(s.passthrough) << where;
    // Close to the horizon, and far out in a lobe, the float direction has too few digits.
    if (std::abs(s.wi.z) < 1e-3f || s.pdf_solid_angle < 1e-6f) return;
    float pdf = 0;
    const Spectrum f = closure.eval_pdf(wo, s.wi, mode, pdf);
    EXPECT_EQ(pdf, closure.pdf_solid_angle(wo, s.wi, mode)) << where;
    EXPECT_EQ(f, closure.eval(wo, s.wi, mode)) << where;
    const auto density = [&](Vec3 o, Vec3 i) {
      return static_cast<double>(closure.pdf_solid_angle(o, i, mode));
    };
    const double slack = kTolerance + 3 * relative_spread(wo, s.wi, key, density);
    const double here = static_cast<double>(pdf);
    EXPECT_NEAR(here / static_cast<double>(s.pdf_solid_angle), 1, slack)
        << where << " wi " << shown(s.wi) << ": the sample's density is not pdf_solid_angle()";
    const auto ratio = [&](Vec3 o, Vec3 i) {
      float p = 0;
      const double value = largest(closure.eval_pdf(o, i, mode, p));
      return p > 0 ? value / static_cast<double>(p) : 0.0;
    };
    const double ratio_slack = kTolerance + 3 * relative_spread(wo, s.wi, rng::key(key, 1), ratio);
    const auto weight = channels(s.weight);
    const auto value = channels(f);
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(weight[k], value[k] / here, ratio_slack * std::max(weight[k], 1e-6))
          << where << " wi " << shown(s.wi) << ": the weight is not value over density";
    }
  }

  void count_delta(Vec3 wo, const BsdfSample& s, std::vector<DeltaLobe>& lobes, const std::string& where) {
    for (DeltaLobe& lobe : lobes) {
      const BsdfSample& known = lobe.sample;
      // Parts of a blend may have lobes in one direction.
      if (known.passthrough != s.passthrough || s.prob != known.prob || s.weight != known.weight ||
          length(known.wi - s.wi) > 1e-5f)
        continue;
      ++lobe.count;
      EXPECT_EQ(s.prob_reverse, known.prob_reverse) << where;
      return;
    }
    check_common(wo, s, where);
    EXPECT_TRUE(s.prob > 0 && s.prob <= 1) << where << " " << s.prob;
    lobes.push_back({s, 1});
    ASSERT_LE(lobes.size(), 8u) << where << ": delta lobes without end";
  }

  // Of the walk that comes back along a delta lobe: it finds wo, with the probability announced, and what it
  // carries is the adjoint.
  void delta_returns(Vec3 wo, const BsdfSample& out, const std::vector<BsdfSample>& returned,
                     const std::string& where) {
    for (const BsdfSample& back : returned) {
      if (!back.delta || back.passthrough != out.passthrough || length(back.wi - wo) > 2e-5f) continue;
      if (std::abs(out.prob_reverse - back.prob) > 1e-4f) continue;  // another lobe of a blend
      EXPECT_NEAR(static_cast<double>(back.prob_reverse), static_cast<double>(out.prob), 1e-4) << where;
      if (!c_.not_reciprocal.empty()) return;
      // The delta's measure, projected solid angle, changes by eta^2 between the two ends.
      const double scale = static_cast<double>(out.eta) * static_cast<double>(out.eta);
      const auto there = channels(out.weight * out.prob);
      const auto again = channels(back.weight * back.prob);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(there[k] * scale, again[k], 1e-4 * std::max(1.0, again[k])) << where;
      }
      return;
    }
    // A lobe chosen once in many times may be missed on the way back.
    EXPECT_LT(static_cast<double>(out.prob_reverse) * samples_, 40)
        << where << ": sampling never comes back with prob_reverse to " << shown(wo);
  }

  // f(wo, wi) |cos wi| in one mode is the adjoint of f(wi, wo) |cos wo| in the other; and in one mode
  // f(wo, wi) / eta_o^2 = f(wi, wo) / eta_i^2 [Veach 1997, Eq. 5.14].
  void reciprocity() {
    rng::Stream stream(rng::key(seed_, 5));
    for (int i = 0; i < 400; ++i) {
      const double side = i % 2 == 0 ? 1 : -1;
      const Vec3 wo = direction(side * (0.02 + 0.98 * stream.next_double()), 6.28 * stream.next_double());
      const Closure closure = prepare(wo);
      Vec3 wi = uniform_direction(stream);
      BsdfSample s;
      if (draw(closure, wo, stream, TransportMode::radiance, s) && !s.delta && i % 4 < 3) wi = s.wi;
      if (closure.black || std::abs(wi.z) < 0.01f) continue;
      const auto scattered = [&](Vec3 to, Vec3 from, TransportMode mode) {
        return closure.eval(to, from, mode) / std::abs(from.z);
      };
      const auto value = [&](Vec3 o, Vec3 in) { return largest(scattered(o, in, TransportMode::radiance)); };
      if (!(value(wo, wi) > 1e-7)) continue;
      const double slack = kTolerance + 4 * std::max(relative_spread(wo, wi, rng::key(seed_, 6, i), value),
                                                     relative_spread(wi, wo, rng::key(seed_, 7, i), value));
      const auto there = channels(scattered(wo, wi, TransportMode::radiance));
      const auto adjoint = channels(scattered(wi, wo, TransportMode::importance));
      const auto back = channels(scattered(wi, wo, TransportMode::radiance));
      const double eta = c_.eta == 0 ? 0 : relative_index(wo, wi);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(there[k], adjoint[k], slack * std::max(there[k], 1e-7))
            << c_.name << ": not its own adjoint, wo " << shown(wo) << " wi " << shown(wi);
        if (eta == 0 || !c_.not_reciprocal.empty()) continue;
        EXPECT_NEAR(there[k] * eta * eta, back[k], slack * std::max(back[k], 1e-7))
            << c_.name << ": not reciprocal, wo " << shown(wo) << " wi " << shown(wi);
      }
    }
  }

  // Directions that numbers break on.
  void hostile() {
    rng::Stream stream(rng::key(seed_, 7));
    const auto number = [&] {
      return stream.next_u32() % 8 == 0 ? 0.0f : stream.next_u32() % 8 == 0 ? kLast : stream.next_float();
    };
    const auto any = [&]() -> Vec3 {
      switch (stream.next_u32() % 8) {
        case 0:
          return {0, 0, stream.next_u32() % 2 == 0 ? 1.0f : -1.0f};
        case 1: {  // along the surface, exactly
          const Vec3 d = direction(0, 6.28 * stream.next_double());
          return {d.x, d.y, stream.next_u32() % 2 == 0 ? 0.0f : -0.0f};
        }
        case 2: {  // nearly so
          const double z = std::pow(10, -38 * stream.next_double());
          return direction(stream.next_u32() % 2 == 0 ? z : -z, 6.28 * stream.next_double());
        }
        case 3: {  // nearly upright
          const Vec3 d = direction(1 - std::pow(10, -12 * stream.next_double()), 6.28 * stream.next_double());
          return stream.next_u32() % 2 == 0 ? d : -d;
        }
        case 4:
          return {1, 0, 0};
        default:
          return uniform_direction(stream);
      }
    };
    for (int i = 0; i < 4000; ++i) {
      const Vec3 wo = any();
      Vec3 wi = any();
      if (stream.next_u32() % 8 == 0) wi = {-wo.x, -wo.y, wo.z};
      if (stream.next_u32() % 16 == 0) wi = -wo;
      if (stream.next_u32() % 16 == 0) wi = wo;
      const Closure closure = prepare(wo);
      const TransportMode mode = i % 2 == 0 ? TransportMode::radiance : TransportMode::importance;
      float pdf = 0;
      ASSERT_TRUE(sound(closure.eval_pdf(wo, wi, mode, pdf)) && std::isfinite(pdf) && pdf >= 0)
          << c_.name << " wo " << shown(wo) << " wi " << shown(wi);
      ASSERT_TRUE(sound(closure.passthrough(wo))) << c_.name << " wo " << shown(wo);
      BsdfSample s;
      const float u_lobe = number();
      const float ux = number();
      const float uy = number();
      const bool valid = closure.sample(wo, u_lobe, {ux, uy}, mode, s);
      if (!closure.chooses_lobe()) {
        BsdfSample again;
        ASSERT_EQ(valid, closure.sample(wo, number(), {ux, uy}, mode, again)) << c_.name;
        if (valid) {
          ASSERT_EQ(s.wi, again.wi) << c_.name << ": reads u_lobe";
        }
      }
      if (!valid) continue;
      ASSERT_TRUE(sound(s.weight)) << c_.name << " wo " << shown(wo) << " u " << u_lobe << " " << ux << " "
                                   << uy;
      ASSERT_NEAR(static_cast<double>(length(s.wi)), 1, 2e-5) << c_.name << " wo " << shown(wo);
      ASSERT_TRUE(std::isfinite(s.eta) && s.eta > 0) << c_.name;
      ASSERT_TRUE(s.delta ? s.prob > 0 && s.prob <= 1 && s.prob_reverse >= 0 && s.prob_reverse <= 1
                          : std::isfinite(s.pdf_solid_angle) && s.pdf_solid_angle > 0)
          << c_.name << " wo " << shown(wo);
      ASSERT_FALSE(closure.purely_delta() && !s.delta) << c_.name;
      ASSERT_FALSE(closure.even() && !s.delta && s.pdf_solid_angle > 1) << c_.name << " is not even";
      ASSERT_TRUE(sound(closure.eval_pdf(wo, s.wi, mode, pdf)) && std::isfinite(pdf) && pdf >= 0) << c_.name;
      ASSERT_TRUE(sound(closure.eval_pdf(s.wi, wo, mode, pdf)) && std::isfinite(pdf) && pdf >= 0) << c_.name;
    }
  }

  const BsdfConfiguration& c_;
  const TextFiles files_;
  scene::TextureStore textures_;  // the bsdf's textures
  double alarm_;
  std::uint64_t seed_;
  int samples_;
  int tests_ = 0;
  int checked_after_failure_ = 0;
  std::unique_ptr<scene::Bsdf> bsdf_;
  scene::BsdfFacts facts_;
  scene::BsdfFacts seen_;
  scene::ClosureArena arena_;
};

}  // namespace

void PrintTo(const BsdfConfiguration& configuration, std::ostream* out) {
  *out << configuration.xml;
}

int prove_bsdf(const BsdfConfiguration& configuration, double alarm) {
  // What the proof is of: its bits decide the verdict (tests/proofs/proofs.h).
  const BsdfConfiguration& c = configuration;
  const std::string what =
      fmt::format("{}\n{} {} {} {} {} {} {} {} {} {}", c.name, c.xml, c.eta, c.not_reciprocal, c.least_albedo,
                  c.most_albedo, c.unbounded_adjoint, fmt::join(c.more_cosines, " "), c.ng.x, c.ng.y, c.ng.z);
  if (!proofs::probing()) {
    proofs::film(what, {});
    return Proof(configuration, alarm).run();
  }
  proofs::film(what, Proof(configuration, alarm).bits());
  for (const char* file : {"bsdf_proofs.cpp", "bsdf_proof_steps.h", "bsdf_quadrature.cpp",
                           "bsdf_quadrature.h", "chi_squared.h"}) {
    const auto text = read_file(source_path(std::string("tests/unit/") + file), 1 << 20);
    proofs::fact(file, text.ok() ? *text : std::string());
  }
  return 0;
}

}  // namespace candela::test
