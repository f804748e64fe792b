// upbp: each technique alone and all together, against quadrature and against vcm and path.
// Block tests alarm falsely with probability at most 1e-5 each (Bonferroni over blocks and channels); there
// are fewer than 30: the whole file below 3e-4.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/unit/volume_file.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Upbp.SingleScatteringByQuadrature", "Upbp.AgreesWithBdpt",
                                  "Upbp.TechniquesInGridsAgreeWithBdpt",
                                  "Upbp.LongQueryBeamsSeeThroughThickFog", "Upbp.RadiiInDenseMediaHaveALimit",
                                  "Upbp.OrdersOfScatteringInEndlessFog",
                                  "Upbp.MergingOnAFloorUnderFogHasItsBias", "Upbp.MergesInOneMediumAlone"});

constexpr double kAlpha = 1e-5;

TestScene scene_with(const std::string& body, std::uint32_t size) {
  return scene_from_xml("<scene version=\"3.0.0\"><integrator type=\"volpath\"/>" + body + "</scene>", size,
                        size);
}

void expect_agreement(const std::vector<std::vector<float>>& batches, const std::vector<float>& expected,
                      const std::vector<float>& error, std::uint32_t size, const std::string& what,
                      double allowed_bias) {
  const BlockTestResult result =
      block_test(batches, expected, error, size, size, {8, 0.05, allowed_bias, {}});
  std::printf("%-8s ratio %.4f +- %.4f, median relative standard error %.4f\n", what.c_str(), result.ratio,
              result.ratio_stderr, result.median_relative_standard_error);
  EXPECT_GT(result.tested, 0U) << what;
  EXPECT_LE(result.skipped, result.tested) << what << ": too noisy to say anything";
  EXPECT_GT(result.adjusted_p, kAlpha) << what << ": " << result.worst;
}

// Claim: light of a point lamp scattered once, in a colored medium with a forward phase function around the
// camera, is the integral of sigma_s f T T I / r^2 along the ray, by each technique alone and by lists, with
// short and with long beams, and with beams of all 4096 light paths or of few. The radius is 0.02 of the
// lamp's distance: its bias is below 1e-3.
TEST(Upbp, SingleScatteringByQuadrature) {
  constexpr double kForward = 0.6;
  const std::string body =
      R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="0.2, 0.4, 0.6"/><rgb name="albedo" value="0.8"/>
        <phase type="hg"><float name="g" value="0.6"/></phase></medium>
        <sensor type="orthographic"><float name="near_clip" value="0.0001"/><ref id="fog"/><transform name="to_world"><scale x="0.5" y="0.5"/><translate z="-3"/></transform></sensor>
        <emitter type="point"><point name="position" x="0" y="1.5" z="0"/><rgb name="intensity" value="2"/></emitter>
        <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="180"/><translate z="4"/></transform>
          <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape>)";
  constexpr std::uint32_t kSize = 16;
  std::vector<float> expected;
  for (std::uint32_t y = 0; y < kSize; ++y)
    for (std::uint32_t x = 0; x < kSize; ++x) {
      std::array<double, 3> sum{};
      constexpr int kSub = 3, kSteps = 1400;
      for (int s = 0; s < kSub * kSub; ++s) {
        const double px = (x + (s % kSub + 0.5) / kSub) / kSize - 0.5,
                     py = 0.5 - (y + (s / kSub + 0.5) / kSub) / kSize;
        for (int i = 0; i < kSteps; ++i) {
          const double t = 7.0 * (i + 0.5) / kSteps, z = t - 3;
          const double r2 = px * px + (py - 1.5) * (py - 1.5) + z * z, r = std::sqrt(r2);
          const double d = 1 + kForward * kForward + 2 * kForward * z / r;
          const double phase = (1 - kForward * kForward) / (4 * std::numbers::pi * d * std::sqrt(d));
          for (std::size_t c = 0; c < 3; ++c) {
            const double sigma = 0.2 * static_cast<double>(c + 1);
            sum[c] +=
                0.8 * sigma * phase * std::exp(-sigma * (t + r)) * 2 / r2 * 7.0 / kSteps / (kSub * kSub);
          }
        }
      }
      for (const double v : sum) expected.push_back(static_cast<float>(v));
    }
  struct Row {
    const char* techniques;
    int iterations;
    const char* beam_paths = "0";
    const char *query_beams = "short", *photon_beams = "short";
  };
  for (const Row& row : {Row{"all", 16}, Row{"pb2d", 64}, Row{"bp2d", 64}, Row{"bb1d", 24}, Row{"pp3d", 160},
                         Row{"vcm,bb1d", 16}, Row{"all", 24, "300"}, Row{"bb1d", 64, "300"},
                         Row{"pb2d", 64, "0", "long"}, Row{"bp2d", 64, "0", "short", "long"},
                         Row{"bb1d", 24, "300", "long"}, Row{"bb1d", 24, "300", "short", "long"},
                         Row{"bb1d", 24, "300", "long", "long"}, Row{"all", 16, "300", "long", "long"}}) {
    // The disc behind is 9 wide: the scene's sphere has a radius of about 13.
    const TestScene scene =
        with_integrator(scene_with(body, kSize), "upbp",
                        {{"max_depth", "2"},
                         {"techniques", row.techniques},
                         {"light_paths", "16"},
                         {"beam_paths", row.beam_paths},
                         {"query_beams", row.query_beams},
                         {"photon_beams", row.photon_beams},
                         {"radius", std::string(row.techniques) == "pp3d" ? "0.012" : "0.003"}});
    expect_agreement(render_batches(scene, 61, 10, static_cast<std::uint64_t>(row.iterations)), expected, {},
                     kSize,
                     fmt::format("{} of {}, {} and {} beams", row.techniques, row.beam_paths,
                                 row.photon_beams, row.query_beams),
                     0.005);
  }
}

