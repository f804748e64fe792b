// Law 2 and law 3 inside one process: the film is a function of the job alone.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/statistical/harness.h"
#include "tests/unit/volume_file.h"

namespace candela::statistical {
namespace {

const char* const kScene =
    R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="8"/></integrator>
    <sensor type="perspective"><float name="fov" value="45"/>
      <transform name="to_world"><lookat origin="0, 4, 9" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>
      <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="1.2" y="1" z="0.5"/><bsdf type="dielectric"/></shape>
    <shape type="cube"><transform name="to_world"><translate x="-1.5" y="1"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.1"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="5"/></transform>
      <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
    <emitter type="constant"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter></scene>)";

// A mask, fog in glass, and a cloud: on a grid, or homogeneous for integrators that refuse grids.
std::string media_scene(bool grid) {
  const std::string inside =
      grid ? R"(<medium name="interior" type="heterogeneous"><float name="scale" value="4"/>
        <volume name="sigma_t" type="gridvolume"><string name="filename" value="v.vol"/>
          <transform name="to_world"><scale value="2"/><translate x="-2.5" z="-1"/></transform></volume>)"
           : R"(<medium name="interior" type="homogeneous"><rgb name="sigma_t" value="2, 3, 2.5"/>)";
  return R"(<scene version="3.0.0"><integrator type="volpath"><integer name="max_depth" value="12"/></integrator>
    <sensor type="perspective"><float name="fov" value="45"/>
      <transform name="to_world"><lookat origin="0, 4, 9" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>
      <bsdf type="mask"><float name="opacity" value="0.7"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>
    <shape type="sphere"><point name="center" x="1.2" y="1" z="0.5"/><bsdf type="dielectric"/>
      <medium name="interior" type="homogeneous"><rgb name="sigma_t" value="1, 2, 5"/></medium></shape>
    <shape type="cube"><transform name="to_world"><translate x="-1.5" y="1"/></transform>)" +
         inside +
         R"(<float name="albedo" value="0.95"/><phase type="hg"><float name="g" value="0.6"/></phase></medium></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="5"/></transform>
      <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
    <emitter type="constant"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter></scene>)";
}

film::Delta delta_of(const render::Renderer& renderer, const NamedState& state, const Unit& unit,
                     unsigned threads, test::EpochRun* epochs = nullptr) {
  render::RunContext run;
  run.threads = threads;
  auto output = renderer.make_output(state);
  const auto& film = output.film;
  const auto done =
      epochs != nullptr ? epochs->run(unit, output, run) : renderer.run(unit, {state, {}, {}}, output, run);
  EXPECT_TRUE(done.ok());
  film::DeltaInfo info;
  info.unit = unit;
  info.layout = film->layout();
  info.scale_log2 = film->scale_log2();
  info.job_id = "job";
  info.build_id = "build";
  film::DeltaShape shape(film->layout());
  for (const auto& sums : output.accumulators) shape.accumulators.push_back(sums->spec());
  auto delta = film::Delta::decode(integrators::encode_delta(info, output), shape);
  EXPECT_TRUE(delta.ok());
  return std::move(delta).value();
}

// Claim: threads, the way iterations are cut into units, and the order of merging leave no trace in the film,
// in the statistics of epochs and in the states that are decided from them.
void film_depends_on_the_job_alone(TestScene scene) {
  scene.settings.seed = 5;
  const auto renderer = make_renderer(scene);
  render::RunContext one;
  const auto pilot = renderer->pilot(one);
  ASSERT_TRUE(pilot.ok());
  const NamedState state = pilot->state;
  const film::Layout layout = renderer->make_output(state).film->layout();
  const auto unit = [](std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
    return Unit{Unit::Kind::iterations, half, begin, end};
  };
  const auto film_of = [&](const std::vector<Unit>& units, unsigned threads) {
    film::MergedFilm film(layout, state.film_scale_log2);
    test::EpochRun epochs(*renderer, *pilot);
    for (const Unit& u : epochs.cut(units))
      EXPECT_TRUE(film.merge(delta_of(*renderer, state, u, threads, &epochs)).ok());
    return film.serialise() + epochs.save();
  };
  const std::string whole = film_of({unit(0, 0, 6), unit(1, 0, 5)}, 1);
  EXPECT_EQ(whole, film_of({unit(0, 0, 6), unit(1, 0, 5)}, 2));
  EXPECT_EQ(whole, film_of({unit(1, 3, 5), unit(0, 1, 6), unit(1, 0, 3), unit(0, 0, 1)}, 3));
  // A renderer made anew, on another thread count, gives the same pilot.
  const auto again = make_renderer(scene);
  render::RunContext two;
  two.threads = 2;
  const auto second = again->pilot(two);
  ASSERT_TRUE(second.ok());
  EXPECT_EQ(second->state, state);
}

// Settings with which the few iterations of these tests have several epochs.
SettingsMap small_job(const std::string& integrator) {
  const auto& small = test::integrator_row(integrator).small;
  return {small.begin(), small.end()};
}

class ExactnessOf : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { ASSERT_TRUE(has_integrator(GetParam())) << GetParam(); }
};

