// Closures of edited bsdfs against the definition of an edit (edits_fixture.h).
#include <gtest/gtest.h>

#include <cmath>

#include "chi_squared.h"
#include "common/rng/stream.h"
#include "edits_fixture.h"
#include "worker/scene/bsdfs/delta_lobes.h"

namespace candela::scene {
namespace {

class EditedClosures : public testing::TestWithParam<Case> {};

// Claim: what an edited surface scatters, from any direction, is what the plain one scatters, turned
// direction by direction: as a walk from the light sees it for edits of light, and as one from the eye does
// for the others.
TEST_P(EditedClosures, ScatterWhatTheDefinitionTurns) {
  const Case& c = GetParam();
  const auto e = make(c);
  const float below = e->scene.glossy_below;
  for (const bool of_light : {true, false}) {
    bool only = true;
    for (const auto& edit : e->scene.edits) only &= edit.of_light == of_light;
    if (!only) continue;  // both kinds at once: the next test
    const TransportMode mode = of_light ? kImportance : kRadiance;
    for (const Vec3 wo : directions_from()) {
      const At at(*e, wo);
      Sums turned, edited;
      over_sphere([&](Vec3 w, double area) {
        float pdf = 0;
        const Spectrum v = at.value(at.edited, wo, w, mode, pdf);
        edited.add(w, static_cast<double>(v.r), 0, area);
        const Spectrum all = at.value(at.plain, wo, w, mode, pdf);
        const float correct = mode == kRadiance ? 1.0f : at.correction(wo, w);
        const Spectrum diffuse = at.plain.eval_diffuse(wo, w, mode, below) * correct;
        float moved = 0, kept = 0;
        (c.diffuse ? moved : kept) += diffuse.r;
        (c.glossy ? moved : kept) += all.r - diffuse.r;
        turned.add(w, static_cast<double>(kept), 0, area);
        Vec3 o;
        Spectrum factor(1);
        if (moved > 0 && sent(*e, of_light, w, o, factor))
          turned.add(o, static_cast<double>(moved * factor.r), 0, area);
      });
      for (std::size_t i = 0; i < kTests; ++i)
        EXPECT_NEAR(edited.value[i], turned.value[i], 0.006 * turned.value[0] + 0.01 * turned.value[i])
            << c.name << " " << i;
      EXPECT_GT(turned.value[0], 0.1);
    }
  }
}

// Claim: walks from the eye and from the light see one bsdf.
TEST_P(EditedClosures, AreOneBsdfInBothModes) {
  const auto e = make(GetParam());
  rng::Stream stream(rng::key(21));
  int compared = 0;
  double largest = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vec3 o = test::uniform_direction(stream), l = test::uniform_direction(stream);
    const At eye(*e, o), light(*e, l);
    float pdf = 0;
    const Spectrum from_eye = eye.value(eye.edited, o, l, kRadiance, pdf),
                   from_light = light.value(light.edited, l, o, kImportance, pdf);
    const double a = static_cast<double>(from_eye.g) * eye.geometric(o),
                 b = static_cast<double>(from_light.g) * eye.geometric(l);
    if (a == 0 && b == 0) continue;
    ++compared;
    largest = std::max(largest, std::abs(a - b) / (a + b + 1e-4));
    EXPECT_NEAR(a, b, 2e-3 * (a + b) + 1e-5) << i;
  }
  EXPECT_GT(compared, 100);
}

// A grid over the sphere whose cells have one size, and each 20 x 20 of those of over_sphere().
constexpr std::size_t kCellRows = 10, kCellColumns = 12, kCells = kCellRows * kCellColumns;
std::size_t cell_of(Vec3 w) {
  const auto part = [](double x, std::size_t count) {
    return std::min(static_cast<std::size_t>(std::max(0.0, x * static_cast<double>(count))), count - 1);
  };
  const double turn = std::atan2(static_cast<double>(w.z), static_cast<double>(w.y)) / (2 * std::numbers::pi);
  return part((static_cast<double>(w.x) + 1) / 2, kCellRows) * kCellColumns +
         part(turn < 0 ? turn + 1 : turn, kCellColumns);
}

// Claim: samples of an edited surface have the density that it tells, in both modes, and weights that bring
// its value: sums over samples are the integrals, and directions fall into cells of the sphere as the density
// has it (chi-squared). Fails by chance with probability below 1e-5 for each of the 640 sums, and below 1e-6
// for each of the 72 tests of cells.
TEST_P(EditedClosures, DrawWhatTheyTell) {
  const Case& c = GetParam();
  const auto e = make(c);
  constexpr int kSamples = 8000;
  for (const TransportMode mode : {kRadiance, kImportance})
    for (const Vec3 wo : directions_from()) {
      const At at(*e, wo);
      Sums exact;
      std::vector<double> expected(kCells + 1), observed(kCells + 1);  // the last: nothing is drawn
      over_sphere([&](Vec3 w, double area) {
        float pdf = 0;
        const Spectrum v = at.value(at.edited, wo, w, mode, pdf);
        exact.add(w, static_cast<double>(v.r), static_cast<double>(pdf), area);
        expected[cell_of(w)] += static_cast<double>(pdf) * area * kSamples;
      });
      expected[kCells] = std::max(0.0, 1 - exact.pdf) * kSamples;
      rng::Stream stream(rng::key(31));
      std::array<double, kTests> mean{}, squares{};
      double drawn = 0;
      for (int i = 0; i < kSamples; ++i) {
        const float u_lobe = stream.next_float(), u = stream.next_float(), v = stream.next_float();
        BsdfSample s;
        const bool any = at.edited.sample(wo, u_lobe, {u, v}, mode, s);
        observed[any ? cell_of(s.wi) : kCells] += 1;
        if (!any) continue;
        ASSERT_FALSE(s.delta);
        drawn += 1;
        float pdf = 0;
        const Spectrum value = at.edited.eval_pdf(wo, s.wi, mode, pdf);
        EXPECT_NEAR(pdf / s.pdf_solid_angle, 1, 2e-3);
        EXPECT_NEAR(s.weight.r * s.pdf_solid_angle, value.r, 4e-3f * value.r + 1e-5f);
        const auto t = tests_of(s.wi);
        const float correct = mode == kRadiance ? 1.0f : at.correction(wo, s.wi);
        for (std::size_t k = 0; k < kTests; ++k) {
          const double x = static_cast<double>(s.weight.r * correct) * t[k];
          mean[k] += x / kSamples;
          squares[k] += x * x / kSamples;
        }
      }
      const double fraction = drawn / kSamples;
      EXPECT_NEAR(fraction, exact.pdf, 4.5 * std::sqrt(fraction * (1 - fraction) / kSamples) + 6e-3)
          << c.name;
      EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6)
          << c.name << " mode " << static_cast<int>(mode);
      for (std::size_t k = 0; k < kTests; ++k)
        EXPECT_NEAR(
            mean[k], exact.value[k],
            4.5 * std::sqrt(std::max(0.0, squares[k] - mean[k] * mean[k]) / kSamples) + 6e-3 * exact.value[0])
            << c.name << " " << k << " mode " << static_cast<int>(mode);
    }
}