// Claim: on scenes with fog in a box, within glass and around the camera, and with a grid of smoke, the
// combination has the expectation of bdpt, up to the blur of its radius, also with a fifth of the connections
// in media, with long beams, and without merging on surfaces.
TEST(Upbp, AgreesWithBdpt) {
  constexpr std::uint32_t kSize = 24;
  for (const std::string name : {"fog-thin", "fog-glass", "fog-camera", "smoke"}) {
    SCOPED_TRACE(name);
    const TestScene scene = scene_from_transport(name, kSize, kSize);
    const auto reference = render_batches(with_integrator(scene, "bdpt"), 301, 10, 64);
    std::vector<float> mean(reference[0].size()), error(reference[0].size());
    for (std::size_t i = 0; i < mean.size(); ++i) {
      double sum = 0, squares = 0;
      for (const auto& batch : reference) {
        sum += static_cast<double>(batch[i]);
        squares += static_cast<double>(batch[i]) * static_cast<double>(batch[i]);
      }
      const double m = sum / 10;
      mean[i] = static_cast<float>(m);
      error[i] = static_cast<float>(std::sqrt(std::max(squares / 10 - m * m, 0.0) / 9));
    }
    const bool again = name == "fog-camera" || name == "smoke";
    const auto check = [&](const std::string& share, const std::string& beams,
                           const std::string& surfaces = "true") {
      const auto all = with_integrator(scene, "upbp",
                                       {{"techniques", "all"},
                                        {"radius", "0.004"},
                                        {"connect_media", share},
                                        {"query_beams", beams},
                                        {"photon_beams", beams},
                                        {"merge_surfaces", surfaces}});
      expect_agreement(render_batches(all, 501, 10, 10), mean, error, kSize,
                       fmt::format("all, {} of connections, {} beams, surfaces {}", share, beams, surfaces),
                       0.01);
    };
    check("1", "short");
    if (again) check("0.2", "short");
    if (name != "smoke") check("1", "long");
    if (name == "fog-glass") check("1", "short", "false");
  }
}

