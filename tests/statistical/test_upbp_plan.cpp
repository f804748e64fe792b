// The plan of upbp: what it runs, what it says of it, and the work, memory and noise that come of it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/moments.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/transport/photon_beams.h"
#include "worker/transport/photon_map.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Upbp.SharedHitsCountForLess"});

// Claim: without a medium upbp is vcm, bit for bit.
TEST(Upbp, IsVcmWithoutMedia) {
  const TestScene scene = scene_from_transport("caustic", 16, 16);
  const auto vcm = render_batches(with_integrator(scene, "vcm"), 5, 2, 3);
  EXPECT_EQ(render_batches(with_integrator(scene, "upbp"), 5, 2, 3), vcm);
  EXPECT_EQ(render_batches(with_integrator(scene, "upbp", {{"techniques", "vcm"}}), 5, 2, 3), vcm);
}

// Claim: without a medium that scatters upbp does the work of vcm: the same rays and paths in every unit, by
// the same plan, which no pilot was run for.
TEST(Upbp, WorkIsThatOfVcmWithoutMedia) {
  const TestScene dark_water = scene_from_xml(
      R"(<scene version="3.0.0"><integrator type="volpath"/><sensor type="perspective"><float name="fov" value="50"/>
          <transform name="to_world"><lookat origin="0, -4, 2" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
        <emitter type="point"><point name="position" x="1" y="-1" z="3"/><rgb name="intensity" value="3"/></emitter>
        <shape type="rectangle"><transform name="to_world"><scale value="3"/></transform><bsdf type="diffuse"/></shape>
        <shape type="sphere"><bsdf type="dielectric"/>
          <medium type="homogeneous" name="interior"><rgb name="sigma_t" value="0.5, 1, 2"/><rgb name="albedo" value="0"/></medium></shape></scene>)",
      16, 16);
  const auto work_of = [](const TestScene& scene) {
    const auto renderer = make_renderer(scene);
    std::vector<film::SampleCounts> sample_counts;
    for (const Unit& unit : {Unit{Unit::Kind::iterations, 0, 0, 2}, Unit{Unit::Kind::iterations, 1, 5, 6}}) {
      const NamedState state = pilot_state(scene);
      auto output = renderer->make_output(state);
      EXPECT_TRUE(renderer->run(unit, {state, {}, {}}, output, {}).ok());
      sample_counts.push_back(output.film->sample_counts());
    }
    const std::string plan = renderer->plan_text().value();
    return std::pair(sample_counts, plan.substr(plan.find('\n', plan.find("integrator:"))));
  };
  for (const TestScene& scene : {scene_from_transport("caustic", 16, 16), dark_water}) {
    const auto vcm = work_of(with_integrator(scene, "vcm"));
    EXPECT_GT(vcm.first[0].rays, 16U * 16U);
    EXPECT_EQ(work_of(with_integrator(scene, "upbp")), vcm);
    EXPECT_EQ(work_of(with_integrator(scene, "upbp", {{"techniques", "all"}})), vcm);
    EXPECT_EQ(work_of(with_integrator(scene, "upbp", {{"techniques", "vcm"}})), vcm);
  }
}

// Claim: the plan tells the bytes of photons and beams of an iteration, of a film of any size. In endless fog
// with max_depth=2 each light path leaves one photon, and each path that leaves beams one beam.
TEST(Upbp, PlanTellsTheMemoryOfPhotonsAndBeams) {
  const TestScene scene = scene_from_xml(
      R"(<scene version="3.0.0"><integrator type="volpath"/><medium id="fog" type="homogeneous"><rgb name="sigma_t" value="1"/><rgb name="albedo" value="0.9"/></medium>
        <sensor type="perspective"><ref id="fog"/><transform name="to_world"><translate z="-3"/></transform></sensor>
        <emitter type="point"><rgb name="intensity" value="2"/><ref id="fog"/></emitter></scene>)",
      64, 64);
  struct Told {
    double photons, beams;
  };
  const auto told = [&](std::uint32_t side, const std::string& techniques, std::uint64_t beam_paths) {
    TestScene sized = with_integrator(scene, "upbp",
                                      {{"techniques", techniques},
                                       {"beam_paths", std::to_string(beam_paths)},
                                       {"max_depth", "2"},
                                       {"radius", "0.01"}});
    sized.settings.width = sized.settings.height = side;
    const std::string plan = make_renderer(sized)->plan_text().value();
    const auto number = [&](const std::string& what) {
      const std::size_t at = plan.find(what);
      EXPECT_NE(at, std::string::npos) << what << " in " << plan;
      return at == std::string::npos ? 0 : 1e6 * std::stod(plan.substr(at + what.size()));
    };
    return Told{number("photons in media "), number(", beams ")};
  };
  // Each is held twice, by its chunk and in the order of a tree or a search. Eight photons share a node of 96
  // bytes, eight nodes one of 192; a search holds a photon's place and at most four bytes of buckets. Beside
  // a tree it holds the photon's number, too. kRim: nodes that are not full.
  constexpr double kPhoton = 2 * (sizeof(Vec3) + sizeof(transport::Photon<transport::MisBlock>));
  constexpr double kTree = 12.0 + 3.0 * 8 / 7, kSearch = sizeof(Vec3) + 4, kRim = 400;
  constexpr double kBeam =
      2 * (sizeof(transport::PhotonBeam) + sizeof(transport::EdgeStart) + sizeof(scene::EmissionSample));
  constexpr double kMaxShareOfPieces = 64 * 60;
  for (const std::uint32_t side : {16U, 64U, 256U}) {
    const double paths = side * side;
    const Told all = told(side, "all", 100);
    EXPECT_GE(all.photons, 0.995 * kPhoton * paths);
    EXPECT_LE(all.photons, 1.005 * (kPhoton + kTree + kSearch + 4) * paths + kRim);
    const double beams = std::floor(paths / std::ceil(paths / 100));
    EXPECT_GE(all.beams, 0.98 * kBeam * beams);
    EXPECT_LE(all.beams, 1.02 * (kBeam + kMaxShareOfPieces) * (beams + 1));
  }
  const Told points = told(64, "pp3d", 0), few = told(64, "bb1d", 64), many = told(64, "bb1d", 0);
  EXPECT_LE(points.photons, 1.005 * (kPhoton + kSearch) * 64 * 64);
  EXPECT_EQ(points.beams, 0);
  EXPECT_EQ(few.photons, 0);
  EXPECT_NEAR(many.beams / few.beams, 64, 16);
}

