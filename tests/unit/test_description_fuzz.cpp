// Mutated scenes: whatever the bytes, the answer is a scene or one error.
#include <gtest/gtest.h>

#include <chrono>

#include "common/description/reading.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

constexpr std::string_view seed_scene = R"(<?xml version="1.0"?>
<scene version="3.0.0">
  <default name="spp" value="16"/> <default name="kind" value="path"/>
  <integrator type="$kind"><integer name="max_depth" value="-1"/></integrator>
  <path value="parts"/>
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><rotate y="1" angle="30"/><lookat origin="0,1,5" target="0 0 0" up="0,1,0"/></transform>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
    <film type="hdrfilm"><integer name="width" value="64"/><rfilter type="tent"/></film></sensor>
  <bsdf type="twosided" id="wall"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">
    <string name="filename" value="image.png"/><transform name="to_uv"><scale x="2" y="3"/></transform></texture></bsdf></bsdf>
  <bsdf type="roughconductor" id="metal"><float name="alpha" value="0.1"/><rgb name="eta" value="1, 2, 3"/></bsdf>
  <alias id="metal" as="steel"/>
  <include filename="part.xml"/>
  <shape type="obj"><string name="filename" value="mesh.obj"/><ref id="wall"/></shape>
  <shape type="sphere"><point name="center" x="0" y="1" z="2"/><ref id="steel"/>
    <emitter type="area"><rgb name="radiance" value="#ff8800"/></emitter></shape>
  <bsdf type="diffuse"><spectrum name="reflectance" value="400:0.1, 500:0.25, 650.5:0.9"/></bsdf>
  <bsdf type="conductor"><string name="material" value="Au"/></bsdf>
  <bsdf type="conductor"><spectrum name="eta" filename="eta.spd"/></bsdf>
  <emitter type="point"><spectrum name="intensity" type="blackbody"><float name="temperature" value="5000"/></spectrum></emitter>
  <emitter type="directional"><spectrum name="irradiance" type="irregular"><string name="wavelengths" value="400, 700"/>
    <string name="values" value="1, 2"/></spectrum></emitter>
  <emitter type="constant"><spectrum name="radiance" value="0.5"/></emitter>
</scene>)";

// A small generator of its own, so that the mutations are the same everywhere (SplitMix64).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::size_t below(std::size_t n) {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15U);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return static_cast<std::size_t>((z ^ (z >> 31)) % n);
  }

 private:
  std::uint64_t state_;
};

// Edits that keep the XML well-formed more often than not: a digit, a letter of a name, a line dropped or
// doubled.
std::string mutate_gently(std::string text, Random& random) {
  const std::size_t edits = 1 + random.below(3);
  for (std::size_t i = 0; i < edits && !text.empty(); ++i) {
    const std::size_t at = random.below(text.size());
    const std::size_t begin = text.rfind('\n', at) == std::string::npos ? 0 : text.rfind('\n', at);
    const std::size_t length = std::min(text.find('\n', at + 1), text.size()) - begin;
    switch (random.below(6)) {
      case 0: {
        const std::size_t quoted = text.find('"', at);
        if (quoted != std::string::npos && quoted + 1 < text.size())
          text[quoted + 1] = static_cast<char>('a' + random.below(26));
        break;
      }
      case 1:
        if (random.below(2) == 0)
          text.erase(begin, length);
        else
          text.insert(begin, text.substr(begin, length));
        break;
      default: {
        const std::size_t digit = text.find_first_of("0123456789", at);
        if (digit != std::string::npos) text[digit] = static_cast<char>('0' + random.below(10));
      }
    }
  }
  return text;
}

std::string mutate(std::string text, Random& random) {
  if (random.below(2) == 0) return mutate_gently(std::move(text), random);
  static const std::vector<std::string> pieces = {"<",
                                                  ">",
                                                  "/",
                                                  "\"",
                                                  "'",
                                                  "&",
                                                  "$",
                                                  "$spp",
                                                  "\\$",
                                                  "-1",
                                                  "1e999",
                                                  "nan",
                                                  "inf",
                                                  "0",
                                                  "  ",
                                                  "\n",
                                                  "\xFF",
                                                  "#",
                                                  "<ref id=\"wall\"/>",
                                                  "id",
                                                  "name",
                                                  "type",
                                                  "/>",
                                                  "]]>",
                                                  "<!--",
                                                  "-->",
                                                  "<![CDATA[x]]>",
                                                  "&#0;",
                                                  "&lt;",
                                                  "99999999999999999999",
                                                  "scene",
                                                  "bsdf",
                                                  "<include filename=\"scene.xml\"/>",
                                                  "../",
                                                  "\xEF\xBB\xBF",
                                                  "<transform name=\"to_world\"/>"};
  const std::size_t edits = 1 + random.below(4);
  for (std::size_t i = 0; i < edits && !text.empty(); ++i) {
    const std::size_t at = random.below(text.size());
    const std::size_t length = std::min(text.size() - at, 1 + random.below(24));
    switch (random.below(6)) {
      case 0:
        text[at] = static_cast<char>(random.below(256));
        break;
      case 1:
        text.erase(at, length);
        break;
      case 2:
        text.insert(at, pieces[random.below(pieces.size())]);
        break;
      case 3:
        text.insert(random.below(text.size()), text.substr(at, length));
        break;
      case 4:
        text.resize(at);
        break;
      default:
        text.replace(at, length, pieces[random.below(pieces.size())]);
    }
  }
  return text;
}

// Claim: no mutation crashes or hangs the parser; every error is one line that names a place or a parameter;
// what the strict reading takes the lenient one takes. (Run under the sanitizers, this is a memory test too.)
TEST(DescriptionFuzz, MutatedScenesGiveOneAnswer) {
  Random random(20260701);
  const std::string part = "<scene><bsdf type='dielectric' id='glass'/></scene>";
  const std::string spectrum = "# measured\n400 1.5\n500.25 1.4\n700 1.3\n";
  int parsed = 0;
  constexpr int rounds = 6000;
  const auto begin = std::chrono::steady_clock::now();
  for (int round = 0; round < rounds; ++round) {
    const std::size_t which = random.below(8);
    const std::string main_text =
        which < 2 ? std::string(seed_scene) : mutate(std::string(seed_scene), random);
    const std::string part_text = which == 0 ? mutate(part, random) : part;
    const std::string spectrum_text = which == 1 ? mutate(spectrum, random) : spectrum;
    const auto result =
        parse_text(main_text, {{"spp", "4"}}, {{"part.xml", part_text}, {"eta.spd", spectrum_text}});
    const MemorySource files({{"scene.xml", main_text},
                              {"part.xml", part_text},
                              {"eta.spd", spectrum_text},
                              {"mesh.obj", ""},
                              {"image.png", ""}});
    const auto loose =
        read_scene(files, "scene.xml", {{"spp", "4"}}, {.integrator = "path", .lenient = true});
    if (result.ok()) {
      EXPECT_TRUE(loose.ok()) << loose.error().to_string();
      ++parsed;
      continue;
    }
    const std::string message = (loose.ok() ? result.error() : loose.error()).to_string();
    EXPECT_FALSE(message.empty());
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_EQ(result.error().exit_code(), 2) << message;
    EXPECT_FALSE(result.error().file.empty()) << message;
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  // Neither everything refused nor everything accepted: the mutations reach both sides.
  EXPECT_GT(parsed, rounds / 50);
  EXPECT_LT(parsed, rounds / 2);
  RecordProperty("seconds", std::to_string(seconds));
}

}  // namespace
}  // namespace candela::description