// A box of smoke on a grid of so many channels, in the light of a spot that chance does not meet: all that is
// seen was scattered in the grid, which is empty at its rim.
TestScene smoke_in_a_spot(int channels, std::uint32_t size) {
  rng::Stream stream(9);
  std::vector<float> values;
  constexpr int kCells = 12;
  const auto inner = [](int i) { return i > 0 && i + 1 < kCells; };
  for (int z = 0; z < kCells; ++z)
    for (int y = 0; y < kCells; ++y)
      for (int x = 0; x < kCells; ++x)
        for (int c = 0; c < channels; ++c) {
          const float u = stream.next_float();
          values.push_back(inner(x) && inner(y) && inner(z) && u > 0.4f ? 2 * u : 0.0f);
        }
  TestScene scene;
  scene.main_key = "scene.xml";
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"v.vol", test::volume_file({12, 12, 12}, channels, values)},
      {"scene.xml",
       R"(<scene version="3.0.0"><integrator type="volpath"><integer name="max_depth" value="6"/></integrator>
        <sensor type="perspective"><float name="fov" value="36"/>
          <transform name="to_world"><lookat origin="0, -5, 1" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
        <emitter type="spot"><transform name="to_world"><lookat origin="1, -1, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
          <float name="cutoff_angle" value="25"/><rgb name="intensity" value="20"/></emitter>
        <shape type="cube"><bsdf type="null"/>
          <medium type="heterogeneous" name="interior"><float name="scale" value="1.3"/>
            <volume type="gridvolume" name="sigma_t"><string name="filename" value="v.vol"/>
              <transform name="to_world"><translate x="-0.5" y="-0.5" z="-0.5"/><scale value="2"/></transform></volume>
            <rgb name="albedo" value="0.9"/><phase type="hg"><float name="g" value="0.4"/></phase></medium></shape></scene>)"}});
  return read_scene(std::move(scene), size, size);
}

// Mean and standard error over batches, per channel.
struct ChannelMeans {
  std::array<double, 3> mean{}, error{};
};
ChannelMeans channel_means(const std::vector<std::vector<float>>& batches) {
  ChannelMeans out;
  const auto count = static_cast<double>(batches.size());
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0, squares = 0;
    for (const auto& batch : batches) {
      double of_batch = 0;
      for (std::size_t i = c; i < batch.size(); i += 3) of_batch += static_cast<double>(batch[i]);
      of_batch /= static_cast<double>(batch.size()) / 3;
      sum += of_batch;
      squares += of_batch * of_batch;
    }
    out.mean[c] = sum / count;
    out.error[c] = std::sqrt(std::max(squares / count - out.mean[c] * out.mean[c], 0.0) / (count - 1));
  }
  return out;
}

// Claim: in grids, gray and of several colors, each technique alone, the merges without connections, and all
// together have the expectation of bdpt in each channel, up to the blur of their radii.
TEST(Upbp, TechniquesInGridsAgreeWithBdpt) {
  constexpr std::uint32_t kSize = 16;
  for (const int channels : {1, 3}) {
    const TestScene scene = smoke_in_a_spot(channels, kSize);
    const ChannelMeans truth = channel_means(render_batches(with_integrator(scene, "bdpt"), 301, 12, 96));
    struct Row {
      const char* techniques;
      std::uint64_t iterations;
    };
    for (const Row& row : {Row{"pp3d", 96}, Row{"pb2d", 32}, Row{"bp2d", 64}, Row{"bb1d", 16},
                           Row{"pp3d,pb2d,bp2d,bb1d", 16}, Row{"all", 16}}) {
      const ChannelMeans found = channel_means(render_batches(with_integrator(scene, "upbp",
                                                                              {{"techniques", row.techniques},
                                                                               {"light_paths", "32"},
                                                                               {"beam_paths", "2048"},
                                                                               {"radius", "0.03"}}),
                                                              501, 12, row.iterations));
      for (std::size_t c = 0; c < 3; ++c) {
        const double error = std::hypot(found.error[c], truth.error[c]);
        std::printf("%d channels, %-20s channel %zu: ratio %.4f +- %.4f\n", channels, row.techniques, c,
                    found.mean[c] / truth.mean[c], error / truth.mean[c]);
        EXPECT_LT(error, 0.02 * truth.mean[c]) << row.techniques;
        EXPECT_NEAR(found.mean[c], truth.mean[c], 6 * error + 0.01 * truth.mean[c]) << row.techniques;
      }
    }
  }
}

