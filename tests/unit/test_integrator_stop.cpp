// A stop ends reading, building, pilots and renders soon, in each integrator and each reader; and a unit
// rendered in blocks is the same unit.
#include <gtest/gtest.h>

#include <optional>

#include "common/base/work_monitor.h"
#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/unit/renderer_fixture.h"
#include "tests/unit/volume_file.h"

namespace candela {
namespace {

// Light goes from the floor to the ball and back, so that mlt and erpt, whose chains leave short paths alone,
// have some.
constexpr const char* kBox =
    R"(<scene version="3.0.0"><integrator type="path"/>
    <sensor type="perspective"><float name="fov" value="60"/></sensor>
    <shape type="sphere"><point name="center" x="0" y="0" z="4"/></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/>
      <translate y="-1" z="4"/></transform></shape>
    <shape type="rectangle"><transform name="to_world"><translate z="8"/></transform>
      <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
    <emitter type="constant"/></scene>)";

// Sets the monitor's stop when `key` is opened.
class StoppingFiles final : public description::FileSource {
 public:
  StoppingFiles(std::map<std::string, std::string> contents, std::string key, WorkMonitor& monitor)
      : files_(std::move(contents)), key_(std::move(key)), monitor_(monitor) {}
  Result<Bytes> open(const std::string& key) const override {
    if (key == key_) monitor_.stop = true;
    return files_.open(key);
  }

 private:
  test::TextFiles files_;
  std::string key_;
  WorkMonitor& monitor_;
};

JobSettings job_of(const std::string& integrator) {
  JobSettings job;
  job.integrator = integrator;
  job.width = 24;
  job.height = 16;
  job.seed = 3;
  const auto settings = render::complete_integrator_settings(integrator, {}, {});
  job.integrator_settings = *settings;
  return job;
}

// For a renderer of this scene whose file `key` is opened when the stop comes.
std::string error_of_building(std::map<std::string, std::string> files, const std::string& key,
                              WorkMonitor& monitor, const std::string& main = "scene.xml") {
  const StoppingFiles source(std::move(files), key, monitor);
  const WatchedWork watch(&monitor);
  const auto renderer = render::Renderer::create(source, main, {}, job_of("path"), 2);
  return renderer.ok() ? "it was built" : renderer.error().to_string();
}

std::string with_shape(const std::string& shape) {
  std::string scene = kBox;
  return scene.insert(scene.find("<emitter type=\"constant\""), shape);
}

std::string shape_of(const std::string& type, const std::string& file) {
  return with_shape("<shape type=\"" + type + "\"><string name=\"filename\" value=\"" + file +
                    "\"/></shape>");
}

// A grid of `side` x `side` vertices.
std::string obj_file(int side) {
  std::string text;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) text += fmt::format("v {} {} 3\n", x, y);
  for (int i = 1; i + side < side * side; ++i) text += fmt::format("f {} {} {}\n", i, i + 1, i + side);
  return text;
}

std::string ply_file(int count, const std::string& extra) {
  std::string text = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n",
      count, extra);
  for (int i = 0; i < count; ++i) text += fmt::format("{} {} 3\n", i, i % 7);
  return text + "3 0 1 2\n";
}

// Claim: a stop that comes while a file is read ends its reading: nothing is built, and no error of the file
// is told for it.
TEST(Stops, EndTheReadingOfFiles) {
  const auto volume = test::volume_file({20, 20, 20}, 1, std::vector<float>(8000, 1.0F));
  std::string curves;
  for (int i = 0; i < 2000; ++i) curves += fmt::format("{} {} 3 0.1\n", i, i % 5);
  const std::string medium =
      R"(<shape type="cube"><medium name="interior" type="heterogeneous"><volume name="sigma_t" type="gridvolume">
      <string name="filename" value="f.vol"/></volume></medium></shape>)";
  const std::string ppm = "P6\n64 64\n255\n" + std::string(3 * 64 * 64, 'x');
  const std::string texture =
      R"(<shape type="cube"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">
      <string name="filename" value="f.ppm"/></texture></bsdf></shape>)";
  struct Case {
    std::string scene, key, bytes;
  };
  const std::vector<Case> cases = {
      {shape_of("obj", "f.obj"), "f.obj", obj_file(60)},
      {shape_of("ply", "f.ply"), "f.ply", ply_file(3000, "")},
      {shape_of("bsplinecurve", "f.txt"), "f.txt", curves},
      {with_shape(medium), "f.vol", volume},
      {with_shape(texture), "f.ppm", ppm},
      {kBox, "scene.xml", kBox},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.key);
    std::map<std::string, std::string> files{{"scene.xml", c.scene}, {c.key, c.bytes}};
    WorkMonitor never;
    EXPECT_EQ(error_of_building(files, "nothing", never), "it was built");
    EXPECT_GT(never.steps, 0U);
    WorkMonitor monitor;
    EXPECT_EQ(error_of_building(files, c.key, monitor), "stopped");
  }
}

// Claim: reading a scene of pbrt stops as well.
TEST(Stops, EndTheReadingOfPbrtFiles) {
  std::string scene = "Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\n";
  for (int i = 0; i < 50; ++i) scene += "Shape \"sphere\"\n";
  WorkMonitor monitor;
  EXPECT_EQ(error_of_building({{"scene.pbrt", scene}}, "scene.pbrt", monitor, "scene.pbrt"), "stopped");
}

// Claim: a stop ends the trials of a build, the pilot and a render of each integrator; without one they run.
class StopsOf : public testing::TestWithParam<std::string> {};

