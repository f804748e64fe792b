// Decisions of a job's pilot: units keep to the decision, and no unit makes a trial.
#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "common/base/work_monitor.h"
#include "common/film/codec.h"
#include "tests/integrators.h"
#include "tests/pilot_state.h"
#include "tests/unit/renderer_fixture.h"
#include "worker/integrators/decision_bytes.h"

namespace candela::integrators::pilots {
namespace {

// Fog between two lamps, a wall, and a glass ball: every integrator that can decide something has to. Without
// the fog for those that render none.
const std::string kFog =
    "<shape type=\"sphere\"><float name=\"radius\" value=\"0.9\"/><bsdf type=\"null\"/><medium "
    "name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"1\"/><rgb name=\"albedo\" "
    "value=\"0.5, 0.5, 0.5\"/></medium></shape>";
const std::string kRoom =
    "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>"
    "<shape type=\"cube\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"0.3\" y=\"-0.4\" z=\"0.4\"/><float name=\"radius\" "
    "value=\"0.3\"/><bsdf type=\"dielectric\"/></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.3\"/><rotate x=\"1\" "
    "angle=\"90\"/><translate y=\"0.99\"/></transform><emitter type=\"area\"/></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"-0.7\" y=\"-0.5\" z=\"0.7\"/><float name=\"radius\" "
    "value=\"0.05\"/><emitter type=\"area\"/></shape>";
constexpr std::uint32_t kSide = 12;

std::unique_ptr<render::Renderer> make(const std::string& integrator, const SettingsMap& chosen = {}) {
  const std::string fog = test::integrator_row(integrator).everything ? kFog : "";
  const test::TextFiles files(std::map<std::string, std::string>{{"scene.xml", kRoom + fog + "</scene>"}});
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = kSide;
  job.seed = 3;
  return test::make_renderer(files, job, chosen);
}

PilotResult pilot_of(const render::Renderer& renderer) {
  const auto pilot = renderer.pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  return *pilot;
}

// The integrators that decide something here, with the settings with which their first units are cheap.
struct Decider {
  std::string integrator;
  SettingsMap chosen = {};
  std::size_t numbers = 1;  // in the bytes
};
const std::vector<Decider>& deciders() {
  static const std::vector<Decider> all = {{"ppm"},
                                           {"bpm"},
                                           {"vcm"},
                                           {"upbp", {}, 6},
                                           {"fppm"},
                                           {"mcppm", {}, 2},
                                           {"cppm"},
                                           {"appm"},
                                           {"vcmplus"},
                                           {"optimis"},
                                           {"erpt", {{"bootstrap", "400"}, {"two_stage", "false"}}, 2}};
  return all;
}

UnitInput input_of(const PilotResult& pilot, const NamedState& state, std::string& map) {
  UnitInput input{state, {}, {}};
  map.assign(std::size_t{kSide} * kSide, '\0');
  if (pilot.work.epochs) input.states[pilot.work.epochs->rule] = map;
  return input;
}

Result<std::vector<std::int64_t>> film_of(const render::Renderer& renderer, const PilotResult& pilot,
                                          const NamedState& state) {
  std::string map;
  const UnitInput input = input_of(pilot, state, map);
  UnitOutput output = renderer.make_output(state);
  CANDELA_TRY(renderer.run({Unit::Kind::iterations, 0, 0, 1}, input, output, {}));
  const std::int64_t* sums = output.film->sums();
  return std::vector<std::int64_t>(sums, sums + std::size_t{kSide} * kSide * film::kChannels);
}

// Claim: the first unit that a renderer runs takes the same steps as the second, whatever the integrator, and
// to make a renderer takes no more steps than for one that decides nothing, but for the builder's own, which
// vary: trials, of at least 512 steps, are the pilot's alone.
TEST(Decisions, UnitsMakeNoTrials) {
  const auto steps_of = [](const auto& work) {
    WorkMonitor monitor;
    const WatchedWork watch(&monitor);
    work(monitor);
    return monitor.steps.load();
  };
  const std::uint64_t bare = steps_of([](WorkMonitor&) { make("path"); });
  for (const Decider& decider : deciders()) {
    const PilotResult pilot = pilot_of(*make(decider.integrator, decider.chosen));
    std::unique_ptr<render::Renderer> renderer;
    EXPECT_LT(steps_of([&](WorkMonitor&) { renderer = make(decider.integrator, decider.chosen); }),
              bare + 256)
        << decider.integrator;
    const auto unit = [&] {
      return steps_of([&](WorkMonitor& monitor) {
        std::string map;
        const UnitInput input = input_of(pilot, pilot.state, map);
        UnitOutput output = renderer->make_output(pilot.state);
        const RunContext context{1, &monitor.stop, nullptr, &monitor.steps};
        EXPECT_TRUE(renderer->run({Unit::Kind::iterations, 0, 0, 1}, input, output, context).ok());
      });
    };
    const std::uint64_t first = unit(), second = unit();
    EXPECT_EQ(first, second) << decider.integrator;
    EXPECT_GT(first, 0U);
  }
}

// Claim: what is decided is of numbers of 8 bytes behind four characters, the same for each renderer and any
// threads; an integrator that decides nothing says nothing.
TEST(Decisions, AreTheSameBytes) {
  for (const Decider& decider : deciders()) {
    const PilotResult one = pilot_of(*make(decider.integrator, decider.chosen));
    const auto two = make(decider.integrator, decider.chosen)->pilot({3});
    ASSERT_TRUE(two.ok());
    EXPECT_EQ(one.state, two->state) << decider.integrator;
    EXPECT_EQ(one.plan, two->plan) << decider.integrator;
    EXPECT_EQ(one.state.decided.size(), 4 + 8 * decider.numbers) << decider.integrator;
    EXPECT_EQ(one.plan, make(decider.integrator, decider.chosen)->plan_text().value()) << decider.integrator;
  }
  for (const char* integrator : {"path", "bdpt", "light"})
    EXPECT_EQ(pilot_of(*make(integrator)).state.decided, "") << integrator;
  for (const char* integrator : {"pssmlt", "mmlt"}) {
    const auto two = make(integrator)->pilot({3});
    ASSERT_TRUE(two.ok());
    EXPECT_NE(two->state.decided, "") << integrator;
    EXPECT_EQ(pilot_of(*make(integrator)).state, two->state) << integrator;
    EXPECT_EQ(pilot_of(*make(integrator, {{"two_stage", "false"}})).state.decided, "") << integrator;
  }
}

// Claim: a unit renders by the radius that it is given, not by one that it chooses, bit for bit.
TEST(Decisions, UnitsKeepToTheRadius) {
  for (const char* integrator : {"ppm", "vcm", "vcmplus"}) {
    const auto automatic = make(integrator);
    const PilotResult pilot = pilot_of(*automatic);
    const auto chosen = film_of(*automatic, pilot, pilot.state);
    ASSERT_TRUE(chosen.ok());
    // The same settings but for the radius: what they decide is another's.
    const auto wide = make(integrator, {{"radius", "0.2"}});
    const PilotResult wide_pilot = pilot_of(*wide);
    NamedState swapped = pilot.state;
    swapped.decided = wide_pilot.state.decided;
    const auto by_state = film_of(*automatic, pilot, swapped);
    ASSERT_TRUE(by_state.ok());
    EXPECT_NE(*by_state, *chosen) << integrator;
    EXPECT_EQ(*by_state, *film_of(*wide, wide_pilot, swapped)) << integrator;
  }
}

// Claim: bytes that no pilot of the job's integrator can have written end a unit with one error that names
// them, before anything is rendered: none, parts, more, another integrator's, other numbers.
TEST(Decisions, OtherBytesAreRefused) {
  const std::string radius = pilot_of(*make("ppm")).state.decided,
                    trial = pilot_of(*make("optimis")).state.decided;
  for (const Decider& decider : deciders()) {
    const auto renderer = make(decider.integrator, decider.chosen);
    const PilotResult pilot = pilot_of(*renderer);
    const std::string good = pilot.state.decided;
    std::vector<std::string> hostile = {"",
                                        "x",
                                        good + '\0',
                                        good.substr(0, 3) + static_cast<char>(good[3] + 1) + good.substr(4),
                                        std::string(Limits::max_decided_bytes, '\xff'),
                                        decider.integrator == "optimis" ? radius : trial};
    for (std::size_t size = 0; size < good.size(); ++size) hostile.push_back(good.substr(0, size));
    for (std::size_t at = 4; at < good.size(); at += 8)
      for (const double number : {-1.0, -1e300, std::numeric_limits<double>::infinity(),
                                  std::numeric_limits<double>::quiet_NaN()}) {
        std::string bytes = good.substr(0, at);
        film::put_u64(bytes, std::bit_cast<std::uint64_t>(number));
        hostile.push_back(bytes + good.substr(at + 8));
      }
    for (const std::string& bytes : hostile) {
      NamedState state = pilot.state;
      state.decided = bytes;
      const auto done = film_of(*renderer, pilot, state);
      ASSERT_FALSE(done.ok()) << decider.integrator << ", " << bytes.size() << " bytes";
      EXPECT_EQ(done.error().kind, ErrorKind::input);
      EXPECT_EQ(done.error().field, "named_state.decided");
    }
    EXPECT_TRUE(film_of(*renderer, pilot, pilot.state).ok());
  }
}

// Claim: numbers come back to the last bit, those at the ends of their ranges too, and the first fault is
// told.
TEST(Decisions, NumbersComeBackToTheLastBit) {
  DecisionWriter out("abc1");
  const std::vector<double> reals = {0.1, -0.0, 5e-324, 1.7976931348623157e308, 1 + 0x1p-52};
  out.count(6);
  for (const double real : reals) out.real(real);
  DecisionReader in(out.bytes(), "abc1");
  EXPECT_EQ(in.count(7), 6U);
  for (const double real : reals)
    EXPECT_EQ(std::bit_cast<std::uint64_t>(in.real(-1, 1.7976931348623157e308)),
              std::bit_cast<std::uint64_t>(real));
  EXPECT_TRUE(in.done().ok());
  DecisionReader low(out.bytes(), "abc1");
  EXPECT_EQ(low.count(6), 0U);
  EXPECT_EQ(low.real(3, 4), 3);
  EXPECT_NE(low.done().error().to_string().find("6 is not below 6"), std::string::npos);
  DecisionReader none("", "abc1");
  EXPECT_NE(none.done().error().to_string().find("submit the job again"), std::string::npos);
}

}  // namespace
}  // namespace candela::integrators::pilots