// Claim: a beam of light behind four mean free paths of fog is as bright with long query beams as with short
// ones, of which e^-4 reach it, and the picture's mean has less than a tenth of the variance. Pixels share
// light's beams, so that batches tell it.
TEST(Upbp, LongQueryBeamsSeeThroughThickFog) {
  const TestScene scene = scene_with(
      R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="1"/><rgb name="albedo" value="0.5"/></medium>
        <sensor type="orthographic"><float name="near_clip" value="0.0001"/><ref id="fog"/><transform name="to_world"><scale x="0.5" y="0.5"/></transform></sensor>
        <emitter type="spot"><float name="cutoff_angle" value="20"/><float name="beam_width" value="19"/><rgb name="intensity" value="2"/><ref id="fog"/>
          <transform name="to_world"><lookat origin="0, 2, 4" target="0, 0, 4" up="1, 0, 0"/></transform></emitter>
        <shape type="sphere"><float name="radius" value="12"/><bsdf type="null"/><ref name="interior" id="fog"/></shape>)",
      12);
  SettingsMap settings = {{"techniques", "bb1d"}, {"max_depth", "2"},    {"radius", "0.01"},
                          {"beam_paths", "0"},    {"light_paths", "16"}, {"radius_free_paths", "0"}};
  ChannelMeans found[2];
  for (const int is_long : {0, 1}) {
    settings["query_beams"] = is_long != 0 ? "long" : "short";
    found[is_long] = channel_means(render_batches(with_integrator(scene, "upbp", settings), 77, 24, 48));
  }
  const auto& [shorter, longer] = found;
  const double error = std::hypot(shorter.error[0], longer.error[0]),
               ratio = longer.error[0] / shorter.error[0];
  std::printf("long over short: mean %.4f +- %.4f, variance %.4f\n", longer.mean[0] / shorter.mean[0],
              error / shorter.mean[0], ratio * ratio);
  EXPECT_LT(error, 0.04 * shorter.mean[0]);
  EXPECT_NEAR(longer.mean[0], shorter.mean[0], 5 * error);
  EXPECT_LT(ratio * ratio, 0.1);
}

double mean_of_all(const std::vector<std::vector<float>>& batches) {
  double sum = 0;
  for (const auto& batch : batches)
    for (const float value : batch) sum += static_cast<double>(value) / static_cast<double>(batch.size());
  return sum / static_cast<double>(batches.size());
}

