// Tests of the paths of some pixels: their strings, their shares beside layers of the renderer, and what is
// kept of them. A comparison of two estimates allows five standard errors of 16 or more batches: with the few
// of them here the file alarms falsely with probability below 1e-3.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "tests/unit/inspect_fixture.h"
#include "worker/inspect/path_groups.h"
#include "worker/inspect/paths.h"
#include "worker/scene/objects.h"

namespace candela::inspect {
namespace {

constexpr std::uint32_t kSize = 8;

JobSettings job_of(const SettingsMap& chosen = {}, std::uint64_t seed = 1) {
  JobSettings job;
  job.integrator = "bdpt";
  job.width = job.height = kSize;
  job.filter = "box";
  job.seed = seed;
  const auto settings = render::complete_integrator_settings("bdpt", {}, chosen);
  EXPECT_TRUE(settings.ok());
  job.integrator_settings = *settings;
  return job;
}

std::unique_ptr<Session> open(const std::string& body, const Selection& selection = {},
                              const SettingsMap& chosen = {}, const std::string& edits = "") {
  const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
  JobSettings job = job_of(chosen, 77);
  job.edits = edits;
  auto session = Session::open(files, "scene.xml", {}, job, selection, 1);
  if (!session.ok()) throw std::runtime_error(session.error().to_string());
  return std::move(*session);
}

PathsReport inspect_of(const Session& session, PathsRequest request) {
  auto report = inspect_paths(session, request);
  if (!report.ok()) throw std::runtime_error(report.error().to_string());
  return std::move(*report);
}

PathsRequest whole(std::uint64_t spp) {
  PathsRequest request;
  request.pixels = {0, 0, kSize - 1, kSize - 1};
  request.spp = spp;
  return request;
}

std::map<std::string, const PathGroup*> by_expression(const PathsReport& report) {
  std::map<std::string, const PathGroup*> groups;
  for (const PathGroup& group : report.groups) groups[group.expression] = &group;
  return groups;
}

constexpr const char* kCamera =
    R"(<sensor type="perspective"><float name="fov" value="40"/>
      <transform name="to_world"><lookat origin="0, 4, 9" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>)";

// A floor of two lobes of different colors, glass, a rough conductor, fog, a lamp, a bulb and a sky.
const std::string kRich =
    std::string(kCamera) +
    R"(<shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>
      <bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.2"/>
      <rgb name="diffuse_reflectance" value="0.7, 0.3, 0.05"/><rgb name="specular_reflectance" value="0.1, 0.5, 1"/></bsdf></bsdf></shape>
    <shape type="sphere" id="ball"><point name="center" x="1.2" y="1" z="0.5"/><bsdf type="dielectric"/>
      <medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="0.2, 0.4, 1"/></medium></shape>
    <shape type="cube" id="box"><transform name="to_world"><translate x="-1.5" y="1"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="5"/></transform>
      <emitter type="area" id="ceiling"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
    <emitter type="point" id="bulb"><point name="position" x="-3" y="4" z="4"/><rgb name="intensity" value="20, 30, 60"/></emitter>
    <emitter type="constant" id="sky"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>)";

// Mean luminance over the film of each layer of the renderer, layer 0 being the image, with its error.
std::vector<Estimate> rendered(const std::string& body, const std::string& layers, const SettingsMap& chosen,
                               const std::string& edits = "") {
  constexpr int batches = 16;
  constexpr std::uint64_t iterations = 24;
  const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
  std::vector<std::vector<double>> values;
  for (int batch = 0; batch < batches; ++batch) {
    JobSettings job = job_of({}, 1000 + static_cast<std::uint64_t>(batch));
    job.layers = layers;
    job.edits = edits;
    const auto renderer = test::make_renderer(files, job, chosen);
    const auto film = test::render_film(*renderer, iterations);
    const std::size_t per_layer = std::size_t{3} * kSize * kSize;
    values.resize(film->layout().layers);
    for (std::size_t layer = 0; layer < values.size(); ++layer) {
      double sum = 0;
      constexpr std::array<double, 3> weights = {0.212671, 0.715160, 0.072169};
      for (std::size_t i = 0; i < per_layer; ++i)
        sum += weights[i % 3] *
               std::ldexp(static_cast<double>(film->sums()[layer * per_layer + i]), -test::kFilmScaleLog2);
      values[layer].push_back(sum / (iterations * kSize * kSize));
    }
  }
  std::vector<Estimate> out;
  for (const auto& layer : values) {
    double mean = 0, squares = 0;
    for (const double v : layer) mean += v / batches;
    for (const double v : layer) squares += (v - mean) * (v - mean);
    out.push_back({mean, std::sqrt(squares / (batches - 1) / batches)});
  }
  return out;
}

