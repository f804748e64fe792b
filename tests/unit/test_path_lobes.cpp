// Claim: delta_lobes() lists all delta lobes of a closure and nothing else: those that walks take, with their
// probabilities, fractions and directions, in nested and turned bsdfs too. (Of edited bsdfs: unit_edits.)
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/unit/scene_fixture.h"
#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/delta_lobes.h"
#include "worker/scene/turning_lobes.h"

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

std::vector<Case> cases() {
  return {{kMatt, 0},
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
}

// The bsdf of this text, anywhere on a plane.
class Prepared {
 public:
  explicit Prepared(const std::string& xml)
      : text_({{"scene.xml", fmt::format("<scene version='3.0.0'><sensor type='perspective'/><shape "
                                         "type='sphere'>{}</shape></scene>",
                                         xml)}}),
        textures_(text_) {
    const auto parsed = description::parse_scene(text_, "scene.xml", {});
    if (!parsed.ok()) throw std::runtime_error(parsed.error().to_string());
    auto built = Bsdf::build(*parsed->scene->children_of("shape")[0]->children_of("bsdf").at(0), textures_);
    if (!built.ok()) throw std::runtime_error(built.error().to_string());
    bsdf_ = std::make_unique<Bsdf>(std::move(*built));
  }
  // Valid until the next call.
  const Closure& at(Vec3 wo) {
    SurfaceHit hit;
    hit.shading = make_frame({0, 0, 1});
    hit.ng = {0, 0, 1};
    arena_.clear();
    closure_ = {};
    bsdf_->prepare(hit, wo, arena_, closure_);
    return closure_;
  }

 private:
  test::TextFiles text_;
  TextureStore textures_;
  std::unique_ptr<Bsdf> bsdf_;
  ClosureArena arena_;
  Closure closure_;
};

TEST(DeltaLobes, AreAllThatWalksTake) {
  rng::Stream stream(rng::key(46, 120));
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.bsdf);
    Prepared bsdf(c.bsdf);
    std::size_t largest = 0;
    for (int n = 0; n < 40; ++n) {
      const Vec3 wo = test::uniform_direction(stream);
      for (const TransportMode mode : {TransportMode::radiance, TransportMode::importance}) {
        const Closure& closure = bsdf.at(wo);
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
            known = lobe.wi == sample.wi && lobe.prob == sample.prob &&
                    lobe.passthrough == sample.passthrough && lobe.transmitted == sample.transmitted &&
                    lobe.eta == sample.eta && lobe.prob_reverse == sample.prob_reverse &&
                    lobe.value == sample.weight * sample.prob;
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

// Claim: the list of lobes that turn light has what all delta lobes send anywhere: whatever the numbers, if
// they have at most two directions; in the mean over the numbers, if they have more.
TEST(TurningLobes, SendWhatAllLobesSend) {
  const auto weigh = [](Vec3 wi, std::size_t i) {
    const auto at = static_cast<float>(i);
    return 1 + std::sin(3 * wi.x + at) * std::cos(2 * wi.y - at) + (wi.z > 0 ? 0.4f * at : 0.0f);
  };
  rng::Stream stream(rng::key(45, 20));
  int two = 0, more = 0;
  std::vector<Case> all_cases = cases();
  const std::string water = "<bsdf type='dielectric'><string name='int_ior' value='water'/></bsdf>";
  all_cases.push_back({blend(kGlass, water, 0.3), 4});
  all_cases.push_back({blend(blend(kGlass, turned(kMirror), 0.8), water, 0.5), 5});
  for (const Case& c : all_cases) {
    SCOPED_TRACE(c.bsdf);
    Prepared bsdf(c.bsdf);
    for (int n = 0; n < 20; ++n) {
      const Vec3 wo = test::uniform_direction(stream);
      for (const TransportMode mode : {TransportMode::radiance, TransportMode::importance}) {
        const Closure& closure = bsdf.at(wo);
        std::vector<Vec3> directions;
        double all[3] = {};
        for (const DeltaLobe& lobe : delta_lobes(closure, wo, mode)) {
          if (lobe.passthrough) continue;
          for (std::size_t i = 0; i < 3; ++i)
            all[i] += static_cast<double>(luminance(lobe.value) * weigh(lobe.wi, i));
          bool known = false;
          for (const Vec3& w : directions) known |= dot(w, lobe.wi) > 1 - 1e-6f;
          if (!known) directions.push_back(lobe.wi);
        }
        constexpr int kNumbers = 4096;
        double mean[3] = {};
        for (int k = 0; k < kNumbers; ++k) {
          double sum[3] = {};
          const float u = (static_cast<float>(k) + 0.5f) / kNumbers;
          for (const TurningLobe& lobe : turning_lobes(closure, wo, u, {0.5f, 0.5f}, mode))
            for (std::size_t i = 0; i < 3; ++i)
              sum[i] += static_cast<double>(luminance(lobe.attenuation) * weigh(lobe.wi, i));
          for (std::size_t i = 0; i < 3; ++i) {
            mean[i] += sum[i] / kNumbers;
            if (directions.size() <= 2) {
              EXPECT_NEAR(sum[i], all[i], 2e-5 * (1 + all[i]));
            }
          }
          if (directions.size() <= 2 && k > 16) break;
        }
        for (std::size_t i = 0; directions.size() > 2 && i < 3; ++i)
          EXPECT_NEAR(mean[i], all[i], 2e-3 * (1 + all[i]));
        two += directions.size() == 2;
        more += directions.size() > 2;
      }
    }
  }
  EXPECT_GT(two, 100);
  EXPECT_GT(more, 40);
}

}  // namespace
}  // namespace candela::scene