INSTANTIATE_TEST_SUITE_P(, EditedClosures, testing::ValuesIn(cases()),
                         [](const auto& one) { return one.param.name; });

// ---- branches ----

// Claim: a direction of the target alone was reached by light that was moved and by light that always went
// there; one of the source alone by none; one of both by the moved; one of neither by the original. Each is
// one term.
TEST(EditBranches, AreMovedAndOriginalLight) {
  // Turned about the normal by 90 degrees, from a cone around +x to one around +y.
  const Case c{
      "", kDiffuse,
      R"({"name": "a", "direction": "light", "select": "LX*X", "source": "cone", "rotate": {"axis": [0, 0, 1], "degrees": 90}})"};
  auto e = std::make_unique<Edited>();
  e = make({"", kDiffuse, kTurn});
  e->hit.shading = make_frame({0, 0, 1});
  e->hit.ng = {0, 0, 1};
  e->hit.p = {0, 0, 0};
  const auto list =
      edits::parse_edits(R"({"regions": {"cone": {"sphere": [1, 0, 1, 0.3]}}, "edits": [)" + c.edits + "]}");
  ASSERT_TRUE(list.ok()) << list.error().to_string();
  e->scene.edits[0].map = direction_map(list->edits[0]);
  e->scene.edits[0].cone = cone_of(*list, list->edits[0]);
  const Vec3 light = e->hit.shading.to_local(normalize(Vec3{0.1f, 0.2f, 1}));
  const At at(*e, light);
  const auto times = [&](Vec3 world) {
    const Vec3 o = e->hit.shading.to_local(normalize(world));
    float pdf = 0;
    return at.edited.eval_pdf(light, o, kImportance, pdf).r / at.plain.eval_pdf(light, o, kImportance, pdf).r;
  };
  EXPECT_NEAR(times({0, 1, 1}), 2, 1e-4);   // of the target
  EXPECT_EQ(times({1, 0, 1}), 0);           // of the source
  EXPECT_NEAR(times({-1, 0, 1}), 1, 1e-6);  // of neither
  // A wider cone: the source and its image overlap between them.
  e->scene.edits[0].cone.radius = 1.2;
  EXPECT_NEAR(times({1, 1, 1.4f}), 1, 1e-4);
}