void expect_equal(double value, double error, const Estimate& reference, const std::string& what) {
  EXPECT_GT(reference.value, 0) << what;
  EXPECT_NEAR(value, reference.value, 5 * std::hypot(error, reference.error)) << what;
  EXPECT_LT(std::hypot(error, reference.error), 0.12 * reference.value) << what << " is too noisy to tell";
}

// Claim: clusters by the last vertex, split once, have the light of the layers of their expressions, and
// their sum is the image, in a scene with all letters, media, mixed lobes and several lamps.
TEST(InspectPaths, ClustersAreTheLayersOfTheirExpressions) {
  const SettingsMap settings = {{"max_depth", "5"}};
  const auto session = open(kRich, {}, settings);
  PathsRequest request = whole(400);
  request.rows = 9;  // one split: by the vertex next to the eye
  const PathsReport report = inspect_of(*session, request);
  ASSERT_GE(report.groups.size(), 5u);
  std::string layers;
  for (std::size_t g = 0; g < report.groups.size(); ++g)
    layers += "layer g" + std::to_string(g) + "=" + report.groups[g].expression + ";";
  const auto reference = rendered(kRich, layers, settings);
  ASSERT_EQ(reference.size(), report.groups.size() + 1);
  expect_equal(report.luminance.value, report.luminance.error, reference[0], "image");
  double sum = 0;
  for (std::size_t g = 0; g < report.groups.size(); ++g) {
    const PathGroup& group = report.groups[g];
    sum += group.share.value;
    if (group.share.value < 0.05) continue;
    const double light = group.share.value * report.luminance.value;
    // The error of a product, taken as if both were wholly correlated.
    const double error =
        group.share.error * report.luminance.value + group.share.value * report.luminance.error;
    expect_equal(light, error, reference[g + 1], group.expression);
  }
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_EQ(report.other_count, 0u);
}

// Claim: the same with edits that select by more of the path than the vertex, from either end; a surface
// whose letter such an edit leaves open is refused.
TEST(InspectPaths, ClustersAreTheLayersOfEditedLight) {
  const SettingsMap settings = {{"max_depth", "5"}};
  const auto edit = [](const std::string& direction, const std::string& select) {
    return R"({"edits": [{"name": "a", "direction": ")" + direction + R"(", "select": ")" + select +
           R"(", "rotate": {"axis": [1, 0, 1], "degrees": 40}, "tint": [4, 2, 0.25]}]})";
  };
  const double plain = inspect_of(*open(kRich, {}, settings), whole(100)).mean.x;
  for (const std::string& edits :
       {edit("light", "L[XV]*X{floor}[XV]*X{box}"), edit("eye", "X{box}X{floor}E")}) {
    SCOPED_TRACE(edits);
    const auto session = open(kRich, {}, settings, edits);
    ASSERT_NE(session->scene().objects().path_edits, nullptr);
    PathsRequest request = whole(400);
    request.rows = 6;
    const PathsReport report = inspect_of(*session, request);
    EXPECT_GT(std::abs(report.mean.x - plain), 0.01 * plain);
    std::string layers;
    for (std::size_t g = 0; g < report.groups.size(); ++g)
      layers += "layer g" + std::to_string(g) + "=" + report.groups[g].expression + ";";
    const auto reference = rendered(kRich, layers, settings, edits);
    expect_equal(report.luminance.value, report.luminance.error, reference[0], "image");
    for (std::size_t g = 0; g < report.groups.size(); ++g) {
      const PathGroup& group = report.groups[g];
      if (group.share.value < 0.05) continue;
      expect_equal(group.share.value * report.luminance.value,
                   group.share.error * report.luminance.value + group.share.value * report.luminance.error,
                   reference[g + 1], group.expression);
    }
  }
  EXPECT_THROW(open(kRich, {}, settings, edit("light", "LX{box}X{floor}")), std::runtime_error);
}

