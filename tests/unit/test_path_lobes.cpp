// Claim: delta_lobes() lists all delta lobes of a closure and nothing else: those that walks take, with their
// probabilities, fractions and directions, in nested and turned bsdfs too. (Of edited bsdfs: unit_edits.)
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/delta_lobes.h"

namespace candela::scene {
namespace {

const std::string kGlass = "<bsdf type='dielectric'/>", kMirror = "<bsdf type='conductor'/>",
                  kPane = "<bsdf type='thindielectric'/>", kPlastic = "<bsdf type='plastic'/>",
                  kMatt = "<bsdf type='diffuse'/>";
std::string blend(const std::string& a, const std::string& b, double weight) {
  return fmt::format("<bsdf type='blendbsdf'><float name='weight' value='{}'/>{}{}</bsdf>", weight, a, b);
}
std::string mask(const std::string& a) {
  return "<bsdf type='mask'><float name='opacity' value='0.3'/>" + a + "</bsdf>";
}
std::string two(const std::string& a) {
  return "<bsdf type='twosided'>" + a + "</bsdf>";
}
std::string coat(const std::string& type, const std::string& a) {
  return "<bsdf type='" + type + "'>" + a + "</bsdf>";
}
std::string turned(const std::string& a) {
  return "<bsdf type='normalmap'><rgb name='normalmap' value='0.62, 0.41, 0.97'/>" + a + "</bsdf>";
}

struct Case {
  std::string bsdf;
  std::size_t most;  // lobes
};

TEST(DeltaLobes, AreAllThatWalksTake) {
  const std::vector<Case> cases = {
      {kMatt, 0},
      {kGlass, 2},
      {two(kMirror), 1},
      {kPane, 2},
      {"<bsdf type='null'/>", 1},
      {"<bsdf type='hk'/>", 1},
      {kPlastic, 1},
      {two(kPlastic), 1},
      {"<bsdf type='roughconductor'/>", 0},
      {blend(kGlass, kPane, 0.3), 4},
      {blend(blend(kGlass, kMatt, 0.1), blend(kPane, two(kMirror), 0.7), 0.45), 5},
      {mask(kPlastic), 2},
      {mask(blend(kMatt, kGlass, 0.002)), 3},
      {coat("coating", kMirror), 2},
      {coat("coating", kPlastic), 2},
      {coat("coating", coat("coating", kMirror)), 3},
      {coat("roughcoating", kMirror), 1},
      {coat("roughcoating", blend(kMatt, kMirror, 0.5)), 1},
      {turned(kGlass), 4},
      {turned(blend(kMatt, kPane, 0.8)), 4},
      {blend(turned(kMirror), kGlass, 0.6), 4}};
  rng::Stream stream(rng::key(46, 120));
  for (const Case& c : cases) {
    SCOPED_TRACE(c.bsdf);
    const test::TextFiles text(
        {{"scene.xml", fmt::format("<scene version='3.0.0'><sensor type='perspective'/><shape "
                                   "type='sphere'>{}</shape></scene>",
                                   c.bsdf)}});
    const auto parsed = description::parse_scene(text, "scene.xml", {});
    ASSERT_TRUE(parsed.ok()) << parsed.error().to_string();
    TextureStore textures(text);
    const auto bsdf =
        Bsdf::build(*parsed->scene->children_of("shape")[0]->children_of("bsdf").at(0), textures);
    ASSERT_TRUE(bsdf.ok()) << bsdf.error().to_string();
    SurfaceHit hit;
    hit.shading = make_frame({0, 0, 1});
    hit.ng = {0, 0, 1};
    std::size_t largest = 0;
    for (int n = 0; n < 40; ++n) {
      const Vec3 wo = test::uniform_direction(stream);
      for (const TransportMode mode : {TransportMode::radiance, TransportMode::importance}) {
        ClosureArena arena;
        Closure closure;
        bsdf->prepare(hit, wo, arena, closure);
        const std::vector<DeltaLobe> lobes = delta_lobes(closure, wo, mode);
        largest = std::max(largest, lobes.size());
        // Walks with evenly spread choices take each lobe as often as its probability says.
        std::vector<int> taken(lobes.size());
        constexpr int kWalks = 8192;
        for (int i = 0; i < kWalks; ++i) {
          BsdfSample sample;
          const float u = (static_cast<float>(i) + 0.5f) / kWalks;
          if (!closure.sample(wo, u, {0.5f, 0.5f}, mode, sample) || !sample.delta) continue;
          bool known = false;
          for (std::size_t k = 0; k < lobes.size() && !known; ++k) {
            const DeltaLobe& lobe = lobes[k];
            known = lobe.wi == sample.wi && lobe.prob == sample.prob && lobe.straight == sample.straight &&
                    lobe.transmitted == sample.transmitted && lobe.eta == sample.eta &&
                    lobe.prob_reverse == sample.prob_reverse && lobe.value == sample.weight * sample.prob;
            taken[k] += known;
          }
          EXPECT_TRUE(known) << "a lobe of probability " << sample.prob << " is not listed";
        }
        for (std::size_t k = 0; k < lobes.size(); ++k) {
          int same = 0;  // lobes that cannot be told apart share what is taken
          int sum = 0;
          for (std::size_t j = 0; j < lobes.size(); ++j)
            if (lobes[j].wi == lobes[k].wi && lobes[j].prob == lobes[k].prob) {
              ++same;
              sum += taken[j];
            }
          EXPECT_NEAR(sum, kWalks * static_cast<double>(lobes[k].prob) * same, 1.5 * same + 1);
        }
      }
    }
    EXPECT_LE(largest, c.most);
    EXPECT_EQ(largest == 0, c.most == 0);
  }
}

}  // namespace
}  // namespace candela::scene
