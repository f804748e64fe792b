// The diffuse part of a bsdf, as layers by light path expressions ask for it.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "common/rng/stream.h"
#include "scene_fixture.h"
#include "worker/core/warp.h"
#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/rough_transmittance.h"
#include "worker/scene/textures/texture.h"

namespace candela::test {
namespace {

using scene::Closure;
using scene::TransportMode;

// A bsdf from its XML, at one place.
class Prepared {
 public:
  explicit Prepared(const std::string& xml)
      : files_(
            {{"scene.xml", "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"sphere\">" +
                               xml + "</shape></scene>"}}),
        textures_(files_, {}, nullptr) {
    const auto description = description::parse_scene(files_, "scene.xml", {});
    if (!description.ok()) throw std::runtime_error(description.error().to_string());
    const auto shapes = description->scene->children_of("shape");
    auto built = scene::Bsdf::build(*shapes.at(0)->children_of("bsdf").at(0), textures_);
    if (!built.ok()) throw std::runtime_error(built.error().to_string());
    bsdf_ = std::make_unique<scene::Bsdf>(std::move(*built));
  }
  // Valid until the next call.
  Closure at(Vec3 wo) {
    scene::SurfaceHit hit;
    hit.shading = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    hit.ng = {0, 0, 1};
    hit.uv = {0.3f, 0.6f};
    hit.dp_du = {1, 0, 0};
    hit.dp_dv = {0, 1, 0};
    arena_.clear();
    Closure closure;
    bsdf_->prepare(hit, wo, arena_, closure);
    return closure;
  }

 private:
  TextFiles files_;
  scene::TextureStore textures_;
  std::unique_ptr<scene::Bsdf> bsdf_;
  scene::ClosureArena arena_;
};

// `xml` with `glossy` in the place of $; and with `none`: the same bsdf whose glossy lobes reflect nothing.
struct Pair {
  std::string xml, glossy, none;
  std::string with(const std::string& lobes) const {
    std::string text = xml;
    text.replace(text.find('$'), 1, lobes);
    return text;
  }
};
const std::string kNoMirror = "<rgb name='specular_reflectance' value='0 0 0'/>";
const std::string kRough = "<float name='alpha' value='0.15'/>";

const std::vector<Pair>& pairs() {
  static const std::vector<Pair> all = {
      {"<bsdf type='phong'>$<float name='exponent' value='200'/></bsdf>", "", kNoMirror},
      {"<bsdf type='ward'>$<float name='alpha_u' value='0.1'/><float name='alpha_v' value='0.2'/></bsdf>", "",
       kNoMirror},
      {"<bsdf type='roughplastic'>" + kRough + "$</bsdf>", "", kNoMirror},
      {"<bsdf type='twosided'><bsdf type='roughplastic'>" + kRough + "$</bsdf></bsdf>", "", kNoMirror},
      {"<bsdf type='roughcoating'>" + kRough + "$<bsdf type='diffuse'/></bsdf>", "", kNoMirror},
      {"<bsdf type='coating'><bsdf type='roughplastic'>" + kRough + "$</bsdf></bsdf>", "", kNoMirror},
      {"<bsdf type='mask'><float name='opacity' value='0.6'/><bsdf type='roughplastic'>" + kRough +
           "$</bsdf></bsdf>",
       "", kNoMirror},
      {"<bsdf type='normalmap'><rgb name='normalmap' value='0.6 0.5 0.9'/><bsdf type='roughplastic'>" +
           kRough + "$</bsdf></bsdf>",
       "", kNoMirror},
      {"<bsdf type='blendbsdf'><float name='weight' value='0.3'/><bsdf type='diffuse'/>$</bsdf>",
       "<bsdf type='roughconductor'>" + kRough + "</bsdf>",
       "<bsdf type='diffuse'><rgb name='reflectance' value='0 0 0'/></bsdf>"},
      {"<bsdf type='principled'><float name='roughness' value='0.4'/><float name='sheen' "
       "value='0.5'/>$</bsdf>",
       "<float name='specular' value='0.5'/><float name='clearcoat' value='0.7'/>",
       "<float name='specular' value='0'/><float name='clearcoat' value='0'/>"},
  };
  return all;
}

// Claim: with lobes below the bound counted as glossy the rest is the bsdf without them; with none counted it
// is all of the bsdf, to the bit. Seen from both sides, in both modes.
TEST(Lobes, DiffuseIsWhatIsLeftWithoutGlossyLobes) {
  rng::Stream stream(7);
  for (const Pair& pair : pairs()) {
    Prepared whole(pair.with(pair.glossy)), rest(pair.with(pair.none));
    double glossy_share = 0;
    for (int i = 0; i < 400; ++i) {
      const auto direction = [&] {
        const Vec3 up = warp::cosine_hemisphere({stream.next_float(), stream.next_float()});
        return stream.next_float() < 0.2f ? Vec3{up.x, up.y, -up.z} : up;
      };
      const Vec3 wo = direction();
      // Half of them near the mirror direction.
      Vec3 wi = direction();
      if (i % 2 == 0) wi = normalize(Vec3{-wo.x, -wo.y, wo.z} + wi * 0.1f);
      const TransportMode mode = i % 4 < 2 ? TransportMode::radiance : TransportMode::importance;
      const Closure closure = whole.at(wo);
      const Spectrum all = closure.eval(wo, wi, mode);
      const Spectrum none_counted = closure.eval_diffuse(wo, wi, mode, 0);
      EXPECT_TRUE(all.r == none_counted.r && all.g == none_counted.g && all.b == none_counted.b) << pair.xml;
      const Spectrum diffuse = closure.eval_diffuse(wo, wi, mode, 0.5f);
      const Spectrum expected = rest.at(wo).eval(wo, wi, mode);
      EXPECT_NEAR(diffuse.r, expected.r, 2e-6f + 1e-5f * expected.r) << pair.xml << " at " << i;
      EXPECT_LE(diffuse.r, all.r * 1.00001f + 1e-7f) << pair.xml;
      if (all.r > 0) glossy_share = std::max(glossy_share, static_cast<double>(1 - diffuse.r / all.r));
    }
    EXPECT_GT(glossy_share, 0.2) << pair.xml;
  }
}

// Claim: bsdfs of one glossy lobe are diffuse from the bound on and glossy below; a diffuse one is diffuse.
TEST(Lobes, OneLobeIsOneOrTheOther) {
  const Vec3 wo = normalize(Vec3{0.3f, 0, 0.9f}), wi = normalize(Vec3{-0.25f, 0.1f, 0.9f});
  for (const char* xml : {"<bsdf type='roughconductor'><float name='alpha' value='0.2'/></bsdf>",
                          "<bsdf type='roughdielectric'><float name='alpha' value='0.2'/></bsdf>"}) {
    Prepared bsdf(xml);
    const Closure closure = bsdf.at(wo);
    const float all = closure.eval(wo, wi, TransportMode::radiance).r;
    EXPECT_GT(all, 0);
    EXPECT_EQ(closure.eval_diffuse(wo, wi, TransportMode::radiance, 0.19f).r, all) << xml;
    EXPECT_EQ(closure.eval_diffuse(wo, wi, TransportMode::radiance, 0.21f).r, 0) << xml;
  }
  Prepared matt("<bsdf type='diffuse'/>");
  const Closure closure = matt.at(wo);
  EXPECT_EQ(closure.eval_diffuse(wo, wi, TransportMode::radiance, 1).r,
            closure.eval(wo, wi, TransportMode::radiance).r);
}

}  // namespace
}  // namespace candela::test