// Claim: a dense block beside an endless fog, each with radii of its own: with a first radius of two mean
// free paths of the block it would be more than 7 % too dark, with the limit it is right within 2 %. The
// standard error of the ratios is below 0.3 %.
TEST(Upbp, RadiiInDenseMediaHaveALimit) {
  const TestScene scene = scene_with(
      R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="0.02"/><rgb name="albedo" value="0.9"/></medium>
        <sensor type="perspective"><float name="fov" value="26"/><ref id="fog"/>
          <transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
        <emitter type="constant"/>
        <shape type="sphere"><float name="radius" value="6"/><bsdf type="null"/><ref name="interior" id="fog"/></shape>
        <shape type="cube"><bsdf type="null"/><ref name="exterior" id="fog"/>
          <medium type="homogeneous" name="interior"><rgb name="sigma_t" value="10"/><rgb name="albedo" value="0.5"/></medium></shape>)",
      16);
  const double truth = mean_of_all(render_batches(with_integrator(scene, "path"), 71, 4, 256));
  const auto ratio = [&](const char* limit) {
    const TestScene all = with_integrator(
        scene, "upbp", {{"techniques", "pp3d"}, {"radius", "0.033"}, {"radius_free_paths", limit}});
    const double found = mean_of_all(render_batches(all, 81, 4, 24)) / truth;
    std::printf("radius_free_paths %s: ratio %.4f\n", limit, found);
    return found;
  };
  EXPECT_LT(ratio("0"), 0.93);
  EXPECT_NEAR(ratio("0.25"), 1, 0.02);
}

// Fog without an end, sigma_t = 1, albedo 0.8, and a lamp of one watt at (1, 0, 1); all pixels look from 0
// along z.
TestScene endless_fog() {
  return scene_with(
      fmt::format(
          R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="1"/><rgb name="albedo" value="0.8"/></medium>
        <sensor type="perspective"><float name="fov" value="0.001"/><float name="near_clip" value="0.00001"/><ref id="fog"/>
          <transform name="to_world"><lookat origin="0, 0, 0" target="0, 0, 1" up="0, 1, 0"/></transform></sensor>
        <emitter type="point"><point name="position" x="1" y="0" z="1"/><rgb name="intensity" value="{:.17g}"/><ref id="fog"/></emitter>
        <shape type="sphere"><float name="radius" value="40"/><bsdf type="null"/><ref name="interior" id="fog"/></shape>)",
          1 / (4 * std::numbers::pi)),
      8);
}

// Claim: once, twice and any number of times scattered, light along one ray has the radiance that theory has
// in closed form or by Fourier inversion (../shared/theory/upbp.md, 18), by path tracing, by all techniques
// together, and by each alone, whose radius of 0.17 free paths makes it brighter by up to 2 %.
TEST(Upbp, OrdersOfScatteringInEndlessFog) {
  const TestScene fog = endless_fog();
  constexpr double kOnce = 1.111451542e-3, kTwice = 1.131484e-3, kAll = 4.66321405e-3;
  const auto check = [&](const char* integrator, SettingsMap settings, const char* depth, double truth,
                         double bias, std::uint64_t iterations) {
    settings["max_depth"] = depth;
    constexpr std::size_t kBatches = 12;
    const auto batches = render_batches(with_integrator(fog, integrator, settings), 41, kBatches, iterations);
    double sum = 0, squares = 0;
    for (const auto& batch : batches) {
      const double mean = mean_of_all({batch});
      sum += mean / kBatches;
      squares += mean * mean / kBatches;
    }
    const double error = std::sqrt(std::max(squares - sum * sum, 0.0) / (kBatches - 1));
    std::printf("%-6s %-5s edges %3s: ratio %.4f +- %.4f\n", integrator, settings["techniques"].c_str(),
                depth, sum / truth, error / truth);
    EXPECT_LT(error, 0.08 * truth);
    EXPECT_NEAR(sum, truth, 6 * error + bias * truth);
  };
  check("bdpt", {}, "2", kOnce, 0, 40);
  for (const auto& [depth, truth] : {std::pair{"3", kOnce + kTwice}, {"-1", kAll}}) {
    const bool all = truth == kAll;
    check("path", {}, depth, truth, 0, all ? 500 : 250);
    check("bdpt", {}, depth, truth, 0, 40);
    for (const char* techniques : {"all", "pp3d", "pb2d", "bp2d", "bb1d"})
      check("upbp",
            {{"techniques", techniques}, {"radius", "0.0025"}, {"light_paths", "16"}, {"beam_paths", "0"}},
            depth, truth, 0.02, all ? 16 : 12);
  }
}

