// Measures the cost of an epoch beside its rendering: bytes on the wire, CPU time of a worker to encode the
// statistics, CPU time of the master to decode and merge them and to decide the next state, for a film of a
// real scene.
//
//   bench_epoch_cost SCENE.xml [WIDTH HEIGHT [ITERATIONS]]        default 1920 1080 8
//
// The first epoch of each integrator with adaptive radii, rendered as one unit for each half.
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "common/bundle/gather.h"
#include "common/film/delta.h"
#include "common/stages/decision.h"
#include "tests/bench/count_argument.h"
#include "tests/bench/thread_time.h"
#include "tests/epoch_run.h"
#include "worker/render/renderer.h"

namespace {

using namespace candela;
using bench::thread_cpu_seconds;

int fail(const std::string& message) {
  std::fprintf(stderr, "bench_epoch_cost: %s\n", message.c_str());
  return 2;
}

struct Method {
  const char* name;
  const char* integrator;
  SettingsMap settings;
};

struct Cost {
  double wire_bytes = 0, encode = 0, decode = 0, merge = 0;  // of all units of the epoch
  double decide = 0;
  std::size_t state_bytes = 0;
  std::uint64_t master_bytes = 0;  // of the carry and the sums of lag + 1 open epochs
  double photons = 0;              // share of the pixels with statistics
};

// The whole delta of the unit.
std::string encode(const render::UnitOutput& output, const film::DeltaInfo& info) {
  film::DeltaWriter writer(info);
  writer.film(*output.film);
  for (const auto& sums : output.accumulators) writer.accumulator(*sums, 0);
  writer.counts(output.film->sample_counts());
  return writer.finish();
}

Result<Cost> measure(const bundle::DiskSource& files, const std::string& scene, JobSettings settings,
                     std::uint64_t iterations) {
  CANDELA_ASSIGN(const auto renderer, render::Renderer::create(files, scene, {}, settings, 2));
  render::RunContext context;
  context.threads = 2;
  CANDELA_ASSIGN(const PilotResult pilot, renderer->pilot(context));
  if (!pilot.work.epochs) return input_error("nothing merges in this scene: there are no epochs");
  test::EpochRun epochs(*renderer, pilot);
  render::UnitOutput output = renderer->make_output(pilot.state);
  const film::Layout layout = output.film->layout();
  const std::vector<film::AccumulatorSpec> specs = epochs.accumulators();
  Carry carry = empty_carry(specs, layout.width, layout.height);
  const std::vector<film::MergedAccumulator> none = carry.sums;
  std::vector<film::MergedAccumulator> whole = none;
  Cost cost;
  for (const Unit& unit : epochs.units(0, iterations)) {
    output.clear();
    CANDELA_ASSIGN(const render::UnitInput input, epochs.input(unit));
    CANDELA_TRY(renderer->run(unit, input, output, context));
    film::DeltaInfo info;
    info.unit = unit;
    info.layout = layout;
    info.scale_log2 = output.film->scale_log2();
    info.job_id = info.build_id = "bench";
    // The film alone is encoded and decoded too: the difference is what statistics cost.
    const double begin = thread_cpu_seconds();
    std::string film_alone = film::encode_delta(*output.film, info);
    const double of_film = thread_cpu_seconds();
    const std::string bytes = encode(output, info);
    cost.encode += thread_cpu_seconds() - of_film - (of_film - begin);
    const double decoding = thread_cpu_seconds();
    CANDELA_TRY(film::Delta::decode(film_alone, layout));
    const double decoded = thread_cpu_seconds();
    CANDELA_ASSIGN(const film::Delta delta, film::Delta::decode(bytes, {layout, specs}));
    const double merging = thread_cpu_seconds();
    cost.decode += merging - decoded - (decoded - decoding);
    for (std::size_t i = 0; i < whole.size(); ++i) whole[i].merge(delta.accumulators()[i].sums);
    cost.merge += thread_cpu_seconds() - merging;
    cost.wire_bytes += static_cast<double>(delta.accumulator_bytes());
  }

  // The decisions before the first that folds an epoch, and this one.
  const EpochPlan& plan = *epochs.plan();
  std::vector<std::string> states;
  for (std::uint64_t epoch = 0; epoch <= plan.lag + 1; ++epoch) {
    DecisionInput input{plan, epoch, layout.width, layout.height, {}, {}};
    if (epoch > 0) input.previous = states.back();
    if (epoch > plan.lag) {
      input.folded = {0, states[0], {}};
      for (const film::MergedAccumulator& sums : whole) input.folded->sums.push_back(&sums);
    }
    const double begin = thread_cpu_seconds();
    CANDELA_ASSIGN(std::string state, decide(input, carry));
    cost.decide = thread_cpu_seconds() - begin;
    states.push_back(std::move(state));
  }
  cost.state_bytes = states.back().size();
  cost.master_bytes = statistics_bytes(pilot.work, layout.width, layout.height);
  std::uint64_t pixels = 0;
  std::vector<film::Int128> sums(whole[0].spec().channels);
  for (std::uint32_t y = 0; y < layout.height; ++y)
    for (std::uint32_t x = 0; x < layout.width; ++x) {
      whole[0].get_pixel(x, y, sums);
      for (const film::Int128 sum : sums)
        if (sum != 0) {
          ++pixels;
          break;
        }
    }
  cost.photons = static_cast<double>(pixels) / static_cast<double>(layout.pixel_count());
  return cost;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return fail("usage: SCENE.xml [WIDTH HEIGHT [ITERATIONS]]");
  const std::filesystem::path scene = argv[1];
  if (argc == 3) return fail("a width wants a height");
  JobSettings settings;
  settings.width = static_cast<std::uint32_t>(bench::count_argument("WIDTH", argc, argv, 2, 1920, 65536));
  settings.height = static_cast<std::uint32_t>(bench::count_argument("HEIGHT", argc, argv, 3, 1080, 65536));
  const std::uint64_t iterations = bench::count_argument("ITERATIONS", argc, argv, 4, 8, 1 << 20);
  const bundle::DiskSource files(scene.parent_path().empty() ? "." : scene.parent_path());

  const Method methods[] = {
      {"fppm", "fppm", {}},
      {"cppm", "cppm", {}},
      {"appm", "appm", {}},
      {"vcmplus", "vcmplus", {}},
  };
  std::printf(
      "%s, %u x %u, an epoch of %llu iterations: MB on the wire; CPU ms of workers to encode, of the master "
      "to decode + merge + decide; MB of the master's memory; MB of state; pixels with statistics\n",
      scene.filename().c_str(), settings.width, settings.height, static_cast<unsigned long long>(iterations));
  for (const Method& method : methods) {
    SettingsMap wanted = method.settings;
    wanted["epoch_min"] = std::to_string(iterations);
    const auto complete = render::complete_integrator_settings(method.integrator, wanted, {});
    if (!complete.ok()) return fail(complete.error().to_string());
    settings.integrator = method.integrator;
    settings.integrator_settings = *complete;
    const auto cost = measure(files, scene.filename(), settings, iterations);
    if (!cost.ok()) return fail(cost.error().to_string());
    std::printf("%-13s %7.1f MB  %6.0f  %6.0f + %5.0f + %5.0f  %6.0f MB  %5.1f MB  %5.1f %%\n", method.name,
                cost->wire_bytes * 1e-6, cost->encode * 1e3, cost->decode * 1e3, cost->merge * 1e3,
                cost->decide * 1e3, static_cast<double>(cost->master_bytes) * 1e-6,
                static_cast<double>(cost->state_bytes) * 1e-6, 100 * cost->photons);
    std::fflush(stdout);
  }
  return 0;
}
