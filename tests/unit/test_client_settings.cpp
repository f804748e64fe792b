// From scene and options to job settings: precedence, Mitsuba's defaults, and errors that name option or
// line.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "client/context.h"
#include "client/settings.h"
#include "tests/temporary_folder.h"

namespace candela::client {
namespace {

using description::Object;
using description::Property;
using description::PropertyType;

// A renderer with two integrators; unknown settings are refused as the real one does.
RendererFacts fake_facts() {
  RendererFacts facts;
  facts.integrator_names = [] { return std::vector<std::string>{"path", "bdpt"}; };
  facts.setting_names = [](const std::string& name) -> Result<std::vector<std::string>> {
    if (name == "bdpt") return std::vector<std::string>{"max_depth"};
    return std::vector<std::string>{"max_depth", "rr_depth"};
  };
  facts.complete_settings = [](const std::string&, const SettingsMap& scene,
                               const SettingsMap& user) -> Result<SettingsMap> {
    SettingsMap all = {{"max_depth", "-1"}, {"rr_depth", "5"}};
    for (const SettingsMap& map : {scene, user})
      for (const auto& [key, value] : map) {
        if (!all.contains(key)) return usage_error("unknown integrator setting").with_field(key);
        all[key] = value;
      }
    return all;
  };
  facts.settings_of_effort = [](const std::string&, const Effort&) -> Result<SettingsMap> {
    return SettingsMap{};
  };
  facts.samples_per_iteration = [](const std::string&, const SettingsMap&) -> Result<std::uint64_t> {
    return 1;
  };
  return facts;
}

// One of chains, whose rounds are so many mutations a pixel as its setting says.
RendererFacts facts_of_chains() {
  RendererFacts facts = fake_facts();
  facts.setting_names = [](const std::string&) -> Result<std::vector<std::string>> {
    return std::vector<std::string>{"mutations", "bootstrap"};
  };
  facts.complete_settings = [](const std::string&, const SettingsMap& scene,
                               const SettingsMap& user) -> Result<SettingsMap> {
    SettingsMap all = user;
    all.insert(scene.begin(), scene.end());
    all.insert({{"mutations", "16"}, {"bootstrap", "100000"}});
    return all;
  };
  facts.settings_of_effort = [](const std::string&, const Effort& effort) -> Result<SettingsMap> {
    return SettingsMap{
        {"mutations", std::to_string(effort.spp == 0 ? 16 : std::min<std::uint64_t>(effort.spp, 16))},
        {"bootstrap", std::to_string(effort.samples)}};
  };
  facts.samples_per_iteration = [](const std::string&, const SettingsMap& s) -> Result<std::uint64_t> {
    return std::stoull(s.at("mutations"));
  };
  return facts;
}

std::shared_ptr<Object> object(std::string category, std::string plugin, int line) {
  auto made = std::make_shared<Object>();
  made->category = std::move(category);
  made->plugin = std::move(plugin);
  made->where = {"scene.xml", line};
  return made;
}

void add_integer(Object& parent, std::string name, std::int64_t value, int line = 0) {
  parent.properties.push_back({std::move(name), PropertyType::integer, value, {"scene.xml", line}});
}

struct TestScene {
  std::shared_ptr<Object> scene = object("scene", "", 1);
  std::shared_ptr<Object> integrator = object("integrator", "path", 2);
  std::shared_ptr<Object> sensor = object("sensor", "perspective", 4);
  std::shared_ptr<Object> film = object("film", "hdrfilm", 5);
  std::shared_ptr<Object> rfilter = object("rfilter", "tent", 6);
  std::shared_ptr<Object> sampler = object("sampler", "independent", 7);
  TestScene() {
    add_integer(*integrator, "max_depth", 13, 3);
    add_integer(*film, "width", 320);
    add_integer(*film, "height", 200);
    add_integer(*sampler, "sample_count", 64);
    add_integer(*sampler, "seed", 9);
    film->children = {{"", rfilter}};
    sensor->children = {{"", film}, {"", sampler}};
    scene->children = {{"", integrator}, {"", sensor}};
  }
  Result<PreparedJob> prepare(const SceneOptions& options) const {
    return prepare_job({scene, {"scene.xml"}}, options, fake_facts());
  }
};

// Claim: without options, the scene decides everything, and sample_count is the limit.
TEST(Settings, SceneDecides) {
  const auto job = TestScene().prepare({});
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  EXPECT_EQ(job->settings.integrator, "path");
  EXPECT_EQ(job->settings.integrator_settings, (SettingsMap{{"max_depth", "13"}, {"rr_depth", "5"}}));
  EXPECT_EQ(job->settings.width, 320U);
  EXPECT_EQ(job->settings.height, 200U);
  EXPECT_EQ(job->settings.filter, "tent");
  EXPECT_EQ(job->settings.filter_settings, (SettingsMap{{"radius", "1"}}));
  EXPECT_EQ(job->settings.seed, 9U);
  EXPECT_EQ(job->stop.iterations, 64U);
  EXPECT_FALSE(job->stop_given);
}

// Claim: the scene's AOVs count unless the command line has some, or none.
TEST(Settings, AovsOfSceneAndCommandLine) {
  const auto aovs = [](const std::string& of_scene, const std::optional<std::string>& given) {
    const TestScene scene;
    SceneOptions options;
    options.aov = given;
    const auto job = prepare_job({scene.scene, {"scene.xml"}, {}, of_scene}, options, fake_facts());
    return job.ok() ? job->settings.aovs : job.error().to_string();
  };
  EXPECT_EQ(aovs("", {}), "");
  EXPECT_EQ(aovs("dd:depth", {}), "dd:depth");
  EXPECT_EQ(aovs("dd:depth", "normal,a:albedo"), "normal:sh_normal,a:albedo");
  EXPECT_EQ(aovs("dd:depth", "none"), "");
  EXPECT_TRUE(aovs("", "depth,x").starts_with("--aov: there is no AOV 'x'")) << aovs("", "depth,x");
}

// Claim: edits are read from a file or as JSON, and stored on one line; faults name the file or the option,
// and names are those of the scene.
TEST(Settings, EditsAreReadAndChecked) {
  const auto edits = [](const std::optional<std::string>& given) {
    SceneOptions options;
    options.edits = given;
    const auto job = TestScene().prepare(options);
    return job.ok() ? job->settings.edits : job.error().to_string();
  };
  const std::string text =
      R"({"edits":[{"name":"a","direction":"light","select":"LX*X","tint":[0.5,0.5,0.5]}]})";
  EXPECT_EQ(edits({}), "");
  EXPECT_EQ(edits("none"), "");
  EXPECT_EQ(edits(text), text);
  const test::TemporaryFolder folder;
  const std::string path = (folder.path() / "e.json").string();
  std::ofstream(path)
      << R"({ "edits": [ {"name": "a", "direction": "light", "select": "LX*X", "scale": 0.5} ] })";
  EXPECT_EQ(edits(path), text);
  std::ofstream(path) << "{";
  EXPECT_TRUE(edits(path).starts_with(path)) << edits(path);
  std::ofstream(path).close();
  EXPECT_EQ(edits(path), path + R"(: the file is empty (write {"edits": [ {...} ]}))");
  EXPECT_NE(edits((folder.path() / "none.json").string()).find("none.json"), std::string::npos);
  EXPECT_TRUE(edits(R"({"edits": [{}]})").starts_with("--edits: edits[0].name"))
      << edits(R"({"edits": [{}]})");
  // Settings of the scene count unless the command line has some, or none.
  TestScene scene;
  scene.scene->properties.push_back({"edits", description::PropertyType::string, text, {}});
  SceneOptions options;
  EXPECT_EQ(scene.prepare(options)->settings.edits, text);
  options.edits = "none";
  EXPECT_EQ(scene.prepare(options)->settings.edits, "");
  const std::string unknown =
      R"({"edits":[{"name":"a","direction":"light","select":"LX*X{nobody}","scale":0.5}]})";
  EXPECT_NE(edits(unknown).find("edit 'a', column 4: no object is called 'nobody'"), std::string::npos)
      << edits(unknown);
}

// Claim: the scene's layers count unless the command line names some, or none; regions and flags of the
// command line join either; what cannot be is refused with its option, and names with those of the scene.
TEST(Settings, LayersOfSceneAndCommandLine) {
  const auto layers = [](const std::string& of_scene, const auto& set) {
    const TestScene scene;
    SceneOptions options;
    set(options);
    const auto job = prepare_job({scene.scene, {"scene.xml"}, {}, {}, of_scene}, options, fake_facts());
    return job.ok() ? job->settings.layers : job.error().to_string();
  };
  const auto nothing = [](SceneOptions&) {};
  EXPECT_EQ(layers("", nothing), "");
  EXPECT_EQ(layers("layer a=LDE", nothing), "layer a=LDE");
  EXPECT_EQ(layers("layer a=LDE",
                   [](SceneOptions& o) {
                     o.layers = {"b=LE", "c=L[XV]+E"};
                   }),
            "layer b=LE; layer c=L[XV]+E");
  EXPECT_EQ(layers("layer a=LDE", [](SceneOptions& o) { o.layers = {"none"}; }), "");
  EXPECT_EQ(
      layers("layer a=LDE", [](SceneOptions& o) { o.layers = {"layer b=LX@r E; region r=sphere:0,0,0,1"}; }),
      "layer b=LX@r E; region r=sphere:0,0,0,1");
  EXPECT_EQ(layers("layer a=L[DGSV]*E",
                   [](SceneOptions& o) {
                     o.regions = {"r=box:0,0,0,1,1,1"};
                     o.glossy_below = "0.2";
                     o.partition = true;
                   }),
            "layer a=L[DGSV]*E; region r=box:0,0,0,1,1,1; glossy-below 0.2; partition");
  EXPECT_EQ(layers("layer a=LDE", [](SceneOptions& o) { o.light_groups = true; }), "light-groups");

  const auto refused = [&](const auto& set, const std::string& expected) {
    const std::string text = layers("", set);
    EXPECT_TRUE(text.starts_with(expected)) << text;
  };
  refused([](SceneOptions& o) { o.layers = {"a=L(E"}; },
          "--layer: layer 'a', column 2: this '(' is not closed");
  refused([](SceneOptions& o) { o.layers = {"a"}; }, "--layer: 'a' is no layer");
  refused([](SceneOptions& o) { o.layers = {"denoised=LE"}; },
          "--layer: a layer cannot be called 'denoised': the denoised image has that name");
  refused([](SceneOptions& o) { o.layers = {"a=LX{nobody}E"}; },
          "--layer: layer 'a', column 2: no object is called 'nobody'");
  refused([](SceneOptions& o) { o.layers = {"a=LDE"}, o.partition = true; },
          "--layer: the layers are no partition");
  refused([](SceneOptions& o) { o.regions = {"r=box:1"}; }, "--region: 'r=box:1' is no region");
  refused([](SceneOptions& o) { o.glossy_below = "x"; }, "--glossy-below: 'x' is no roughness");
  refused([](SceneOptions& o) { o.light_groups = o.partition = true; },
          "--layer: light groups make no layer: the scene has no lamp");
  refused([](SceneOptions& o) { o.partition = true; },
          "regions, glossy-below and partition belong to layers");
}

// Claim: each filter takes the numbers that are its own from the scene, defaults elsewhere, and nothing of
// another's.
TEST(Settings, FiltersTakeTheirOwnNumbers) {
  const auto settings = [](const TestScene& scene, const SceneOptions& options) {
    const auto job = scene.prepare(options);
    EXPECT_TRUE(job.ok()) << job.error().to_string();
    return job.ok() ? job->settings.filter_settings : SettingsMap{};
  };
  TestScene lanczos;
  lanczos.rfilter->plugin = "lanczos";
  EXPECT_EQ(settings(lanczos, {}), (SettingsMap{{"lobes", "3"}}));
  add_integer(*lanczos.rfilter, "lobes", 5);
  EXPECT_EQ(settings(lanczos, {}), (SettingsMap{{"lobes", "5"}}));
  SceneOptions options;
  options.filter = "catmullrom";
  EXPECT_EQ(settings(lanczos, options), SettingsMap{});
  TestScene mitchell;
  mitchell.rfilter->plugin = "mitchell";
  mitchell.rfilter->properties.push_back({"B", PropertyType::number, 0.25, {"scene.xml", 6}});
  const SettingsMap found = settings(mitchell, {});
  EXPECT_EQ(found.at("B"), "0.25");
  EXPECT_EQ(found.at("C").substr(0, 6), "0.3333");
  EXPECT_EQ(found.size(), 2U);
}

// Claim: options beat the scene, one by one; a given limit replaces sample_count, and several limits stay
// together.
TEST(Settings, OptionsBeatTheScene) {
  SceneOptions options;
  options.integrator.emplace("bdpt");
  options.sets = {"max_depth=4"};
  options.size = "64x32";
  options.filter = "box";
  options.sampler = "independent";
  options.seed = "1";
  options.isa = "sse4.2";
  options.time = "10m";
  options.until = "relmse=1e-3";
  const auto job = TestScene().prepare(options);
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  EXPECT_EQ(job->settings.integrator, "bdpt");
  EXPECT_EQ(job->settings.integrator_settings.at("max_depth"), "4");
  EXPECT_EQ(job->settings.width, 64U);
  EXPECT_EQ(job->settings.filter, "box");
  EXPECT_EQ(job->settings.filter_settings, (SettingsMap{{"radius", "0.5"}}));
  EXPECT_EQ(job->settings.sampler, "independent");
  EXPECT_EQ(job->settings.seed, 1U);
  EXPECT_EQ(job->settings.isa, "sse4.2");
  EXPECT_EQ(job->stop.iterations, 0U);
  EXPECT_DOUBLE_EQ(job->stop.time_seconds, 600);
  EXPECT_DOUBLE_EQ(job->stop.relmse, 1e-3);
  EXPECT_TRUE(job->stop_given);
}

// Claim: a crop is a window of the image that would be rendered without it, up to its last pixel; one beyond
// the image, an empty one and what is no window are refused by name.
TEST(Settings, CropsAreWithinTheImage) {
  SceneOptions options;
  options.size = "64x32";
  options.crop = "60,0,4,32";
  const auto job = TestScene().prepare(options);
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  EXPECT_EQ(job->settings.width, 4U);
  EXPECT_EQ(job->settings.height, 32U);
  EXPECT_EQ(job->settings.crop, (Crop{60, 0, 64, 32}));
  for (const char* beyond : {"61,0,4,32", "0,1,4,32", "65,0,1,1", "0,0,65,1", "65535,65535,65536,65536"}) {
    options.crop = beyond;
    const auto refused = TestScene().prepare(options);
    ASSERT_FALSE(refused.ok()) << beyond;
    EXPECT_EQ(refused.error().field, "--crop");
    EXPECT_NE(refused.error().message.find("64 x 32"), std::string::npos) << refused.error().message;
  }
  for (const char* bad : {"", "1,2,3", "1,2,3,4,5", "1,2,3,", "0,0,0,1", "0,0,1,0", "-1,0,1,1", "a,0,1,1",
                          "0,0,1,70000", "0,0,4x4", " 0,0,1,1", "0,0,1,1,"}) {
    options.crop = bad;
    const auto refused = TestScene().prepare(options);
    ASSERT_FALSE(refused.ok()) << bad;
    EXPECT_EQ(refused.error().field, "--crop") << bad;
  }
  options.crop = "0,0,1,1";
  TestScene meter;
  meter.sensor->plugin = "irradiancemeter";
  const auto refused = meter.prepare(options);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().field, "--crop");
}

// Claim: under another integrator, settings both know carry over and the others do not stand in the way.
TEST(Settings, SharedSettingsCarryOver) {
  TestScene scene;
  scene.integrator->plugin = "volpath";
  add_integer(*scene.integrator, "volpath_only", 1, 3);
  SceneOptions options;
  options.integrator = "path";
  const auto job = scene.prepare(options);
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  EXPECT_EQ(job->settings.integrator_settings.at("max_depth"), "13");
}

// Claim: flags of Mitsuba 0.6's mutations become shares of mlt and erpt, unless the command line has a
// preset; they count for no other integrator.
TEST(Settings, FlagsOfMutationsAreShares) {
  RendererFacts facts = facts_of_chains();
  facts.integrator_names = [] { return std::vector<std::string>{"path", "mlt", "erpt"}; };
  TestScene scene;
  scene.integrator->plugin = "mlt";
  scene.integrator->properties.clear();
  const auto flag = [&](const char* name, bool on) {
    scene.integrator->properties.push_back({name, PropertyType::boolean, on, {"scene.xml", 3}});
  };
  flag("manifold_perturbation", true);
  flag("lens_perturbation", false);
  const auto settings = [&](const SceneOptions& options) {
    const auto job = prepare_job({scene.scene, {"scene.xml"}}, options, facts);
    EXPECT_TRUE(job.ok()) << job.error().to_string();
    return job.ok() ? job->settings.integrator_settings : SettingsMap{};
  };
  EXPECT_EQ(settings({}).at("manifold"), "1");
  EXPECT_EQ(settings({}).at("lens"), "0");
  EXPECT_FALSE(settings({}).contains("manifold_perturbation"));
  scene.integrator->plugin = "erpt";
  EXPECT_EQ(settings({}).at("manifold"), "1");
  EXPECT_EQ(settings({}).at("lens"), "0");
  scene.integrator->plugin = "mlt";
  SceneOptions options;
  options.sets = {"preset=hslt"};
  EXPECT_FALSE(settings(options).contains("manifold"));
  options.sets = {};
  options.integrator = "path";
  EXPECT_FALSE(settings(options).contains("manifold"));
}

// Claim: a parameter of Mitsuba that is passed over stays so where a setting has its name, whatever its
// value.
TEST(Settings, IgnoredParametersAreNoSettings) {
  RendererFacts facts = facts_of_chains();
  facts.integrator_names = [] { return std::vector<std::string>{"erpt"}; };
  facts.setting_names = [](const std::string&) -> Result<std::vector<std::string>> {
    return std::vector<std::string>{"max_chains", "chain_length", "direct_samples"};
  };
  TestScene scene;
  scene.integrator->plugin = "erpt";
  scene.integrator->properties.clear();
  for (const char* name : {"max_chains", "chain_length", "direct_samples", "num_chains"})
    add_integer(*scene.integrator, name, -1, 3);
  const auto job = prepare_job({scene.scene, {"scene.xml"}}, {}, facts);
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  for (const char* name : {"max_chains", "chain_length", "direct_samples", "num_chains"})
    EXPECT_FALSE(job->settings.integrator_settings.contains(name)) << name;
}

// Claim: a value of another integrator that the chosen one cannot have does not count, and is no error; of
// its own it is one.
TEST(Settings, BadValuesOfOtherIntegratorsDoNotCount) {
  RendererFacts facts = fake_facts();
  facts.complete_settings = [](const std::string&, const SettingsMap& scene,
                               const SettingsMap&) -> Result<SettingsMap> {
    if (scene.contains("max_depth")) return usage_error("too deep").with_field("max_depth");
    return scene;
  };
  TestScene scene;
  add_integer(*scene.integrator, "rr_depth", 4, 3);
  EXPECT_FALSE(prepare_job({scene.scene, {"scene.xml"}}, {}, facts).ok());
  scene.integrator->plugin = "erpt";
  SceneOptions options;
  options.integrator = "path";
  const auto job = prepare_job({scene.scene, {"scene.xml"}}, options, facts);
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  EXPECT_EQ(job->settings.integrator_settings, (SettingsMap{{"rr_depth", "4"}}));
  ASSERT_TRUE(job->other_integrator);
  EXPECT_EQ(job->other_integrator->text,
            "the scene asks for the integrator 'erpt', the command line for 'path'; of the scene's counts "
            "rr_depth = 4");
}

// Claim: --spp, and a scene's sample_count, count samples per pixel of every integrator: of chains, as many
// rounds as bring them, with the settings that this effort decides unless somebody gave them.
TEST(Settings, EffortInSamplesPerPixel) {
  const auto prepared = [](SceneOptions options, bool of_chains) {
    TestScene scene;
    scene.integrator->properties.clear();
    const auto job =
        prepare_job({scene.scene, {"scene.xml"}}, options, of_chains ? facts_of_chains() : fake_facts());
    EXPECT_TRUE(job.ok()) << job.error().to_string();
    return job.ok() ? job.value() : PreparedJob();
  };
  SceneOptions options;
  EXPECT_EQ(prepared(options, false).stop.iterations, 64U);
  EXPECT_EQ(prepared(options, true).stop.iterations, 4U) << "64 samples a pixel, 16 a round";
  options.spp = "20";
  EXPECT_EQ(prepared(options, false).stop.iterations, 20U);
  EXPECT_TRUE(prepared(options, false).stop_given);
  EXPECT_EQ(prepared(options, true).stop.iterations, 2U) << "whole rounds";
  options.spp = "3";
  const PreparedJob few = prepared(options, true);
  EXPECT_EQ(few.stop.iterations, 1U);
  EXPECT_EQ(few.settings.integrator_settings, (SettingsMap{{"mutations", "3"}, {"bootstrap", "192000"}}));
  options.sets = {"mutations=2"};
  const PreparedJob given = prepared(options, true);
  EXPECT_EQ(given.stop.iterations, 2U);
  EXPECT_EQ(given.settings.integrator_settings, (SettingsMap{{"mutations", "2"}, {"bootstrap", "192000"}}));
  options.iterations = "4";
  const auto both = prepare_job({TestScene().scene, {"scene.xml"}}, options, fake_facts());
  ASSERT_FALSE(both.ok());
  EXPECT_EQ(both.error().exit_code(), 2);
  EXPECT_NE(both.error().to_string().find("--spp"), std::string::npos);
  options.spp.reset();
  EXPECT_EQ(prepared(options, true).stop.iterations, 4U) << "rounds";
  const PreparedJob rounds = prepared(options, true);
  EXPECT_EQ(rounds.settings.integrator_settings, (SettingsMap{{"mutations", "2"}, {"bootstrap", "512000"}}))
      << "four rounds of two mutations a pixel";
  options.iterations.reset();
  options.spp = "0";
  EXPECT_FALSE(prepare_job({TestScene().scene, {"scene.xml"}}, options, fake_facts()).ok());
}

// Claim: a job that goes on keeps what its first effort decided, so that --spp can be raised; what somebody
// gave stays given.
TEST(Settings, AnExtendedJobKeepsItsEffort) {
  const RendererFacts facts = facts_of_chains();
  TestScene scene;
  scene.integrator->properties.clear();
  SceneOptions options;
  options.spp = "3";
  const auto first = prepare_job({scene.scene, {"scene.xml"}}, options, facts);
  ASSERT_TRUE(first.ok());
  options.spp = "64";
  auto more = prepare_job({scene.scene, {"scene.xml"}}, options, facts);
  ASSERT_TRUE(more.ok());
  EXPECT_NE(difference(more->settings, first->settings), "");
  ASSERT_TRUE(keep_effort_of(first->settings, facts, more.value()).ok());
  EXPECT_EQ(difference(more->settings, first->settings), "");
  EXPECT_EQ(more->stop.iterations, 22U);
  // By other limits than the first.
  options.spp.reset();
  for (auto* limit : {&options.time, &options.iterations}) {
    *limit = "5";
    auto longer = prepare_job({scene.scene, {"scene.xml"}}, options, facts);
    ASSERT_TRUE(longer.ok());
    ASSERT_TRUE(keep_effort_of(first->settings, facts, longer.value()).ok());
    EXPECT_EQ(difference(longer->settings, first->settings), "");
    EXPECT_EQ(longer->stop.iterations, limit == &options.time ? 0U : 5U);
    limit->reset();
  }
  options.spp = "64";
  options.sets = {"mutations=16"};
  auto other = prepare_job({scene.scene, {"scene.xml"}}, options, facts);
  ASSERT_TRUE(other.ok());
  ASSERT_TRUE(keep_effort_of(first->settings, facts, other.value()).ok());
  EXPECT_EQ(difference(other->settings, first->settings), "mutations is 16, was 3");
}

// Claim: what a scene leaves out is Mitsuba's default.
TEST(Settings, MitsubaDefaults) {
  TestScene scene;
  scene.sensor->children.clear();
  const auto job = scene.prepare({});
  ASSERT_TRUE(job.ok()) << job.error().to_string();
  EXPECT_EQ(job->settings.width, 768U);
  EXPECT_EQ(job->settings.height, 576U);
  EXPECT_EQ(job->settings.filter, "gaussian");
  EXPECT_EQ(job->settings.filter_settings, (SettingsMap{{"stddev", "0.5"}}));
  EXPECT_EQ(job->stop.iterations, 4U);
}

// Claim: each bad option or scene gives one error naming where it was written and the mend; the kind makes it
// exit code 2.
TEST(Settings, ErrorsSayWhere) {
  const auto error_of = [](const TestScene& scene, const SceneOptions& options) {
    const auto job = scene.prepare(options);
    if (job.ok()) return std::string("no error");
    EXPECT_EQ(job.error().exit_code(), 2);
    return job.error().to_string();
  };
  SceneOptions options;
  options.integrator = "paht";
  EXPECT_EQ(error_of({}, options), "--integrator: unknown value 'paht' (did you mean 'path'?)");
  options = {};
  options.sets = {"max_dept=3"};
  EXPECT_EQ(error_of({}, options), "--set max_dept: unknown integrator setting");
  options.sets = {"max_depth=3", "max_depth=4"};
  EXPECT_EQ(error_of({}, options), "--set: 'max_depth' is given twice");
  options.sets = {"max_depth"};
  EXPECT_EQ(error_of({}, options), "--set: 'max_depth' is not of the form name=value");
  options = {};
  options.iterations = "0";
  EXPECT_NE(error_of({}, options).find("--iterations: '0' is not a whole number from 1"), std::string::npos);

  TestScene scene;
  scene.integrator->plugin = "volpath";
  EXPECT_EQ(error_of(scene, {}),
            "scene.xml:2: there is no integrator 'volpath' here (give --integrator, one of path, bdpt)");
  scene = {};
  add_integer(*scene.integrator, "odd", 1, 33);
  EXPECT_EQ(error_of(scene, {}), "scene.xml:33: odd: unknown integrator setting");
  scene = {};
  scene.film->properties.clear();
  add_integer(*scene.film, "width", 0);
  EXPECT_NE(error_of(scene, {}).find("scene.xml:5: film size: '0x576' is not a size"), std::string::npos);
  scene = {};
  scene.sampler->properties.clear();
  add_integer(*scene.sampler, "sample_count", -1);
  EXPECT_NE(error_of(scene, {}).find("scene.xml:7: sample_count is -1"), std::string::npos);
  scene = {};
  scene.rfilter->plugin = "sinc";
  EXPECT_NE(error_of(scene, {}).find("scene.xml:6: there is no rfilter 'sinc' here"), std::string::npos);
  scene = {};
  scene.scene->children = {{"", scene.integrator}};
  EXPECT_EQ(error_of(scene, {}), "scene.xml:1: the scene has no sensor");
}

// Claim: --resume's comparison of settings names each thing that differs, and only those.
TEST(Settings, DifferenceNamesWhatDiffers) {
  JobSettings a;
  a.integrator_settings = {{"max_depth", "3"}};
  JobSettings b = a;
  EXPECT_EQ(difference(a, b), "");
  b.seed = 7;
  b.integrator_settings = {{"max_depth", "4"}};
  EXPECT_EQ(difference(a, b), "max_depth is 3, was 4; seed is 0, was 7");
}

// Claim: option beats environment beats file for the master's address, and a bad timeout says where it came
// from.
TEST(Settings, ConnectionPrecedence) {
  const std::string file = testing::TempDir() + "/candela-client-" + std::to_string(::getpid()) + ".toml";
  std::ofstream(file) << "[client]\nmaster = \"file:1\"\ntimeout = \"soon\"\n";
  ::setenv("CANDELA_CONFIG", file.c_str(), 1);
  ::unsetenv("CANDELA_MASTER");
  ::unsetenv("CANDELA_TIMEOUT");
  const auto config = Config::load();
  ASSERT_TRUE(config.ok());
  FarmOptions options;
  auto connection = resolve_connection(options, *config);
  ASSERT_FALSE(connection.ok());
  EXPECT_EQ(connection.error().field, file + ":3");
  options.timeout = "3s";
  connection = resolve_connection(options, *config);
  ASSERT_TRUE(connection.ok()) << connection.error().to_string();
  EXPECT_EQ(connection->master, "file:1");
  EXPECT_DOUBLE_EQ(connection->timeout_seconds, 3);
  ::setenv("CANDELA_MASTER", "env:2", 1);
  EXPECT_EQ(resolve_connection(options, *config)->master, "env:2");
  options.master = "option:3";
  EXPECT_EQ(resolve_connection(options, *config)->master, "option:3");
  ::unsetenv("CANDELA_MASTER");
  ::unsetenv("CANDELA_CONFIG");
  ::unlink(file.c_str());
}

}  // namespace
}  // namespace candela::client
