// mmlt's parts: one technique at a time is what bdpt makes of the same numbers, the choice of techniques
// covers all of them once, and lengths have the probabilities that are said of them.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "tests/integrators.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/scene_fixture.h"
#include "worker/integrators/mmlt/lengths.h"
#include "worker/integrators/mmlt/target.h"
#include "worker/render/renderer.h"

namespace candela::integrators {
namespace {

using ByTechnique = std::map<std::pair<std::uint32_t, std::uint32_t>, double>;

// Luminances by (s, t).
struct Recorder {
  ByTechnique found;
  static Spectrum sum() { return {}; }  // of eye paths: for letters, which nobody asks for
  void eye(const transport::Contribution& light, std::uint32_t s, std::uint32_t t) {
    found[{s, t}] += static_cast<double>(luminance(light.weighted()));
  }
  void light(const transport::Contribution& light, std::uint32_t s, std::uint32_t t, transport::FilmPosition,
             std::uint64_t, const transport::PathLetters*, const transport::ChannelLabels*) {
    found[{s, t}] += static_cast<double>(luminance(light.weighted()));
  }
};

template <class ChoiceT>
struct RecordConfig {
  static constexpr transport::EdgeContent kEdgeContent = transport::EdgeContent::media;
  static constexpr bool kLists = false;
  using Mis = transport::Balance;
  using Sampler = mcmc::PrimarySampler;
  using Sink = Recorder;
  using Choice = ChoiceT;
};

const char* const kSensor = R"(<sensor type="thinlens"><float name="fov" value="60"/>
  <float name="aperture_radius" value="1"/><float name="focus_distance" value="3"/></sensor>)";
// A lit room with everything that a technique may meet: glass, a mask, fog in a null box.
const char* const kRoom = R"(
  <shape type="sphere"><point name="center" x="0" y="0" z="2"/><float name="radius" value="9"/>
    <boolean name="flip_normals" value="true"/><bsdf type="diffuse"/></shape>
  <shape type="sphere"><point name="center" x="1" y="2" z="6"/><float name="radius" value="1.2"/>
    <emitter type="area"><rgb name="radiance" value="3"/></emitter></shape>
  <shape type="sphere"><point name="center" x="-1" y="0" z="4"/><bsdf type="dielectric"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="3"/><translate z="2.5"/></transform>
    <bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf>
  </shape>
  <shape type="cube"><transform name="to_world"><translate x="2" z="5"/></transform><bsdf type="null"/>
    <medium name="interior" type="homogeneous"><rgb name="sigma_t" value="0.5"/></medium></shape>)";