// Claim: --select keeps the light of a layer with the same expression, by letters, sides, objects and
// regions.
TEST(InspectPaths, SelectsAsALayerDoes) {
  const SettingsMap settings = {{"max_depth", "5"}};
  const std::vector<std::string> expressions = {"L{ceiling}[DGSV]*DR{floor}E", "L[DGSV]*GE",
                                                "L[DGSV]+V[DGSV]*E|LV+[DGSV]*E", "L X@half E"};
  letters::Region half{"half", letters::Region::Kind::box, {-9, -1, -9}, {0, 9, 9}, 0};
  std::string layers = "region half=box:-9,-1,-9,0,9,9;";
  for (std::size_t i = 0; i < expressions.size(); ++i)
    layers += "layer e" + std::to_string(i) + "=" + expressions[i] + ";";
  const auto reference = rendered(kRich, layers, settings);
  for (std::size_t i = 0; i < expressions.size(); ++i) {
    const auto session = open(kRich, {expressions[i], {half}}, settings);
    const PathsReport report = inspect_of(*session, whole(400));
    const double light = report.selected.value * report.luminance.value;
    const double error =
        report.selected.error * report.luminance.value + report.selected.value * report.luminance.error;
    if (i == 2) {  // fog: a small part, with much noise
      EXPECT_NEAR(light, reference[i + 1].value, 5 * std::hypot(error, reference[i + 1].error));
      EXPECT_GT(light, 0);
      continue;
    }
    expect_equal(light, error, reference[i + 1], expressions[i]);
  }
}

// Claim: seen in a mirror, through a pane that bends nothing, and directly, light has these strings and no
// others, and all of the light of a constant sky.
TEST(InspectPaths, NamesPathsOfMirrorsExactly) {
  const std::string mirror = R"(<sensor type="perspective"><float name="fov" value="10"/></sensor>
    <shape type="rectangle" id="mirror"><transform name="to_world"><scale value="5"/><rotate y="1" angle="200"/>
      <translate z="4"/></transform><bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>
    <emitter type="constant" id="sky"><rgb name="radiance" value="1, 2, 3"/></emitter>)";
  const auto session = open(mirror);
  PathsReport report = inspect_of(*session, whole(4));
  ASSERT_EQ(report.groups.size(), 1u);
  EXPECT_EQ(report.groups[0].expression, "L SR E");
  EXPECT_EQ(report.groups[0].count, 4u * kSize * kSize);
  EXPECT_NEAR(report.groups[0].mean.y, 2, 1e-4);
  EXPECT_NEAR(report.groups[0].share.value, 1, 1e-12);
  const KeyPath& path = report.groups[0].key_paths.front();
  ASSERT_EQ(path.vertices.size(), 3u);
  EXPECT_TRUE(path.vertices[0].infinite);
  EXPECT_NEAR(length(path.vertices[2].p), 0, 1e-5) << "the eye stands at the origin";
  EXPECT_GT(path.vertices[1].p.z, 3);
  PathsRequest objects = whole(4);
  objects.by_object = true;
  report = inspect_of(*session, objects);
  ASSERT_EQ(report.groups.size(), 1u);
  EXPECT_EQ(report.groups[0].expression, "L{sky} X{mirror} E");

  std::string pane = mirror;
  pane.replace(pane.find("conductor"), 9, "dielectric");
  pane.replace(pane.find(R"(<string name="material" value="none"/>)"), 38, "");
  const auto glass = open(pane);
  const auto groups = by_expression(inspect_of(*glass, whole(64)));
  EXPECT_EQ(groups.size(), 2u);
  EXPECT_TRUE(groups.contains("L ST E") && groups.contains("L SR E"));
}

