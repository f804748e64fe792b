// Claims: trials choose the step sizes that chains move farthest with: wide ones over an even wall, narrow
// ones within a small patch of light, and in slopes those that the theory has for one lobe; the choice does
// not depend on threads; a mutation of any size has the density of its own proposals.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "worker/integrators/chains/step_sizes.h"
#include "worker/mcmc/step_trials.h"

namespace candela::mcmc {
namespace {

constexpr std::uint32_t kWide = 128;  // pixels

std::unique_ptr<scene::Scene> scene_of(const std::string& body) {
  scene::Scene::Options options;
  options.film_width = options.film_height = kWide;
  auto scene = test::build_scene(body, {}, "", options);
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return std::move(scene).value();
}
MutatorContext context_of(const scene::Scene& scene, std::uint32_t max_edges = 2) {
  MutatorContext context{scene};
  context.film_width = context.film_height = kWide;
  context.max_edges = max_edges;
  return context;
}
MutatorShare share_of(std::string_view name) {
  for (const MutatorEntry& entry : mutators())
    if (entry.name == name) return {&entry, 1, {}};
  ADD_FAILURE() << name;
  return {};
}

std::string wall(const std::string& bsdf) {
  return "<shape type='rectangle'><transform name='to_world'><scale value='40'/><translate "
         "z='5'/></transform>"
         "<bsdf type='twosided'>" +
         bsdf + "</bsdf></shape>";
}
const std::string kMatt = "<bsdf type='diffuse'/>";

StepSize chosen(const MutatorContext& context, std::string_view name, std::uint32_t threads = 2) {
  const MutatorShare share = share_of(name);
  integrators::Plan plan;
  integrators::RunContext run;
  run.threads = threads;
  const auto sizes = integrators::chain_jobs::choose_step_sizes(context, std::span(&share, 1), nullptr, 46,
                                                                12800, plan, run);
  EXPECT_TRUE(sizes.ok());
  EXPECT_EQ(sizes->size(), 1u);
  EXPECT_NE(plan.to_text().find("steps of " + std::string(name)), std::string::npos) << plan.to_text();
  return sizes->front();
}

// Claim: the film position takes wide steps where light is even, and narrow ones where a lamp lights few
// pixels.
TEST(StepTrials, FollowTheLightOnTheFilm) {
  const auto even = scene_of(wall(kMatt) + "<emitter type='constant'/>");
  const auto narrow = scene_of(wall(kMatt) +
                               "<emitter type='spot'><transform name='to_world'><lookat origin='0, 0, 0' "
                               "target='0, 0, 5' up='0, 1, 0'/></transform><float name='cutoff_angle' "
                               "value='0.8'/></emitter>");
  EXPECT_GT(chosen(context_of(*even), "lens").image, 1);
  EXPECT_LT(chosen(context_of(*narrow), "lens").image, 1);
}

// Claim: of one lobe the best step of slopes is the largest that is tried, 1.7 [half-vector note, section 9]:
// smaller ones move less, whatever their acceptance.
TEST(StepTrials, FollowTheRoughnessOfALobe) {
  const auto metal = scene_of(wall("<bsdf type='roughconductor'><float name='alpha' value='0.01'/></bsdf>") +
                              "<emitter type='directional'><vector name='direction' x='0' y='0.05' z='1'/>"
                              "</emitter>");
  EXPECT_EQ(chosen(context_of(*metal), "half_vector").roughness, 1.7);
}

// Claim: threads do not change the scores, and so neither the choice.
TEST(StepTrials, AreTheSameOnAnyNumberOfThreads) {
  const auto scene = scene_of(wall(kMatt) + "<emitter type='constant'/>");
  for (const std::string_view name : {"lens", "half_vector"})
    EXPECT_EQ(chosen(context_of(*scene, 4), name, 1), chosen(context_of(*scene, 4), name, 3)) << name;
}

// Claim: without light, and without a mutation that has steps, there is nothing to choose: the sizes are the
// default ones.
TEST(StepTrials, KeepTheDefaultWithoutEvidence) {
  const auto dark = scene_of(wall(kMatt));
  EXPECT_EQ(chosen(context_of(*dark), "caustic"), StepSize());
  const std::vector<MutatorShare> shares{share_of("bidirectional"), share_of("lens")};
  EXPECT_EQ(StepTrials(context_of(*dark), shares).score_count(), sizes_of_trials(*shares[1].entry).size());
  std::vector<StepScore> scores(sizes_of_trials(*shares[1].entry).size());
  scores.back() = {3, 2};
  const std::vector<StepSize> best = best_sizes(shares, scores);
  EXPECT_EQ(best.front(), StepSize());
  EXPECT_EQ(best.back(), sizes_of_trials(*shares[1].entry).back());
}

// Claim: of sums of moves those for the same rays count.
TEST(StepTrials, CountTheWork) {
  const std::vector<MutatorShare> shares{share_of("lens")};
  std::vector<StepScore> scores(sizes_of_trials(*shares[0].entry).size());
  scores[1] = {8, 8};
  scores[2] = {7, 2};
  EXPECT_EQ(best_sizes(shares, scores).front(), sizes_of_trials(*shares[0].entry)[2]);
}

// Claim: each size has the density of its own proposals: what it makes it can make, and can take back unless
// the range of steps of the way back is another.
TEST(StepTrials, SizesHaveTheirDensities) {
  const auto scene = scene_of(
      wall(kMatt) +
      "<shape type='sphere'><point name='center' x='0' y='0' z='3'/><float name='radius' value='0.8'/>"
      "<bsdf type='roughconductor'><float name='alpha' value='0.2'/></bsdf></shape><emitter "
      "type='constant'/>");
  const MutatorContext context = context_of(*scene, 3);
  std::vector<MutatorEntry> entries(mutators().begin(), mutators().end());
  for (const MutatorPreset& preset : mutator_presets())
    entries.insert(entries.end(), preset.mutations.begin(), preset.mutations.end());
  PathSpace space(context, std::vector<MutatorShare>{share_of("bidirectional")});
  SplatList list;
  for (const MutatorEntry& entry : entries)
    for (const StepSize& size : sizes_of_trials(entry)) {
      const auto mutator = entry.make(context, size);
      int made = 0, undone = 0;
      for (std::uint64_t key = 0; key < 20000 && made < 20; ++key) {
        space.start(rng::key(46, 47, key), list);
        if (space.present() == nullptr) continue;
        const PathState& from = *space.present();
        if (!(mutator->suitability(from) > 0)) continue;
        rng::Stream stream(rng::key(46, 48, key));
        const Proposal proposal = mutator->propose(from, stream);
        if (!proposal) continue;
        const auto to = path_state(*scene, *proposal, context.rules());
        if (!to) continue;
        ++made;
        EXPECT_TRUE(mutator->log_pdf_area(from, *to)) << entry.name << " " << size.image;
        if (mutator->log_pdf_area(*to, from)) ++undone;
        const bool has_steps = sizes_of_trials(entry).size() > 1;
        EXPECT_EQ(mutator->squared_move(from, *to) > 0, has_steps) << entry.name;
      }
      EXPECT_GE(made, entry.name == "lens" || entry.name == "one_step" ? 10 : 0) << entry.name;
      EXPECT_GE(2 * undone, made) << entry.name << " " << size.image << " " << size.roughness;
    }
}

}  // namespace
}  // namespace candela::mcmc