// Claim: on a floor under absorbing fog (0.5), at a lateral distance of 0.5 from below a lamp at height 1,
// photons merged over a disc of radius h are darker than the light at its middle by what theory says,
// -5.339e-2, -1.318e-2 and -3.279e-3 at 0.4, 0.2 and 0.1 (../shared/theory/upbp.md, 18).
TEST(Upbp, MergingOnAFloorUnderFogHasItsBias) {
  constexpr double kSphere = 4;
  // The spot lights more than the largest disc.
  const TestScene scene = scene_with(
      fmt::format(
          R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="0.5"/><rgb name="albedo" value="0"/></medium>
        <sensor type="perspective"><float name="fov" value="0.001"/><float name="near_clip" value="0.00001"/><ref id="fog"/>
          <transform name="to_world"><lookat origin="0.5, 0, 0.01" target="0.5, 0, 0" up="0, 1, 0"/></transform></sensor>
        <emitter type="spot"><transform name="to_world"><lookat origin="0, 0, 1" target="0.5, 0, 0" up="0, 1, 0"/></transform>
          <float name="cutoff_angle" value="25"/><float name="beam_width" value="24.9"/><ref id="fog"/></emitter>
        <shape type="rectangle"><transform name="to_world"><scale value="2"/></transform></shape>
        <shape type="sphere"><float name="radius" value="{}"/><bsdf type="null"/><ref name="interior" id="fog"/></shape>)",
          kSphere),
      8);
  const double truth =
      mean_of_all(render_batches(with_integrator(scene, "path", {{"max_depth", "2"}}), 5, 1, 16));
  for (const auto& [radius, bias, iterations] :
       {std::tuple{0.4, -5.339e-2, 40}, {0.2, -1.318e-2, 100}, {0.1, -3.279e-3, 200}}) {
    // The scene's sphere is that around its box. Every batch begins with the first radius, which alpha = 1
    // keeps.
    const SettingsMap settings = {{"radius", fmt::format("{:.9f}", radius / (kSphere * std::sqrt(3.0)))},
                                  {"max_depth", "2"},
                                  {"light_paths", "16"},
                                  {"kernel", "constant"},
                                  {"alpha", "1"}};
    constexpr std::size_t kBatches = 16;
    double sum = 0, squares = 0;
    for (const auto& batch : render_batches(with_integrator(scene, "ppm", settings), 6, kBatches,
                                            static_cast<std::uint64_t>(iterations))) {
      const double ratio = mean_of_all({batch}) / truth;
      sum += ratio / kBatches;
      squares += ratio * ratio / kBatches;
    }
    const double error = std::sqrt(std::max(squares - sum * sum, 0.0) / (kBatches - 1));
    std::printf("radius %.1f: bias %.5f +- %.5f for %.5f\n", radius, sum - 1, error, bias);
    EXPECT_LT(error, 3e-3);
    EXPECT_NEAR(sum - 1, bias, 6 * error);
  }
}