// Claim: of two lamps in one place, one three times as bright, a floor has three quarters and one quarter of
// its light, and half as much from within half of the pixels.
TEST(InspectPaths, SharesOfTwoLampsAreTheirPowers) {
  const std::string body =
      std::string(kCamera) +
      R"(<shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="30"/></transform><bsdf type="diffuse"/></shape>
    <emitter type="point" id="strong"><point name="position" x="0" y="5" z="0"/><rgb name="intensity" value="30, 30, 30"/></emitter>
    <emitter type="point" id="weak"><point name="position" x="0" y="5" z="0"/><rgb name="intensity" value="10, 10, 10"/></emitter>)";
  const auto session = open(body, {}, {{"max_depth", "2"}});
  PathsRequest request = whole(64);
  request.by_object = true;
  const PathsReport all = inspect_of(*session, request);
  const auto groups = by_expression(all);
  ASSERT_TRUE(groups.contains("L{strong} X{floor} E"));
  const Estimate share = groups.at("L{strong} X{floor} E")->share;
  EXPECT_GT(share.error, 0);
  EXPECT_LT(share.error, 0.02);
  EXPECT_NEAR(share.value, 0.75, 5 * share.error);

  // The spot: what the floor's left half sends, all of the light of the left pixels.
  request.spot = letters::Region{"spot", letters::Region::Kind::box, {-40, -1, -40}, {0, 1, 40}, 0};
  const PathsReport spot = inspect_of(*session, request);
  const double error = std::hypot(spot.luminance.error, all.luminance.error / 2);
  EXPECT_NEAR(spot.luminance.value, all.luminance.value / 2, 5 * error);
  request.spot.reset();
  request.pixels = {0, 0, kSize / 2 - 1, kSize - 1};
  const PathsReport left = inspect_of(*session, request);
  EXPECT_NEAR(left.luminance.value, 2 * spot.luminance.value,
              5 * std::hypot(2 * spot.luminance.error, left.luminance.error));
}

std::string text_of(const PathsReport& report) {
  std::string text =
      fmt::format("{} {} {}", report.luminance.value, report.luminance.error, report.selected.error);
  for (const PathGroup& group : report.groups) {
    text += fmt::format("\n{} {} {} {} {}", group.expression, group.share.value, group.share.error,
                        group.mean.x, group.count);
    for (const Vec3& p : group.mean_path) text += fmt::format(" {} {} {}", p.x, p.y, p.z);
    for (const KeyPath& path : group.key_paths) {
      text += fmt::format("\n  {}", path.rank);
      for (const PathVertex& v : path.vertices) text += fmt::format(" {} {}", v.p.x, v.throughput.g);
    }
  }
  return text;
}

// Claim: threads change not a bit, and the number of key paths is bounded and kept.
TEST(InspectPaths, DoNotDependOnThreads) {
  const auto session = open(kRich, {}, {{"max_depth", "6"}});
  PathsRequest request = whole(96);
  request.keep = 20;
  request.rows = 30;
  const PathsReport one = inspect_of(*session, request);
  request.threads = 3;
  EXPECT_EQ(text_of(one), text_of(inspect_of(*session, request)));
  EXPECT_GT(one.groups.size(), 12u);
  EXPECT_LE(one.groups.size(), 30u);
  std::size_t paths = 0;
  for (const PathGroup& group : one.groups) {
    paths += group.key_paths.size();
    EXPECT_GE(group.key_paths.size(), 1u);
  }
  EXPECT_GE(paths, 20u);
  EXPECT_LE(paths, 20u + one.groups.size());
}

// Claim: edits act as in a render: a floor that sends a quarter of the lamp's light has a quarter, and light
// that is moved has the luminance of the renderer's image.
TEST(InspectPaths, FollowsEdits) {
  const auto with_edits = [](const std::string& edits) {
    JobSettings job = job_of({{"max_depth", "3"}}, 77);
    job.edits = edits;
    const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + kRich + "</scene>"}});
    auto session = Session::open(files, "scene.xml", {}, job, {"LDRE|LGRE", {}}, 1);
    if (!session.ok()) throw std::runtime_error(session.error().to_string());
    return inspect_of(**session, whole(64));
  };
  const auto light = [](const PathsReport& report) { return report.selected.value * report.luminance.value; };
  const PathsReport plain = with_edits("");
  const PathsReport dim =
      with_edits(R"({"edits": [{"name": "dim", "direction": "light", "select": "L[XV]*X", "scale": 0.25}]})");
  EXPECT_NEAR(light(dim), light(plain) / 4, 0.02 * light(plain));
  JobSettings job = job_of({}, 77);
  job.integrator = "upbp";
  job.edits = R"({"edits": [{"name": "dim", "direction": "light", "select": "L[XV]*X", "scale": 0.25}]})";
  const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + kRich + "</scene>"}});
  EXPECT_FALSE(Session::open(files, "scene.xml", {}, job, {}, 1).ok());
}