// ---- delta lobes ----

struct DeltaOutcome {
  BsdfSample s;
  double share = 0;  // of numbers u_lobe that bring it
};
// All outcomes of sample(), found by trying u_lobe throughout.
std::vector<DeltaOutcome> outcomes(const Closure& closure, Vec3 wo, TransportMode mode) {
  constexpr int kTries = 360;
  std::vector<DeltaOutcome> found;
  for (int i = 0; i < kTries; ++i) {
    BsdfSample s;
    if (!closure.sample(wo, (static_cast<float>(i) + 0.5f) / kTries, {0.5f, 0.5f}, mode, s) || !s.delta)
      continue;
    bool known = false;
    for (DeltaOutcome& o : found)
      if (dot(o.s.wi, s.wi) > 1 - 1e-6f && std::abs(o.s.prob - s.prob) < 1e-5f) {
        o.share += 1.0 / kTries;
        known = true;
        break;
      }
    if (!known) found.push_back({s, 1.0 / kTries});
  }
  return found;
}

// Claim: the list of delta lobes of an edited bsdf has what numbers bring, and nothing else.
TEST(EditedDeltaLobes, AreAllListed) {
  const std::string glass = "<bsdf type='dielectric'/>";
  const std::string mixed = "<bsdf type='blendbsdf'><float name='weight' value='0.4'/>" + glass +
                            "<bsdf type='roughplastic'/></bsdf>";
  std::size_t listed = 0;
  for (const std::string& bsdf : {std::string("<bsdf type='conductor'/>"), glass, mixed})
    for (const std::string& edits : {kTurn, kHighlight + "," + kSecond, kGather + "," + kMove})
      for (const TransportMode mode : {kRadiance, kImportance}) {
        const auto e = make({"", bsdf, edits});
        rng::Stream stream(rng::key(7));
        for (int i = 0; i < 12; ++i) {
          const Vec3 from = test::uniform_direction(stream);
          const At at(*e, from);
          const std::vector<DeltaOutcome> found = outcomes(at.edited, from, mode);
          std::size_t likely = 0;  // of the list; others may be missed by trying
          for (const DeltaLobe& lobe : delta_lobes(at.edited, from, mode)) {
            likely += lobe.prob > 0.01f;
            ++listed;
          }
          for (const DeltaOutcome& o : found) {
            std::size_t same = 0;
            for (const DeltaLobe& lobe : delta_lobes(at.edited, from, mode))
              same += dot(lobe.wi, o.s.wi) > 1 - 1e-6f && std::abs(lobe.prob - o.s.prob) < 1e-5f;
            EXPECT_EQ(same, 1u) << bsdf << edits;
          }
          EXPECT_GE(found.size(), likely);
        }
      }
  EXPECT_GT(listed, 100u);
}