TEST_P(ExactnessOf, FilmDependsOnTheJobAlone) {
  film_depends_on_the_job_alone(
      with_integrator(scene_from_xml(kScene, 70, 45), GetParam(), small_job(GetParam())));
}

TEST_P(ExactnessOf, FilmOfMediaDependsOnTheJobAlone) {
  TestScene scene = scene_from_xml(kScene, 70, 45);
  rng::Stream stream(4);
  std::vector<float> values;
  for (int i = 0; i < 9 * 8 * 7; ++i) values.push_back(stream.next_float());
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"scene.xml", media_scene(test::integrator_row(GetParam()).everything)},
      {"v.vol", test::volume_file({9, 8, 7}, 1, values)}});
  film_depends_on_the_job_alone(with_integrator(std::move(scene), GetParam(), small_job(GetParam())));
}

INSTANTIATE_TEST_SUITE_P(, ExactnessOf, testing::ValuesIn(test::iteration_integrators()),
                         [](const auto& one) { return one.param; });

// Claim: the same holds for photon beams in a grid of colors, whose flights record their weights.
TEST(Exactness, BeamsInAGridOfColorsDependOnTheJobAlone) {
  rng::Stream stream(5);
  std::vector<float> values;
  for (int i = 0; i < 3 * 9 * 8 * 7; ++i) values.push_back(stream.next_float());
  TestScene scene = scene_from_xml(kScene, 70, 45);
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"scene.xml", media_scene(true)}, {"v.vol", test::volume_file({9, 8, 7}, 3, values)}});
  SettingsMap settings = small_job("upbp");
  settings["techniques"] = "all";
  settings["connect_media"] = "0.5";
  film_depends_on_the_job_alone(with_integrator(std::move(scene), "upbp", settings));
}

// Claim: another seed is another image, and the halves are different estimates (the test above is not
// comparing zeros).
TEST(Exactness, SeedsAndHalvesDiffer) {
  TestScene scene = scene_from_xml(kScene, 32, 32);
  const auto a = render_batches(scene, 1, 2, 4);
  EXPECT_NE(a[0], a[1]);
  const auto renderer = make_renderer(scene);
  const NamedState state{20};
  film::MergedFilm film({32, 32, 1}, 20);
  ASSERT_TRUE(film.merge(delta_of(*renderer, state, {Unit::Kind::iterations, 0, 0, 4}, 1)).ok());
  ASSERT_TRUE(film.merge(delta_of(*renderer, state, {Unit::Kind::iterations, 1, 0, 4}, 1)).ok());
  EXPECT_NE(film.develop(0, film::MergedFilm::Which::half0), film.develop(0, film::MergedFilm::Which::half1));
}

// Spoils one sample in 64, by its key.
void spoil(std::uint64_t key, float* rgb) {
  switch (key % 64) {
    case 1:
      rgb[1] = std::numeric_limits<float>::quiet_NaN();
      break;
    case 2:
      rgb[0] = std::numeric_limits<float>::infinity();
      break;
    case 3:
      rgb[2] = -1.0f;
      break;
    case 4:
      rgb[0] = 1e30f;
      break;
    default:
      break;
  }
}

// Claim: NaN, infinite, negative and absurdly large samples never reach the film, and each is counted by its
// cause.
TEST(Exactness, SpoiledSamplesAreCountedAndKeptOut) {
  const TestScene scene = scene_from_xml(kScene, 32, 32);
  const auto renderer = make_renderer(scene);
  render::RunContext run;
  run.threads = 2;
  run.fault = &spoil;
  auto output = renderer->make_output(NamedState{20});
  const auto& film = output.film;
  ASSERT_TRUE(renderer->run({Unit::Kind::iterations, 0, 0, 64}, {}, output, run).ok());
  const film::SampleCounts sample_counts = film->sample_counts();
  EXPECT_EQ(sample_counts.eye_samples, 32U * 32 * 64);
  // Each cause is spoiled once in 64 of 65536 samples: 1024 expected, standard deviation 32; 6 of them allow
  // 2e-9. No statistics are taken here.
  for (int c = 0; c < film::kRejectCauses; ++c) {
    const auto count = static_cast<double>(sample_counts.rejected[static_cast<std::size_t>(c)]);
    const bool spoilt = static_cast<film::RejectCause>(c) != film::RejectCause::statistics;
    EXPECT_NEAR(count, spoilt ? 1024.0 : 0.0, spoilt ? 6 * 32.0 : 0.0) << c;
  }
  for (std::size_t i = 0; i < 32 * 32 * 3; ++i) {
    EXPECT_GE(film->sums()[i], 0);
    EXPECT_LT(film->sums()[i], std::int64_t{1} << 40);
  }
}

// Claim: a stop ends a unit early, with an error that says so.
TEST(Exactness, StopEndsAUnit) {
  const TestScene scene = scene_from_xml(kScene, 64, 64);
  const auto renderer = make_renderer(scene);
  const std::atomic<bool> stop{true};
  render::RunContext run;
  run.stop = &stop;
  auto output = renderer->make_output(NamedState{20});
  const auto done = renderer->run({Unit::Kind::iterations, 0, 0, 1000000}, {}, output, run);
  ASSERT_FALSE(done.ok());
  EXPECT_EQ(done.error().kind, ErrorKind::refused);
}

}  // namespace
}  // namespace candela::statistical