RecordedPath path_of(std::size_t bounces) {
  RecordedPath path(bounces + 2);
  path.front().letter.fill(letters::Letter::lamp);
  for (std::size_t i = 1; i <= bounces; ++i) {
    path[i].letter.fill(letters::Letter::diffuse);
    path[i].side = letters::Side::reflected;
  }
  path.back().letter.fill(letters::Letter::eye);
  return path;
}

// Claim: strings beyond the cap, and paths beyond the longest, are in the other sum; nothing is lost, and
// what is not finite is counted apart.
TEST(InspectPaths, BoundsWhatIsTold) {
  const auto session = open(kRich);
  SumRules rules;
  rules.max_clusters = 2;
  rules.max_vertices = 6;
  rules.keep = 3;
  PathSums sums(*session, rules, 1);
  for (std::size_t bounces = 1; bounces <= 9; ++bounces)
    for (std::uint64_t i = 0; i < 5; ++i)
      sums.add(path_of(bounces), Spectrum(1.0f), bounces * 100 + i, nullptr);
  sums.add(path_of(1), Spectrum(std::nanf("")), 1, nullptr);
  EXPECT_EQ(sums.clusters().size(), 2u);
  EXPECT_EQ(sums.other().count, 35u);
  EXPECT_EQ(sums.kept().size(), 3u);
  EXPECT_EQ(sums.not_finite(), 1u);
  EXPECT_NEAR(sums.total().x, 45, 1e-9);
  for (const auto& [string, cluster] : sums.clusters()) EXPECT_EQ(cluster.count, 5u);
}

// Claim: channels whose letters differ are told apart, each with its own light.
TEST(InspectPaths, SplitsChannelsOfDifferentLetters) {
  const auto session = open(kRich);
  const SumRules rules;
  PathSums sums(*session, rules, 1);
  RecordedPath path = path_of(1);
  path[1].letter = {letters::Letter::diffuse, letters::Letter::glossy, letters::Letter::glossy};
  sums.add(path, {1, 2, 4}, 7, nullptr);
  path[1].letter = {letters::Letter::diffuse, letters::Letter::glossy, letters::Letter::diffuse};
  sums.add(path, {8, 16, 32}, 8, nullptr);
  ASSERT_EQ(sums.clusters().size(), 2u);
  std::map<std::string, Vec3d> light;
  for (const StringGroup& group : group_strings(sums.clusters(), false, 12))
    light[expression_of(group, false, *session)] = group.members[0]->second.sum;
  EXPECT_EQ(light.at("L DR E"), Vec3d(9, 0, 32));
  EXPECT_EQ(light.at("L GR E"), Vec3d(0, 18, 4));
}

// Claim: clustering is recursive: the brightest group is split first, from the end that is asked for, and
// groups that are not split have an expression for all that they hold.
TEST(InspectPaths, SplitsTheBrightestGroupFirst) {
  const auto session = open(kRich);
  const SumRules rules;
  PathSums sums(*session, rules, 1);
  const auto add = [&](const char* letters, float light) {
    RecordedPath path = path_of(std::string_view(letters).size());
    for (std::size_t i = 0; letters[i] != 0; ++i)
      path[i + 1].letter.fill(letters[i] == 'S' ? letters::Letter::specular : letters::Letter::diffuse);
    sums.add(path, Spectrum(light), std::hash<std::string>()(letters), nullptr);
  };
  add("DDD", 4);
  add("DSS", 1);
  add("DSD", 3);
  const auto texts = [&](bool from_light, std::size_t rows) {
    std::vector<std::string> out;
    for (const StringGroup& group : group_strings(sums.clusters(), from_light, rows))
      out.push_back(expression_of(group, from_light, *session));
    return out;
  };
  EXPECT_EQ(texts(false, 2), (std::vector<std::string>{"L [DGSV]* DR E", "L DR SR SR E"}));
  EXPECT_EQ(texts(false, 3), (std::vector<std::string>{"L DR DR DR E", "L DR SR DR E", "L DR SR SR E"}));
  EXPECT_EQ(texts(true, 2), (std::vector<std::string>{"L DR DR DR E", "L DR SR [DGSV]* E"}));
}