TEST_P(StopsOf, EndPilotsAndRenders) {
  const test::TextFiles files(std::map<std::string, std::string>{{"scene.xml", kBox}});
  const auto& small = test::integrator_row(GetParam()).small;
  const auto renderer = test::make_renderer(files, job_of(GetParam()), {small.begin(), small.end()});
  {
    WorkMonitor monitor;
    const WatchedWork watch(&monitor);
    render::RunContext run{1, &monitor.stop, nullptr, &monitor.steps};
    EXPECT_TRUE(renderer->pilot(run).ok());
    EXPECT_GT(monitor.steps, 1000U) << "a step for each sample";
    monitor.stop = true;
    const auto stopped = renderer->pilot(run);
    ASSERT_FALSE(stopped.ok());
    EXPECT_EQ(stopped.error().to_string(), "stopped");
  }
}

// Claim: blocks of a unit's iterations, added to one output, are the unit: film, accumulators, counts, all
// bytes of its delta.
class BlocksOf : public testing::TestWithParam<std::string> {};

TEST_P(BlocksOf, AreTheUnit) {
  const test::TextFiles files(std::map<std::string, std::string>{{"scene.xml", kBox}});
  JobSettings job = job_of(GetParam());
  job.aovs = "depth:depth,albedo:albedo";
  const auto renderer = test::make_renderer(files, job, {});
  const auto pilot = renderer->pilot({});
  ASSERT_TRUE(pilot.ok());
  test::EpochRun epochs(*renderer, *pilot);
  const auto bytes_of = [&](const std::vector<std::uint64_t>& borders) {
    auto output = renderer->make_output(pilot->state);
    for (std::size_t i = 0; i + 1 < borders.size(); ++i) {
      const Unit block{Unit::Kind::iterations, 1, borders[i], borders[i + 1]};
      const auto input = epochs.input(block);
      EXPECT_TRUE(input.ok());
      EXPECT_TRUE(renderer->run(block, *input, output, {2}).ok());
    }
    film::DeltaInfo info;
    info.unit = {Unit::Kind::iterations, 1, borders.front(), borders.back()};
    info.layout = output.film->layout();
    info.scale_log2 = output.film->scale_log2();
    info.job_id = "job";
    info.build_id = "build";
    return integrators::encode_delta(info, output);
  };
  EXPECT_EQ(bytes_of({0, 4}), bytes_of({0, 1, 3, 4}));
}

// Claim: a unit of segments that is cut short is the unit of its first segments, and with the one of the
// others it makes the film of all: sums, counts, records.
class CutsOf : public testing::TestWithParam<std::string> {};

TEST_P(CutsOf, AreTheFirstSegments) {
  const test::TextFiles files(std::map<std::string, std::string>{{"scene.xml", kBox}});
  const auto& small = test::integrator_row(GetParam()).small;
  const auto renderer = test::make_renderer(files, job_of(GetParam()), {small.begin(), small.end()});
  const auto pilot = renderer->pilot({});
  ASSERT_TRUE(pilot.ok());
  NamedState state = pilot->state;
  state.bootstrap_b = 1;
  const std::uint64_t count = pilot->work.chains->chains / 2;
  ASSERT_GE(count, 3U);
  std::vector<chains::ChainStart> starts(count);
  render::UnitOutput table;
  ASSERT_TRUE(renderer->run({Unit::Kind::bootstrap, 0, 0, 4000}, {}, table, {2}).ok());
  for (std::uint64_t i = 0, sample = 0; i < count; ++i) {
    while (sample < table.table.size() && !(table.table[sample] > 0)) ++sample;
    ASSERT_LT(sample, table.table.size()) << "too few samples found light";
    starts[i].bootstrap_sample = sample++;
  }
  const auto run = [&](std::uint64_t begin, std::uint64_t end, render::RunContext context,
                       render::UnitOutput& output) {
    render::UnitInput input;
    input.state = state;
    input.starts = std::span(starts).subspan(begin, end - begin);
    EXPECT_TRUE(renderer->run({Unit::Kind::segments, 1, begin, end}, input, output, context).ok());
  };
  const auto sums = [](const render::UnitOutput& output) {
    const film::Layout layout = output.film->layout();
    return std::vector<std::int64_t>(
        output.film->sums(), output.film->sums() + layout.pixel_count() * layout.layers * film::kChannels);
  };
  const std::atomic<bool> yes{true};
  render::RunContext cut{2};
  cut.cut = &yes;
  auto first = renderer->make_output(state), same = renderer->make_output(state),
       all = renderer->make_output(state);
  run(0, count, cut, first);
  const std::uint64_t done = first.records.size();
  ASSERT_GE(done, 1U);
  ASSERT_LT(done, count);
  run(0, done, {1}, same);
  EXPECT_EQ(sums(first), sums(same));
  EXPECT_EQ(first.records, same.records);
  EXPECT_EQ(first.sample_counts(), same.sample_counts());
  run(0, count, {2}, all);
  EXPECT_EQ(all.records.size(), count);
  run(done, count, {1}, first);  // sums are added
  EXPECT_EQ(sums(first), sums(all));
  EXPECT_EQ(first.sample_counts(), all.sample_counts());
}

INSTANTIATE_TEST_SUITE_P(, CutsOf, testing::ValuesIn(test::chain_integrators()),
                         [](const auto& name) { return name.param; });

INSTANTIATE_TEST_SUITE_P(, StopsOf, testing::ValuesIn(test::all_integrators()),
                         [](const auto& name) { return name.param; });

std::vector<std::string> integrators_of_iterations() {
  std::vector<std::string> names = test::all_integrators();
  std::erase_if(names, [](const std::string& name) { return test::has_chains(name); });
  return names;
}
INSTANTIATE_TEST_SUITE_P(, BlocksOf, testing::ValuesIn(integrators_of_iterations()),
                         [](const auto& name) { return name.param; });

}  // namespace
}  // namespace candela