// Claim: of the same numbers, one technique finds to the last digits what bdpt's estimator finds by it among
// all others, for every technique of every length, also behind surfaces that pass light straight and in
// media.
TEST(IntegratorMmlt, OneTechniqueIsBdptsShare) {
  const auto scene = test::build_scene(kRoom, {}, kSensor);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const auto filter = film::PixelFilter::create("box", {});
  const UnitContext context{**scene, *filter, samplers::SamplerKind::independent, 1, 16, 16};
  const estimators::FilmDomain film(context.filter, context.width, context.height);
  constexpr std::uint32_t kMax = 6;
  // An estimator for each longest path: on its last edge what passes straight is no matter of chance.
  estimators::PathOptions options[kMax + 1];
  const estimators::Techniques techniques;
  film::SampleCounts sample_counts;
  Recorder all[kMax + 1], one;
  using Whole = estimators::Bidirectional<RecordConfig<estimators::EveryTechnique>>;
  std::vector<std::unique_ptr<Whole>> whole;
  for (std::uint32_t most = 0; most <= kMax; ++most) {
    options[most].max_depth = std::max(most, 1u);
    options[most].rr_depth = 1000;
    whole.push_back(std::make_unique<Whole>(**scene, options[most], techniques, estimators::one_of_each(film),
                                            all[most], sample_counts));
  }
  estimators::Bidirectional<RecordConfig<estimators::OneTechnique>> single(
      **scene, options[kMax], techniques, estimators::one_of_each(film), one, sample_counts);
  mcmc::PrimaryState numbers({});
  ByTechnique times;
  for (std::uint64_t key = 0; key < 20000; ++key) {
    numbers.start(rng::key(9, key));
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    mcmc::PrimarySampler& light = numbers.walk(mcmc::PrimaryState::light);
    const Ray ray = estimators::film_ray(**scene, film, eye).ray;
    for (std::uint32_t most = 1; most <= kMax; ++most) {
      all[most].found.clear();
      whole[most]->trace_light(light);
      whole[most]->trace_eye(ray, eye);
    }
    for (std::uint32_t edges = 1; edges <= kMax; ++edges) {
      const auto count = mmlt::techniques_of(edges, techniques);
      for (std::uint32_t choice = 0; choice < count.all(); ++choice) {
        const estimators::OneTechnique chosen = mmlt::technique(edges, count, choice);
        one.found.clear();
        single.choose(chosen);
        if (chosen.s > 1)
          single.trace_light(light);
        else
          single.no_light();
        if (chosen.t > 1) single.trace_eye(ray, eye);
        const std::pair key_of{chosen.s, chosen.t};
        for (const auto& [other, value] : one.found) ASSERT_EQ(other, key_of);
        const bool met = chosen.s == 0 || chosen.t == 0;  // light or lens, by a walk's last edge
        const double expected = all[met ? edges : kMax].found[key_of], found = one.found[key_of];
        ASSERT_NEAR(found, expected, 1e-5 * expected)
            << "s " << chosen.s << " t " << chosen.t << " key " << key;
        if (expected > 0) times[key_of] += 1;
      }
    }
  }
  // Every technique was met, but for those that rarely are: light that meets the lens.
  for (std::uint32_t edges = 1; edges <= kMax; ++edges)
    for (std::uint32_t s = 0; s <= edges; ++s) {
      if (edges == 1 && s > 0) continue;
      EXPECT_GT((times[{s, edges + 1 - s}]), 10) << s << " " << edges + 1 - s;
    }
  double lens = 0;
  for (const auto& [technique, count] : times) lens += technique.second == 0 ? count : 0;
  EXPECT_GT(lens, 10);
}

// Claim: what a chain of mmlt follows is the share of one technique, divided by the probability of its length
// and by that of one technique among those of the length: else b, and with it the picture, would be off by a
// factor. Deterministic; which length and technique it was is found by looking for the only share that fits.
TEST(IntegratorMmlt, TargetIsAShareOverItsProbability) {
  const auto scene = test::build_scene(kRoom, {}, kSensor);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const auto filter = film::PixelFilter::create("box", {});
  const UnitContext context{**scene, *filter, samplers::SamplerKind::independent, 1, 16, 16};
  const estimators::FilmDomain film(context.filter, context.width, context.height);
  constexpr std::uint32_t kMax = 4;
  estimators::PathOptions options;
  options.max_depth = kMax;
  options.rr_depth = 1000;
  const estimators::Techniques techniques;
  const mmlt::Lengths lengths(1, kMax);
  film::SampleCounts sample_counts;
  Recorder one;
  estimators::Bidirectional<RecordConfig<estimators::OneTechnique>> single(
      **scene, options, techniques, estimators::one_of_each(film), one, sample_counts);
  mmlt::Target<transport::EdgeContent::media> target(context, options, techniques, lengths, sample_counts);
  mcmc::PrimaryState numbers({});
  mcmc::SplatList list;
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> times;
  for (std::uint64_t key = 0; key < 40000; ++key) {
    numbers.start(rng::key(19, key));
    list.clear();
    target.evaluate(numbers, list);
    if (!(list.scalar() > 0)) continue;
    double nearest = 1;
    std::pair<std::uint32_t, std::uint32_t> which;
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    const Ray ray = estimators::film_ray(**scene, film, eye).ray;
    for (std::uint32_t edges = 1; edges <= kMax; ++edges) {
      const auto count = mmlt::techniques_of(edges, techniques);
      for (std::uint32_t choice = 0; choice < count.all(); ++choice) {
        const estimators::OneTechnique chosen = mmlt::technique(edges, count, choice);
        one.found.clear();
        single.choose(chosen);
        if (chosen.s > 1)
          single.trace_light(numbers.walk(mcmc::PrimaryState::light));
        else
          single.no_light();
        if (chosen.t > 1) single.trace_eye(ray, eye);
        const double share = one.found[{chosen.s, chosen.t}] / (chosen.t < 2 ? film.pixels() : 1);
        const double expected = share * count.all() / lengths.prob(edges);
        const double off = std::abs(expected / list.scalar() - 1);
        if (off < nearest) nearest = off, which = {chosen.s, chosen.t};
      }
    }
    ASSERT_LT(nearest, 1e-5) << "s " << which.first << " t " << which.second << " key " << key;
    ++times[which];
  }
  for (std::uint32_t edges = 2; edges <= kMax; ++edges)
    for (std::uint32_t s = 0; s <= edges; ++s)
      EXPECT_GT((times[{s, edges + 1 - s}]), 3) << s << " " << edges + 1 - s;
}