// Claim: photons and beams merge in their own medium alone. Within a black box no light is, whatever the fog
// around it has, though photons are nearer than the radius. Were it one fog inside and outside, each
// technique would leak through the walls: what the same scene shows with one medium.
TEST(Upbp, MergesInOneMediumAlone) {
  const auto scene = [](const char* inside) {
    return scene_with(
        fmt::format(
            R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="1"/><rgb name="albedo" value="0.9"/></medium>
            <medium id="smoke" type="homogeneous"><rgb name="sigma_t" value="1"/><rgb name="albedo" value="0.9"/></medium>
            <sensor type="perspective"><float name="fov" value="60"/><ref id="{0}"/>
              <transform name="to_world"><lookat origin="0, 0, 0.9" target="0, 0, -1" up="0, 1, 0"/></transform></sensor>
            <emitter type="point"><point name="position" x="0" y="0" z="-2"/><rgb name="intensity" value="9"/><ref id="fog"/></emitter>
            <shape type="sphere"><float name="radius" value="4"/><bsdf type="null"/><ref name="interior" id="fog"/></shape>
            <shape type="cube"><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
              <ref name="exterior" id="fog"/><ref name="interior" id="{0}"/></shape>)",
            inside),
        8);
  };
  const TestScene two = scene("smoke"), one = scene("fog");
  for (const char* techniques : {"pp3d", "pb2d", "bp2d", "bb1d", "all"}) {
    const auto sum = [&](const TestScene& media) {
      return mean_of_all(render_batches(
          with_integrator(
              media, "upbp",
              {{"techniques", techniques}, {"radius", "0.04"}, {"light_paths", "16"}, {"beam_paths", "0"}}),
          91, 2, 8));
    };
    EXPECT_EQ(sum(two), 0) << techniques;
    EXPECT_GT(sum(one), 1e-5) << techniques;
  }
}

// Claim: layers=techniques has the share of each technique, and changes nothing of the image. Light met by
// chance is the rest: with a lamp that chance cannot meet the layers add up to the image, within the film's
// rounding. Radii and light paths are such that all techniques bring some.
TEST(Upbp, LayersOfTechniquesAddUp) {
  const TestScene lamp_over_glass = scene_from_transport("fog-glass", 16, 16);
  const TestScene point_in_fog = scene_with(
      R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="0.5, 0.7, 1"/><rgb name="albedo" value="0.9"/></medium>
        <sensor type="perspective"><float name="fov" value="50"/><ref id="fog"/>
          <transform name="to_world"><lookat origin="0, -2, 1" target="0, 0, 0.4" up="0, 0, 1"/></transform></sensor>
        <emitter type="point"><point name="position" x="0.3" y="0.2" z="0.9"/><rgb name="intensity" value="3"/><ref id="fog"/></emitter>
        <shape type="rectangle"><bsdf type="diffuse"/></shape>
        <shape type="sphere"><float name="radius" value="4"/><bsdf type="null"/><ref name="interior" id="fog"/></shape>)",
      16);
  for (const bool by_chance : {true, false}) {
    SettingsMap settings = {{"techniques", "all"}, {"max_depth", "5"},  {"radius", "0.05"},
                            {"light_paths", "8"},  {"beam_paths", "0"}, {"plan", "full"}};
    const TestScene& bare = by_chance ? lamp_over_glass : point_in_fog;
    const TestScene plain = with_integrator(bare, "upbp", settings);
    settings["layers"] = "techniques";
    const TestScene scene = with_integrator(bare, "upbp", settings);
    const NamedState state = pilot_state(scene);
    const auto layers = render_layers(scene, state, 5, 0, 0, 4, 2);
    ASSERT_EQ(layers.size(), 7U);
    EXPECT_EQ(layers[0], render_layers(plain, state, 5, 0, 0, 4, 2)[0]);
    std::vector<double> share(layers.size());
    double image = 0;
    for (std::size_t i = 0; i < layers[0].size(); ++i) {
      double sum = 0;
      for (std::size_t layer = 1; layer < layers.size(); ++layer) {
        EXPECT_GE(layers[layer][i], 0);
        share[layer] += layers[layer][i];
        sum += layers[layer][i];
      }
      image += layers[0][i];
      const double rounding = 1e-4 * layers[0][i] + 1e-5;
      EXPECT_GE(layers[0][i] - sum, -rounding);
      if (!by_chance) {
        EXPECT_LE(layers[0][i] - sum, rounding);
      }
    }
    for (std::size_t layer = 1; layer < layers.size(); ++layer) {
      std::printf("light by chance %d, layer %zu: %.4f\n", by_chance, layer, share[layer] / image);
      EXPECT_GT(share[layer], 0) << layer;
    }
  }
}

}  // namespace
}  // namespace candela::statistical