// Claim: at mirrors and glass a walk from the light and the walk back carry the same light, by the change of
// solid angle that differences show; probabilities are what numbers bring, and the probability that one walk
// tells of the other is the other's own.
TEST(EditedDeltaLobes, AreTheSameFromBothSides) {
  for (const std::string& bsdf :
       {std::string("<bsdf type='conductor'/>"), std::string("<bsdf type='dielectric'/>")})
    for (const std::string& edits :
         {kTurn, kMove, kHighlight, kHighlight + "," + kSecond, kGather, kGather + "," + kMove})
      for (const bool bumpy : {false, true}) {
        const auto e = make({"", bsdf, edits, bumpy});
        rng::Stream stream(rng::key(5));
        int compared = 0;
        for (int i = 0; i < 24; ++i) {
          Vec3 from = test::uniform_direction(stream);
          if (bsdf.find("dielectric") == std::string::npos) from.z = std::abs(from.z);
          const At light(*e, from);
          for (const DeltaOutcome& there : outcomes(light.edited, from, kImportance)) {
            const Vec3 to = there.s.wi;
            EXPECT_NEAR(there.share, static_cast<double>(there.s.prob), 0.009);
            // The same outcome of directions beside `from`: how it stretches the solid angle.
            const Frame around = make_frame(from);
            const float h = 4e-3f;
            const auto sent_from = [&](Vec3 v, Vec3& out) {
              const At near(*e, v);
              for (const DeltaOutcome& o : outcomes(near.edited, v, kImportance))
                if (dot(o.s.wi, to) > 1 - 1e-3f && std::abs(o.s.eta - there.s.eta) < 1e-3f) {
                  out = o.s.wi;
                  return true;
                }
              return false;
            };
            Vec3 a, b, p, q;
            if (!sent_from(normalize(from + around.s * h), a) ||
                !sent_from(normalize(from - around.s * h), b) ||
                !sent_from(normalize(from + around.t * h), p) ||
                !sent_from(normalize(from - around.t * h), q))
              continue;
            const double stretched =
                static_cast<double>(length(cross((a - b) * (1 / (2 * h)), (p - q) * (1 / (2 * h)))));
            const At eye(*e, to);
            const DeltaOutcome* back = nullptr;
            const auto all = outcomes(eye.edited, to, kRadiance);
            for (const DeltaOutcome& o : all)
              if (dot(o.s.wi, from) > 1 - 1e-5f) back = &o;
            if (stretched > 20 || stretched < 0.05) continue;
            if (back == nullptr) continue;  // at the rim of a cone, or lost to rounding
            ++compared;
            const double cos_from = light.geometric(from), cos_to = light.geometric(to);
            const double eta2 = static_cast<double>(there.s.eta) * static_cast<double>(there.s.eta);
            const double forward = static_cast<double>(there.s.weight.g * there.s.prob) *
                                   static_cast<double>(light.correction(from, to)),
                         backward = static_cast<double>(back->s.weight.g * back->s.prob);
            // f |o.g| |i.g|, seen from both.
            const double seen_from_light = forward * cos_from, seen_from_eye = backward * cos_to * stretched;
            EXPECT_NEAR(seen_from_eye / seen_from_light, 1, 0.03) << bsdf << edits << bumpy;
            // Densities: what Walk::scatter makes of them.
            const double told = static_cast<double>(there.s.prob_reverse) / eta2 * cos_from / cos_to,
                         told_back = static_cast<double>(back->s.prob_reverse) * eta2 * cos_to / cos_from;
            EXPECT_NEAR(told * told_back / static_cast<double>(there.s.prob * back->s.prob), 1, 1e-3)
                << bsdf << edits << bumpy;
            if (!bumpy) {
              EXPECT_NEAR(told / (static_cast<double>(back->s.prob) * stretched), 1, 0.03) << bsdf << edits;
            }
          }
        }
        EXPECT_GT(compared, 5) << bsdf << edits << bumpy;
      }
}

}  // namespace
}  // namespace candela::scene