// Claim: the film of a job has, for each group, the sums that one machine has of the same samples: of light
// from a region that an expression selects, by letters and by objects, some of which have no name, or one
// that others have too.
TEST(InspectPaths, JobsHaveTheSameShares) {
  const SettingsMap depth = {{"max_depth", "4"}};
  const std::string body = R"(<bsdf type="diffuse" id="white"/>
    <shape type="sphere"><point name="center" x="0" y="1" z="2"/><ref id="white"/></shape>
    <shape type="sphere" id="egg"><point name="center" x="-1" y="1" z="3"/><ref id="white"/></shape>)" +
                           kRich;
  for (const bool by_object : {false, true}) {
    Selection selection;
    selection.expression = "L[DGSV]+[DG]E";
    const auto session = open(body, selection, depth);
    PathsRequest request = whole(48);
    request.pixels = {1, 2, 6, 7};
    request.by_object = by_object;
    request.rows = 16;
    request.spot = letters::Region{"spot", letters::Region::Kind::box, {-8, -1, -8}, {8, 1.5, 8}, 0};
    PathsReport report = inspect_of(*session, request);
    std::sort(report.groups.begin(), report.groups.end(), [&](const PathGroup& a, const PathGroup& b) {
      return is_narrower(a.common, b.common, *session);
    });
    ASSERT_GT(report.groups.size(), 4u);
    if (by_object) {
      const auto seen = [&](const std::string& name) {
        return std::any_of(report.groups.begin(), report.groups.end(), [&](const PathGroup& group) {
          return group.expression.find("X{" + name + "} E") != std::string::npos;
        });
      };
      EXPECT_TRUE(seen("white") && seen("egg"));
    }

    JobSettings job = job_of({}, 77);
    job.integrator = "shares";
    job.width = 32;
    job.height = 1;
    letters::LayerRequest layers = session->request();
    for (std::size_t i = 0; i < report.groups.size(); ++i)
      layers.layers.push_back({"g" + std::to_string(i), report.groups[i].expression});
    job.layers = letters::text_of(layers);
    SettingsMap settings = depth;
    for (const auto& [name, value] : {std::pair{"film_width", "8"},
                                      {"film_height", "8"},
                                      {"pixel_x0", "1"},
                                      {"pixel_y0", "2"},
                                      {"pixel_x1", "6"},
                                      {"pixel_y1", "7"},
                                      {"spot", "box"},
                                      {"low_x", "-8"},
                                      {"low_y", "-1"},
                                      {"low_z", "-8"},
                                      {"high_x", "8"},
                                      {"high_y", "1.5"},
                                      {"high_z", "8"},
                                      {"selects", "true"}})
      settings[name] = value;
    const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
    const auto renderer = test::make_renderer(files, job, settings);
    const auto film = test::render_job(*renderer, request.spp);
    const double samples = static_cast<double>(request.pixels.count() * request.spp);
    const auto mean_of_layer = [&](std::size_t layer, std::size_t c) {
      std::int64_t sum = 0;
      for (std::size_t b = 0; b < 32; ++b) sum += film->sums()[(layer * 32 + b) * 3 + c];
      return std::ldexp(static_cast<double>(sum), -test::kFilmScaleLog2) / samples;
    };
    for (std::size_t c = 0; c < 3; ++c) {
      const auto channel = static_cast<int>(c);
      EXPECT_NEAR(mean_of_layer(0, c), report.mean[channel], 1e-4 * report.mean[channel]);
      double rest = mean_of_layer(1, c);
      for (std::size_t i = 0; i < report.groups.size(); ++i) {
        const double expected = report.groups[i].mean[channel], found = mean_of_layer(2 + i, c);
        EXPECT_NEAR(found, expected, 1e-4 * (expected + report.mean[channel])) << report.groups[i].expression;
        rest -= found;
      }
      EXPECT_NEAR(rest, 0, 1e-4 * report.mean[channel]);
    }
  }
}

}  // namespace
}  // namespace candela::inspect