// Claim: what auto chooses is rendered as if the list had named it, bit for bit, and the plan names it. The
// scenes are such that it does not choose the same for all.
TEST(Upbp, AutoRunsWhatThePlanNames) {
  std::map<std::string, SettingsMap> sets = {
      {"all (128 beam_paths)", {{"techniques", "all"}, {"beam_paths", "128"}}},
      {"all (1024 beam_paths)", {{"techniques", "all"}, {"beam_paths", "1024"}}},
      {"vcm,pp3d,pb2d", {{"techniques", "vcm,pp3d,pb2d"}}},
      {"vcm", {{"techniques", "vcm"}}}};
  for (const auto& [set, settings] : std::map(sets)) {
    if (set == "vcm") continue;
    const std::string few = set + " (connect_media 0.125)", far = " (long query_beams)";
    sets[few] = sets[few + far] = sets[set + far] = settings;
    sets[few]["connect_media"] = sets[few + far]["connect_media"] = "0.125";
    sets[set + far]["query_beams"] = sets[few + far]["query_beams"] = "long";
  }
  std::set<std::string> chosen;
  for (const char* name : {"fog-thin", "fog-glass", "smoke"}) {
    const TestScene scene = scene_from_transport(name, 16, 16), automatic = with_integrator(scene, "upbp");
    const std::string plan = make_renderer(automatic)->plan_text().value();
    std::size_t named = 0;
    for (const auto& [set, settings] : sets) {
      if (plan.find("chose " + set + ".") == std::string::npos) continue;
      ++named;
      chosen.insert(set);
      EXPECT_EQ(render_batches(automatic, 5, 1, 2),
                render_batches(with_integrator(scene, "upbp", settings), 5, 1, 2))
          << name << ' ' << set;
    }
    EXPECT_EQ(named, 1U) << plan;
  }
  EXPECT_GT(chosen.size(), 1U);
}

// Claim: a list without beam_paths is rendered with the number that the plan says it chose, bit for bit as if
// it had been set, which is not the same in all scenes; auto keeps the number that is set; plan=full chooses
// nothing.
TEST(Upbp, BeamPathsAreThoseThatThePlanNames) {
  std::set<std::string> chosen;
  for (const char* name : {"fog-thin", "fog-rough-glass"})
    for (const char* techniques : {"all", "vcm,bb1d"}) {
      const TestScene bare = scene_from_transport(name, 32, 32),
                      scene = with_integrator(bare, "upbp", {{"techniques", techniques}});
      const auto set_to = [&](const char* beam_paths) {
        return with_integrator(bare, "upbp", {{"techniques", techniques}, {"beam_paths", beam_paths}});
      };
      const std::string plan = make_renderer(scene)->plan_text().value();
      const bool many = plan.find("chose 1024 beam_paths.") != std::string::npos;
      EXPECT_NE(plan.find("chose 128 beam_paths.") != std::string::npos, many) << plan;
      const char* number = many ? "1024" : "128";
      chosen.insert(number);
      EXPECT_EQ(render_batches(scene, 5, 1, 2), render_batches(set_to(number), 5, 1, 2)) << name;
      EXPECT_NE(render_batches(scene, 5, 1, 2), render_batches(set_to(many ? "128" : "1024"), 5, 1, 2));
      for (const TestScene& chooses_nothing :
           {set_to(number), with_integrator(bare, "upbp", {{"techniques", techniques}, {"plan", "full"}})})
        EXPECT_EQ(make_renderer(chooses_nothing)->plan_text().value().find("chose"), std::string::npos);
    }
  EXPECT_EQ(chosen.size(), 2U);
  const std::string plan =
      make_renderer(with_integrator(scene_from_transport("smoke", 16, 16), "upbp", {{"beam_paths", "40"}}))
          ->plan_text()
          .value();
  EXPECT_NE(plan.find("(40 beam_paths)"), std::string::npos) << plan;
  EXPECT_EQ(plan.find("1024"), std::string::npos) << plan;
}

// Claim: weights that count the hits which a query shares (plan=auto) leave less noise than those that take
// all merges for independent (plan=full), with beams of all light paths in fog around the camera: 0.78 of it.
TEST(Upbp, SharedHitsCountForLess) {
  const TestScene scene = scene_from_transport("fog-camera", 32, 32);
  const auto noise = [&](const char* plan) {
    ImageMoments moments;
    for (const auto& image : render_batches(
             with_integrator(scene, "upbp", {{"techniques", "all"}, {"beam_paths", "0"}, {"plan", plan}}), 5,
             16, 1))
      add_image(moments, image);
    return relative_variance(moments);
  };
  const double ratio = noise("auto") / noise("full");
  std::printf("noise over that of independent merges: %.3f\n", ratio);
  EXPECT_LT(ratio, 0.95);
  EXPECT_GT(ratio, 0.7);
}

}  // namespace
}  // namespace candela::statistical