// Claim: whatever techniques run, choices number each of those that can make a path of this length once.
TEST(IntegratorMmlt, ChoicesCoverTechniquesOnce) {
  for (unsigned mask = 0; mask < 32; ++mask) {
    estimators::Techniques t;
    t.hit_light = (mask & 1) != 0;
    t.next_event = (mask & 2) != 0;
    t.connect = (mask & 4) != 0;
    t.light_image = (mask & 8) != 0;
    t.hit_lens = (mask & 16) != 0;
    for (std::uint32_t edges = 1; edges <= 9; ++edges) {
      std::set<std::uint32_t> expected, found;
      for (std::uint32_t s = 0; s <= edges + 1; ++s) {
        const bool runs = s == 0           ? t.hit_light
                          : edges == 1     ? false  // seen directly: by the eye's walk alone
                          : s == edges + 1 ? t.hit_lens
                          : s == edges     ? t.light_image
                          : s == 1         ? t.next_event
                                           : t.connect;
        if (runs) expected.insert(s);
      }
      // Paths of two edges: s = 1 is next event estimation, s = 2 the lens'.
      const auto count = mmlt::techniques_of(edges, t);
      for (std::uint32_t choice = 0; choice < count.all(); ++choice) {
        const estimators::OneTechnique chosen = mmlt::technique(edges, count, choice);
        EXPECT_EQ(chosen.s + chosen.t, edges + 1);
        EXPECT_TRUE(found.insert(chosen.s).second);
      }
      EXPECT_EQ(found, expected) << "mask " << mask << ", edges " << edges;
    }
  }
}

// Claim: probabilities of lengths sum to one, choose() follows them (chi-squared; false alarm 1e-6 each of
// four ranges) and says them, no length is left out, and the ends of [0, 1) are in range.
TEST(IntegratorMmlt, LengthsFollowTheirProbabilities) {
  for (const auto& [least, most] : {std::pair{1u, 1u}, {1u, 7u}, {3u, 40u}, {2u, 1000u}}) {
    const mmlt::Lengths lengths(least, most);
    double sum = 0;
    constexpr int kDraws = 400000;
    std::vector<double> expected, observed(most + 1 - least, 0.0);
    for (std::uint32_t k = least; k <= most; ++k) {
      EXPECT_GT(lengths.prob(k), 0.2 / (static_cast<double>(k) * k));
      sum += lengths.prob(k);
      expected.push_back(lengths.prob(k) * kDraws);
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    rng::Stream stream(least + most);
    for (int i = 0; i < kDraws; ++i) {
      const auto choice = lengths.choose(stream.next_double());
      ASSERT_TRUE(choice.edges >= least && choice.edges <= most);
      ASSERT_EQ(choice.prob, lengths.prob(choice.edges));
      ++observed[choice.edges - least];
    }
    EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6) << least << " to " << most;
    for (const double u : {0.0, 0.75 - 0x1p-53, 0.75, 1 - 0x1p-53}) {
      const auto choice = lengths.choose(u);
      EXPECT_TRUE(choice.edges >= least && choice.edges <= most) << u;
    }
  }
}

// Settings that contradict each other are refused where a job is made, not where it runs.
TEST(MarkovSettings, RefusedOnCompletion) {
  for (const std::string& integrator : test::chain_integrators()) {
    EXPECT_TRUE(render::complete_integrator_settings(integrator, {}, {{"chains", "8"}}).ok());
    const auto odd = render::complete_integrator_settings(integrator, {}, {{"chains", "7"}});
    ASSERT_FALSE(odd.ok());
    EXPECT_EQ(odd.error().kind, ErrorKind::usage);
    EXPECT_EQ(odd.error().field, "chains");
    const auto steps = render::complete_integrator_settings(integrator, {},
                                                            {{"step_least", "0.01"}, {"step_most", "0.001"}});
    ASSERT_FALSE(steps.ok());
    EXPECT_EQ(steps.error().field, "step_least");
  }
}

}  // namespace
}  // namespace candela::integrators
