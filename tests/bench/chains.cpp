// Integrators of Markov chains beside path and bdpt: mutations (or samples) a CPU second, bytes of a chain's
// state and of a pushed segment, and relMSE times CPU seconds against the references of SHARED. One thread,
// CPU seconds (user) of rendering alone, those of pilot and bootstrap included; methods in turn for each
// seed, medians over seeds.
//
//   bench_chains SHARED [--scenes A,B] [--methods A,B] [--seeds N] [--rounds N | --seconds S] [--set
//   KEY=VALUE]
// A scene is a name in SHARED, or a file NAME.xml of the sources; its reference is
// SHARED/references/NAME.exr. A method is a row's name, with - for a space. --rounds: of segments; iterations
// of erpt; iterations of the others are 8 times that. --seconds: CPU seconds of a method and seed. Mitsuba
// 0.6 on veach-bidir (../shared/peers.md, measured on a machine of this kind on another day): pssmlt over
// bdpt 0.079 M, over path 0.27 M mutations a CPU second.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "common/bundle/gather.h"
#include "common/image/image.h"
#include "common/stats/image_error.h"
#include "tests/bench/count_argument.h"
#include "tests/integrators.h"
#include "tests/paths.h"
#include "tests/statistical/chain_driver.h"

namespace {

using namespace candela;
using namespace candela::statistical;

// A worker pushes this of a unit: the film's delta and the chains' records behind it.
struct Pushed {
  std::uint64_t segments = 0;
  std::size_t delta_bytes = 0, record_bytes = 0;
};

struct Row {
  std::string name, integrator;
  SettingsMap settings;
  std::vector<double> rates, seconds, efficiencies, trimmed;
  std::uint64_t rounds = 0;  // or iterations; 0: not known yet
  double acceptance = 0, large_acceptance = 0;
  double mean_bytes = 0;
  std::size_t most_bytes = 0;
  std::vector<Pushed> pushed;
  std::vector<chains::MutationCounts> by_mutation;
};

Row row_of(const std::string& name, const std::string& integrator, const SettingsMap& settings) {
  Row row;
  row.name = name;
  row.integrator = integrator;
  row.settings = settings;
  return row;
}

// A scene of the sources.
TestScene scene_from_source(const std::filesystem::path& file, std::uint32_t width, std::uint32_t height) {
  TestScene scene;
  const std::filesystem::path whole = test::source_path(file.string());
  scene.files = std::make_shared<bundle::DiskSource>(whole.parent_path());
  scene.main_key = whole.filename();
  return read_scene(std::move(scene), width, height);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n == 0 ? NAN : (values[(n - 1) / 2] + values[n / 2]) / 2;
}

// Image, rate and CPU seconds of one seed.
struct Sample {
  std::vector<float> image;
  double count = 0, rate_seconds = 0, seconds = 0;
};

// The next units of a job that has come so far: of one segment, and of as many as two workers get at most.
std::vector<Pushed> push_next(const ChainJob& job, const ChainImage& so_far, std::uint64_t seed) {
  TestScene scene = job.scene;
  scene.settings.seed = seed;
  const auto renderer = make_renderer(scene);
  const std::uint64_t each = so_far.plan.chains / 2;
  std::vector<Pushed> out;
  for (const std::uint64_t segments : {std::uint64_t{1}, std::max<std::uint64_t>(each / 4, 1)}) {
    const Unit unit{Unit::Kind::segments, 0, job.rounds * each, job.rounds * each + segments};
    std::vector<chains::ChainStart> starts;
    for (std::uint64_t i = unit.begin; i < unit.end; ++i)
      starts.push_back({0, so_far.records[chains::chain_of(unit.half, i, so_far.plan.chains)]});
    auto output = renderer->make_output(so_far.state);
    if (!renderer->run(unit, {so_far.state, {}, starts}, output, {}).ok()) std::abort();
    const std::string delta = encode_delta({unit, {}, 0, "a job", "a build"}, output);
    const std::size_t records = chains::encode(std::span<const chains::ChainRecord>(output.records)).size();
    out.push_back({segments, delta.size() - records, records});
  }
  return out;
}

Sample run_chains(Row& row, const TestScene& scene, std::uint64_t seed, std::uint64_t rounds) {
  ChainJob job;
  job.scene = scene;
  job.rounds = rounds;
  const ChainImage result = render_chains(job, seed);
  chains::ChainCounts all;
  std::size_t bytes = 0;
  for (const auto& record : result.records) {
    all.mutations += record.counts.mutations;
    all.accepted += record.counts.accepted;
    all.large_steps += record.counts.large_steps;
    all.large_accepted += record.counts.large_accepted;
    chains::add(row.by_mutation, record.counts.by_mutation);
    bytes += record.state.size();
    row.most_bytes = std::max(row.most_bytes, record.state.size());
  }
  if (row.pushed.empty()) row.pushed = push_next(job, result, seed);
  row.mean_bytes = static_cast<double>(bytes) / static_cast<double>(result.records.size());
  row.acceptance = static_cast<double>(all.accepted) / static_cast<double>(all.mutations);
  row.large_acceptance = static_cast<double>(all.large_accepted) / static_cast<double>(all.large_steps);
  return {{result.image.begin(), result.image.end()},
          static_cast<double>(all.mutations),
          result.segments_seconds,
          result.segments_seconds + result.bootstrap_seconds + result.pilot_seconds};
}

Sample run_iterations(const TestScene& scene, std::uint64_t seed, std::uint64_t iterations) {
  TestScene seeded = scene;
  seeded.settings.seed = seed;
  const auto renderer = make_renderer(seeded);
  const std::clock_t begin = std::clock();
  const NamedState state = pilot_state(seeded);
  const std::clock_t pilot_end = std::clock();
  auto output = renderer->make_output(state);
  const auto& film = output.film;
  if (!renderer->run({Unit::Kind::iterations, 0, 0, iterations}, {state, {}, {}}, output, {}).ok())
    std::abort();
  const std::clock_t end = std::clock();
  const double to_value = std::ldexp(1.0, -film->scale_log2()) / static_cast<double>(iterations);
  Sample sample;
  for (std::size_t i = 0; i < film->layout().pixel_count() * 3; ++i)
    sample.image.push_back(static_cast<float>(static_cast<double>(film->sums()[i]) * to_value));
  sample.count = static_cast<double>(film->sample_counts().eye_samples);
  sample.rate_seconds = static_cast<double>(end - pilot_end) / CLOCKS_PER_SEC;
  sample.seconds = static_cast<double>(end - begin) / CLOCKS_PER_SEC;
  return sample;
}

// Rounds or iterations that take `seconds`, by the rate of runs of at least an eighth of that.
std::uint64_t rounds_within(double seconds, Row row, const TestScene& scene) {
  std::uint64_t n = 1;
  for (;;) {
    const Sample sample =
        test::has_chains(row.integrator) ? run_chains(row, scene, 1000, n) : run_iterations(scene, 1000, n);
    const double left = seconds - (sample.seconds - sample.rate_seconds);
    const auto within = [&](double part) {
      return static_cast<std::uint64_t>(
          std::clamp(static_cast<double>(n) * part / std::max(sample.rate_seconds, 1e-3), 1.0, 1048576.0));
    };
    if (sample.rate_seconds >= seconds / 8 || n == 1048576) return within(std::max(0.0, left));
    n = std::max(2 * n, std::min(64 * n, within(seconds / 7)));
  }
}

std::vector<Row> all_rows() {
  std::vector<Row> rows;
  for (const std::string name : {"path", "bdpt", "vcm"}) rows.push_back(row_of(name, name, {}));
  rows.push_back(row_of("pssmlt-path", "pssmlt", {{"over", "path"}}));
  rows.push_back(row_of("pssmlt", "pssmlt", {{"over", "bdpt"}}));
  rows.push_back(row_of("mmlt", "mmlt", {}));
  for (const std::string preset : {"mlt", "memlt", "hslt"})
    rows.push_back(row_of(preset, "mlt", {{"preset", preset}}));
  for (const std::string preset : {"erpt", "mept"})
    rows.push_back(row_of(preset, "erpt", {{"preset", preset}}));
  return rows;
}

void print_mutations(const std::string& scene, const Row& row) {
  for (const chains::MutationCounts& m : row.by_mutation) {
    if (m.proposed == 0) continue;
    const auto n = static_cast<double>(m.proposed);
    std::printf("%-12s %-12s %-14s %10llu proposed, accepted %.3f, rays %.1f, failed", scene.c_str(),
                row.name.c_str(), m.name.c_str(), static_cast<unsigned long long>(m.proposed),
                static_cast<double>(m.accepted) / n, static_cast<double>(m.rays) / n);
    for (std::size_t i = 0; i < chains::kMutationFailures.size(); ++i)
      std::printf(" %s %.3f", std::string(chains::kMutationFailures[i]).c_str(),
                  static_cast<double>(m.failed[i]) / n);
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string usage =
      "usage: bench_chains SHARED [--scenes A,B] [--methods A,B] [--seeds N] [--rounds N | --seconds S] "
      "[--set k=v]\n";
  if (argc < 2 || argc % 2 != 0) {
    std::fputs(usage.c_str(), stderr);
    return 2;
  }
  const std::string folder = argv[1];
  std::vector<std::string> scenes = {"veach-bidir", "veach-ajar"}, methods;
  std::uint64_t seeds = 3, rounds = 1, seconds = 0;
  SettingsMap chosen;
  for (int i = 2; i + 1 < argc; i += 2) {
    const std::string option = argv[i], value = argv[i + 1];
    if (option == "--scenes" || option == "--methods") {
      std::vector<std::string>& list = option == "--scenes" ? scenes : methods;
      list.clear();
      std::istringstream in(value);
      for (std::string part; std::getline(in, part, ',');) list.push_back(part);
    } else if (option == "--seeds") {
      seeds = bench::count_argument(option, argv[i + 1], 1, 1e6);
    } else if (option == "--rounds") {
      rounds = bench::count_argument(option, argv[i + 1], 1, 1e6);
    } else if (option == "--seconds") {
      seconds = bench::count_argument(option, argv[i + 1], 1, 1e6);
    } else if (option == "--set" && value.find('=') != std::string::npos) {
      chosen[value.substr(0, value.find('='))] = value.substr(value.find('=') + 1);
    } else {
      std::fputs(usage.c_str(), stderr);
      return 2;
    }
  }
  for (const std::string& asked : scenes) {
    const std::filesystem::path file = asked;
    const std::string name = file.stem().string();
    const auto truth = image::read_image(folder + "/references/" + name + ".exr");
    if (!truth.ok()) {
      std::fprintf(stderr, "%s\n", truth.error().to_string().c_str());
      return 2;
    }
    std::vector<Row> rows;
    for (const Row& row : all_rows())
      if (methods.empty() || std::find(methods.begin(), methods.end(), row.name) != methods.end())
        rows.push_back(row);
    for (std::uint64_t seed = 1; seed <= seeds; ++seed)
      for (Row& row : rows) {
        TestScene scene = file.extension() == ".xml" ? scene_from_source(file, truth->width, truth->height)
                                                     : scene_from_shared(name, truth->width, truth->height);
        const bool chained = test::has_chains(row.integrator);
        const bool taken = chained || row.integrator == "erpt";
        SettingsMap settings = row.settings;
        if (taken)
          for (const auto& [key, value] : chosen) settings[key] = value;
        scene = with_integrator(scene, row.integrator, settings);
        if (row.rounds == 0)
          row.rounds = seconds > 0 ? rounds_within(static_cast<double>(seconds), row, scene)
                       : taken     ? rounds
                                   : 8 * rounds;
        const Sample sample =
            chained ? run_chains(row, scene, seed, row.rounds) : run_iterations(scene, seed, row.rounds);
        row.seconds.push_back(sample.seconds);
        const auto error = stats::compare(sample.image, truth->rgb, truth->width, truth->height);
        row.rates.push_back(sample.count / sample.rate_seconds * 1e-6);
        row.efficiencies.push_back(error.relmse * sample.seconds);
        row.trimmed.push_back(error.relmse_trimmed * sample.seconds);
      }
    std::printf("%-12s %-12s %9s %8s %22s %8s %8s %14s\n", "scene", "", "M/CPU s", "CPU s",
                "relMSE x CPU s (trim)", "accept", "large", "state bytes");
    for (const Row& row : rows)
      std::printf("%-12s %-12s %9.3f %8.2f %12.4f (%7.4f) %8.3f %8.3f %6.0f (%5zu)\n", name.c_str(),
                  row.name.c_str(), median(row.rates), median(row.seconds), median(row.efficiencies),
                  median(row.trimmed), row.acceptance, row.large_acceptance, row.mean_bytes, row.most_bytes);
    for (const Row& row : rows) print_mutations(name, row);
    for (const Row& row : rows)
      for (const Pushed& p : row.pushed)
        std::printf(
            "%-12s %-12s a unit of %llu segments pushes %zu bytes of film and %zu of records: %.0f a "
            "segment\n",
            name.c_str(), row.name.c_str(), static_cast<unsigned long long>(p.segments), p.delta_bytes,
            p.record_bytes,
            static_cast<double>(p.delta_bytes + p.record_bytes) / static_cast<double>(p.segments));
    std::fflush(stdout);
  }
  return 0;
}
