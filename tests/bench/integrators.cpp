// Time and error of the integrators beside those of other renderers: the figures of docs/benchmarks.md. One
// thread, CPU seconds (user), loading not counted, integrators in turn within each round, medians over
// rounds.
//
//   bench_integrators smallvcm CACHE [options]
//       smallvcm/*.xml: CPU seconds an iteration at 512x512, and relMSE after 32 iterations at 256x256
//       (medians over seeds) against references that are rendered first, where CACHE does not hold them: that
//       of docs/benchmarks.md, without the worst 0.1 % of pixels, and with the peers' fixed floor
//   bench_integrators mitsuba SHARED [options]
//       the scenes of SHARED/scenes against SHARED/references: samples or light paths a CPU second, and
//       relMSE times CPU seconds
//   bench_integrators plans SCENE.xml [options]
//       plan=auto and plan=full in turn: CPU seconds an iteration, and variance (relMSE without a reference,
//       from pairs of seeds) times CPU seconds, at 128x128
//   bench_integrators weights SCENE.xml [options]
//       optimis with weights=balance and weights=optimal in turn: CPU seconds an iteration at 256x256, and
//       what the sums of optimal weights cost beside the same techniques
//   bench_integrators development SCENE.xml [options]
//       optimis at 1920x1080: seconds in which the master reads the image by optimal weights
// Options: --scenes A,B  --integrators A,B  --rounds N  --iterations N  --reference-iterations N  --seeds N
//          --set KEY=VALUE (where an integrator has it)
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/bundle/gather.h"
#include "common/film/delta.h"
#include "common/image/image.h"
#include "common/stages/development.h"
#include "common/stats/image_error.h"
#include "tests/bench/count_argument.h"
#include "tests/epoch_run.h"
#include "tests/paths.h"
#include "tests/statistical/moments.h"
#include "worker/integrators/unit_data.h"
#include "worker/render/renderer.h"

namespace {

using namespace candela;
namespace fs = std::filesystem;

// SmallVCM on the four scenes, of ../shared/peers.md: measured on a machine of the kind that
// docs/benchmarks.md names, on another day. Light tracing there never shows what the camera sees of lamps,
// sky and mirrors.
struct SmallVcmFigures {
  const char* scene;
  const char* integrator;
  double seconds;  // CPU seconds an iteration, 512x512, path length 10
  double relmse;   // after 32 iterations at 256x256
};
constexpr SmallVcmFigures kSmallVcm[] = {
    {"sun", "light", 0.186, 0.105},         {"sun", "path", 0.307, 0.119},
    {"sun", "ppm", 0.316, 0.427},           {"sun", "bpm", 0.773, 0.126},
    {"sun", "bdpt", 0.730, 0.072},          {"sun", "vcm", 1.118, 0.036},
    {"area", "light", 0.342, 0.074},        {"area", "path", 0.345, 0.491},
    {"area", "ppm", 0.470, 0.161},          {"area", "bpm", 1.012, 0.048},
    {"area", "bdpt", 0.963, 0.054},         {"area", "vcm", 1.478, 0.0078},
    {"point", "light", 0.234, 0.164},       {"point", "path", 0.258, 0.112},
    {"point", "ppm", 0.382, 0.542},         {"point", "bpm", 0.869, 0.115},
    {"point", "bdpt", 0.725, 0.017},        {"point", "vcm", 1.235, 0.016},
    {"environment", "light", 0.143, 0.313}, {"environment", "path", 0.326, 0.029},
    {"environment", "ppm", 0.261, 1.41},    {"environment", "bpm", 0.634, 0.595},
    {"environment", "bdpt", 0.552, 0.022},  {"environment", "vcm", 0.793, 0.022},
};

// Mitsuba 0.6, of the same page: million samples (path, bdpt) or light paths (light) a CPU second; relMSE
// times CPU seconds, all pixels and without the worst 0.1 %. 0: not measured.
struct MitsubaFigures {
  const char* scene;
  const char* integrator;
  double rate, efficiency, efficiency_trimmed;
};
constexpr MitsubaFigures kMitsuba[] = {
    {"cornell-box", "path", 0.81, 0.073, 0.070}, {"cornell-box", "bdpt", 0, 0.178, 0.172},
    {"veach-mis", "path", 1.24, 0.060, 0.015},   {"veach-mis", "bdpt", 0, 0.030, 0.026},
    {"veach-bidir", "path", 0.45, 51, 8.9},      {"veach-bidir", "bdpt", 0.081, 0.59, 0.55},
    {"veach-bidir", "light", 0.19, 0, 0},        {"veach-ajar", "path", 0, 9.3, 7.8},
    {"veach-ajar", "bdpt", 0, 8.6, 7.9},
};

struct Options {
  std::string mode;
  fs::path folder;
  std::vector<std::string> scenes, integrators;
  std::uint64_t rounds = 3, iterations = 0, reference_iterations = 1024, seeds = 3;
  SettingsMap chosen;
};

[[noreturn]] void fail(const std::string& message) {
  std::fprintf(stderr, "bench_integrators: %s\n", message.c_str());
  std::exit(2);
}

template <class T>
T value_of(Result<T> result) {
  if (!result.ok()) fail(result.error().to_string());
  return std::move(*result);
}

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n == 0 ? NAN : (values[(n - 1) / 2] + values[n / 2]) / 2;
}

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> parts;
  std::istringstream in(list);
  for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
  return parts;
}

bool contains(const std::vector<std::string>& list, const std::string& name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

// A compiled scene with an integrator, and its film.
class Run {
 public:
  Run(const fs::path& scene, const std::string& integrator, std::uint32_t width, std::uint32_t height,
      std::uint64_t seed, const SettingsMap& chosen)
      : files_(scene.parent_path()), width_(width), height_(height) {
    const auto gathered = value_of(bundle::gather(scene, {}));
    SettingsMap settings;
    const auto known = value_of(render::integrator_settings(integrator));
    const auto take = [&](const std::string& key, const std::string& value) {
      for (const render::SettingDoc& doc : known)
        if (doc.name == key) settings[key] = value;
    };
    for (const auto& element : gathered.description.scene->children_of("integrator"))
      for (const auto& p : element->properties)
        if (p.type == description::PropertyType::integer)
          take(p.name, std::to_string(std::get<std::int64_t>(p.value)));
    for (const auto& [key, value] : chosen) take(key, value);
    JobSettings job;
    job.integrator = integrator;
    job.width = width;
    job.height = height;
    job.seed = seed;
    job.integrator_settings = value_of(render::complete_integrator_settings(integrator, {}, settings));
    renderer_ = value_of(render::Renderer::create(files_, scene.filename(), {}, job, 1));
    const PilotResult pilot = value_of(renderer_->pilot({}));
    output_ = renderer_->make_output(pilot.state);
    work_ = pilot.work;
    epochs_.emplace(*renderer_, pilot);
  }

  // Runs iterations [begin, end) of a job, those of each half as a unit, or as one in each epoch, and returns
  // their CPU seconds.
  double run(std::uint64_t begin, std::uint64_t end) {
    sums_.assign(std::size_t{width_} * height_ * 3, 0.0);
    sample_counts_ = {};
    double seconds = 0;
    for (const Unit& unit : epochs_->units(begin, end)) {
      output_.clear();
      const render::UnitInput input = value_of(epochs_->input(unit));
      const double start = cpu_seconds();
      const auto done = renderer_->run(unit, input, output_, {});
      seconds += cpu_seconds() - start;
      if (!done.ok()) fail(done.error().to_string());
      if (const auto added = epochs_->add(unit, output_); !added.ok()) fail(added.error().to_string());
      const double to_value = std::ldexp(1.0, -output_.film->scale_log2()) / static_cast<double>(end - begin);
      for (std::size_t i = 0; i < sums_.size(); ++i)
        sums_[i] += static_cast<double>(output_.film->sums()[i]) * to_value;
      sample_counts_.add(output_.sample_counts());
    }
    return seconds;
  }

  // Runs so many iterations of each half of a job without epochs, merges them as a master does, and returns
  // seconds of reading the image by its development: all processors, and CPU seconds of them all.
  std::pair<double, double> develop(std::uint64_t iterations) {
    if (!work_.development || work_.epochs) fail("the job is read by no development, or by that of epochs");
    std::array<std::vector<film::MergedAccumulator>, 2> sums;
    for (std::uint32_t half = 0; half < 2; ++half) {
      const Unit unit{Unit::Kind::iterations, half, 0, iterations};
      output_.clear();
      if (const auto done = renderer_->run(unit, value_of(epochs_->input(unit)), output_, {}); !done.ok())
        fail(done.error().to_string());
      const std::string bytes = integrators::encode_delta({unit, {}, 0, "bench", "bench"}, output_);
      const film::Delta delta =
          value_of(film::Delta::decode(bytes, {{width_, height_, 1}, work_.accumulators}));
      for (const film::AccumulatorSpec& spec : work_.accumulators)
        sums[half].emplace_back(width_, height_, spec);
      for (std::size_t i = 0; i < delta.accumulators().size(); ++i)
        sums[half][i].merge(delta.accumulators()[i].sums);
    }
    const auto find = [&](std::string_view name, std::uint32_t half) -> const film::MergedAccumulator* {
      for (const film::MergedAccumulator& a : sums[half])
        if (a.spec().name == name) return &a;
      return nullptr;
    };
    const auto start = std::chrono::steady_clock::now();
    const double cpu_start = cpu_seconds();
    value_of(correct({*work_.development, {}, width_, height_, find}));
    return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
            cpu_seconds() - cpu_start};
  }

  std::vector<float> image() const { return {sums_.begin(), sums_.end()}; }
  film::SampleCounts sample_counts() const { return sample_counts_; }

 private:
  bundle::DiskSource files_;
  std::uint32_t width_, height_;
  std::vector<double> sums_;  // means of what the last run added, row by row
  film::SampleCounts sample_counts_;
  std::unique_ptr<render::Renderer> renderer_;
  render::UnitOutput output_;
  WorkPlan work_;
  std::optional<test::EpochRun> epochs_;
};

std::vector<std::string> chosen_integrators(const Options& options, std::initializer_list<const char*> all) {
  std::vector<std::string> names;
  const std::vector<std::string> known = render::integrator_names();
  for (const char* name : all)
    if (contains(known, name) && (options.integrators.empty() || contains(options.integrators, name)))
      names.emplace_back(name);
  return names;
}

// --- SmallVCM ---

constexpr std::uint32_t kReferenceSize = 256;

// The mean of two halves of `iterations` each, and its relMSE estimated from their difference. What is not in
// the cache is rendered. Two numbers and the floats of both halves make a file.
struct Reference {
  std::vector<float> image;
  double relmse = 0;
};

std::vector<float> reference_half(const fs::path& file, const fs::path& scene, const std::string& integrator,
                                  std::uint64_t iterations, std::uint64_t seed, const SettingsMap& chosen) {
  std::vector<float> image(std::size_t{kReferenceSize} * kReferenceSize * 3);
  const auto bytes = static_cast<std::streamsize>(image.size() * sizeof(float));
  std::ifstream in(file, std::ios::binary);
  if (in.read(reinterpret_cast<char*>(image.data()), bytes) && in.peek() == EOF) return image;
  std::fprintf(stderr, "rendering %s\n", file.c_str());
  Run run(scene, integrator, kReferenceSize, kReferenceSize, seed, chosen);
  run.run(0, iterations);
  image = run.image();
  const fs::path unfinished = file.string() + ".part";
  std::ofstream(unfinished, std::ios::binary).write(reinterpret_cast<const char*>(image.data()), bytes);
  fs::rename(unfinished, file);
  return image;
}

// Integrator of the reference.
std::string reference_integrator(const std::string& scene) {
  // Light from points and suns that reaches the eye over glass, matt, glass is found by merging alone.
  const std::string integrator = scene == "point" || scene == "sun" ? "vcm" : "bdpt";
  return contains(render::integrator_names(), integrator) ? integrator : "path";
}

Reference reference(const Options& options, const fs::path& scene, const std::string& integrator,
                    const SettingsMap& chosen) {
  const std::string name = scene.stem();
  const std::uint64_t each = options.reference_iterations / 2;
  std::vector<float> halves[2];
  for (std::uint64_t i = 0; i < 2; ++i)
    halves[i] = reference_half(
        options.folder / (name + '-' + integrator + '-' + std::to_string(each) + '-' + std::to_string(i)),
        scene, integrator, each, 1001 + i, chosen);
  Reference result;
  result.image.resize(halves[0].size());
  for (std::size_t i = 0; i < result.image.size(); ++i) result.image[i] = (halves[0][i] + halves[1][i]) / 2;
  // Var((A + B) / 2) = E (A - B)^2 / 4, and A - mean is (A - B) / 2.
  result.relmse = stats::compare(halves[0], result.image, kReferenceSize, kReferenceSize).relmse;
  std::printf("reference %s: %s, 2 x %llu iterations, its own relMSE about %.2e\n", name.c_str(),
              integrator.c_str(), static_cast<unsigned long long>(each), result.relmse);
  return result;
}

// mean((a-b)^2 / (b^2 + 0.01)): the relMSE the peers' figures agree with, whose floor does not follow the
// image's mean. Where an image is dark (the boxes' mean is 0.1 to 0.3) it is far below stats::compare's.
double relmse_fixed_floor(const std::vector<float>& image, const std::vector<float>& truth) {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double b = static_cast<double>(truth[i]), difference = static_cast<double>(image[i]) - b;
    sum += difference * difference / (b * b + 0.01);
  }
  return sum / static_cast<double>(image.size());
}

int smallvcm(const Options& options) {
  fs::create_directories(options.folder);
  // As there: radius 0.3 % of the scene's, alpha 0.75, roulette from the first vertex on is left to the
  // default.
  SettingsMap chosen = {{"radius", "0.003"}, {"alpha", "0.75"}};
  for (const auto& [key, value] : options.chosen) chosen[key] = value;
  const std::uint64_t per_round = options.iterations == 0 ? 2 : options.iterations;
  for (const std::string name : {"sun", "area", "point", "environment"}) {
    if (!options.scenes.empty() && !contains(options.scenes, name)) continue;
    const fs::path scene = test::source_path("tests/bench/smallvcm") / (name + ".xml");
    const Reference whole = reference(options, scene, reference_integrator(name), chosen);
    struct Row {
      std::string integrator;
      std::unique_ptr<Run> run;
      std::vector<double> seconds;
      double relmse = 0, relmse_trimmed = 0, relmse_fixed = 0;
    };
    std::vector<Row> rows;
    for (const std::string& integrator :
         chosen_integrators(options, {"light", "path", "ppm", "bpm", "bdpt", "vcm"})) {
      Row row{integrator, nullptr, {}};
      // Mirrors and glass that the camera sees are missing from light tracing: its noise is measured against
      // a long run of its own.
      std::optional<Reference> own;
      if (integrator == "light") own = reference(options, scene, integrator, chosen);
      const Reference& truth = own ? *own : whole;
      std::vector<double> relmse, trimmed, fixed;
      for (std::uint64_t seed = 1; seed <= options.seeds; ++seed) {
        Run small(scene, integrator, kReferenceSize, kReferenceSize, seed, chosen);
        small.run(0, 32);
        const std::vector<float> image = small.image();
        const auto error = stats::compare(image, truth.image, kReferenceSize, kReferenceSize);
        relmse.push_back(error.relmse);
        trimmed.push_back(error.relmse_trimmed);
        fixed.push_back(relmse_fixed_floor(image, truth.image));
      }
      row.relmse = median(relmse);
      row.relmse_trimmed = median(trimmed);
      row.relmse_fixed = median(fixed);
      row.run = std::make_unique<Run>(scene, integrator, 512, 512, 1, chosen);
      rows.push_back(std::move(row));
    }
    for (std::uint64_t round = 0; round < options.rounds; ++round)
      for (Row& row : rows)
        row.seconds.push_back(row.run->run(round * per_round, (round + 1) * per_round) /
                              static_cast<double>(per_round));
    std::printf("%-12s %-6s %9s %9s %7s %10s %9s %9s %9s %7s\n", "scene", "", "CPU s/it", "SmallVCM", "speed",
                "relMSE@32", "trimmed", "fixed", "SmallVCM", "ours/th");
    for (const Row& row : rows) {
      double peer_seconds = NAN, peer_relmse = NAN;
      for (const SmallVcmFigures& figures : kSmallVcm)
        if (name == figures.scene && row.integrator == figures.integrator) {
          peer_seconds = figures.seconds;
          peer_relmse = figures.relmse;
        }
      const double seconds = median(row.seconds);
      std::printf("%-12s %-6s %9.3f %9.3f %7.2f %10.4f %9.4f %9.4f %9.4f %7.2f\n", name.c_str(),
                  row.integrator.c_str(), seconds, peer_seconds, peer_seconds / seconds, row.relmse,
                  row.relmse_trimmed, row.relmse_fixed, peer_relmse, row.relmse_fixed / peer_relmse);
    }
    std::fflush(stdout);
  }
  return 0;
}

// --- Mitsuba ---

int mitsuba(const Options& options) {
  const std::uint64_t iterations = options.iterations == 0 ? 16 : options.iterations;
  std::printf("%-12s %-6s %9s %9s %7s %22s %22s %7s\n", "scene", "", "M/CPU s", "Mitsuba", "ratio",
              "relMSE x CPU s (trim)", "Mitsuba", "ours/th");
  for (const std::string name : {"cornell-box", "veach-mis", "veach-bidir", "veach-ajar"}) {
    if (!options.scenes.empty() && !contains(options.scenes, name)) continue;
    const fs::path scene = options.folder / "scenes" / name / "scene.xml";
    const auto truth = value_of(image::read_image(options.folder / "references" / (name + ".exr")));
    struct Row {
      std::string integrator;
      std::vector<double> rates, efficiencies, trimmed;
    };
    std::vector<Row> rows;
    for (const std::string& integrator : chosen_integrators(options, {"path", "bdpt", "light", "vcm"}))
      rows.push_back({integrator, {}, {}, {}});
    for (std::uint64_t seed = 1; seed <= options.seeds; ++seed)
      for (Row& row : rows) {
        Run run(scene, row.integrator, truth.width, truth.height, seed, options.chosen);
        const double seconds = run.run(0, iterations);
        const auto error = stats::compare(run.image(), truth.rgb, truth.width, truth.height);
        const film::SampleCounts sample_counts = run.sample_counts();
        row.rates.push_back(static_cast<double>(row.integrator == "light" ? sample_counts.light_paths
                                                                          : sample_counts.eye_samples) /
                            seconds * 1e-6);
        row.efficiencies.push_back(error.relmse * seconds);
        row.trimmed.push_back(error.relmse_trimmed * seconds);
      }
    for (const Row& row : rows) {
      const MitsubaFigures* peer = nullptr;
      for (const MitsubaFigures& figures : kMitsuba)
        if (name == figures.scene && row.integrator == figures.integrator) peer = &figures;
      const double rate = median(row.rates), efficiency = median(row.efficiencies);
      const double peer_rate = peer != nullptr && peer->rate > 0 ? peer->rate : NAN;
      const double peer_efficiency = peer != nullptr && peer->efficiency > 0 ? peer->efficiency : NAN;
      std::printf("%-12s %-6s %9.3f %9.3f %7.2f %12.4f (%7.4f) %12.4f (%7.4f) %7.2f\n", name.c_str(),
                  row.integrator.c_str(), rate, peer_rate, rate / peer_rate, efficiency, median(row.trimmed),
                  peer_efficiency, peer != nullptr ? peer->efficiency_trimmed : NAN,
                  efficiency / peer_efficiency);
    }
    std::fflush(stdout);
  }
  return 0;
}

// --- plans ---

// relMSE of one image, from the spread of images of different seeds.
double relative_variance(const std::vector<std::vector<float>>& images) {
  statistical::ImageMoments moments;
  for (const auto& image : images) statistical::add_image(moments, image);
  return statistical::relative_variance(moments) * static_cast<double>(images.size());
}

int plans(const Options& options) {
  const std::uint64_t iterations = options.iterations == 0 ? 16 : options.iterations;
  const std::uint64_t seeds = std::max<std::uint64_t>(2, options.seeds);
  std::printf("%-10s %12s %12s %7s %14s %14s %7s\n", "", "auto s/it", "full s/it", "auto/f", "auto var x s",
              "full var x s", "auto/f");
  for (const std::string& integrator :
       chosen_integrators(options, {"light", "path", "ppm", "bpm", "bdpt", "vcm"})) {
    std::vector<double> seconds[2];
    std::vector<std::vector<float>> images[2];
    for (std::uint64_t seed = 1; seed <= seeds; ++seed)
      for (const int full : {0, 1}) {
        SettingsMap chosen = options.chosen;
        chosen["plan"] = full != 0 ? "full" : "auto";
        Run run(options.folder, integrator, 128, 128, seed, chosen);
        seconds[full].push_back(run.run(0, iterations) / static_cast<double>(iterations));
        images[full].push_back(run.image());
      }
    double time[2], work[2];
    for (const int full : {0, 1}) {
      time[full] = median(seconds[full]);
      work[full] = relative_variance(images[full]) * time[full] * static_cast<double>(iterations);
    }
    std::printf("%-10s %12.5f %12.5f %7.3f %14.5f %14.5f %7.3f\n", integrator.c_str(), time[0], time[1],
                time[0] / time[1], work[0], work[1], work[0] / work[1]);
    std::fflush(stdout);
  }
  return 0;
}

// --- weights ---

int weights(const Options& options) {
  const std::uint64_t iterations = options.iterations == 0 ? 8 : options.iterations;
  std::vector<Run> runs;
  for (const char* name : {"balance", "optimal"}) {
    SettingsMap chosen = options.chosen;
    chosen["weights"] = name;
    runs.emplace_back(options.folder, "optimis", 256, 256, 1, chosen);
  }
  for (Run& run : runs) run.run(0, iterations);  // first use of memory
  std::vector<double> seconds[2], ratios;
  for (std::uint64_t round = 1; round <= options.rounds; ++round) {
    for (std::size_t i = 0; i < 2; ++i)
      seconds[i].push_back(runs[i].run(round * iterations, (round + 1) * iterations) /
                           static_cast<double>(iterations));
    ratios.push_back(seconds[1].back() / seconds[0].back());
  }
  std::sort(ratios.begin(), ratios.end());
  std::printf("balance %.5f s/it, optimal %.5f s/it; optimal over balance: median %.3f, from %.3f to %.3f\n",
              median(seconds[0]), median(seconds[1]), median(ratios), ratios.front(), ratios.back());
  return 0;
}

int development(const Options& options) {
  Run run(options.folder, "optimis", 1920, 1080, 1, options.chosen);
  std::vector<double> wall, cpu;
  for (std::uint64_t round = 0; round < options.rounds; ++round) {
    const auto [seconds, cpu_time] = run.develop(options.iterations == 0 ? 2 : options.iterations);
    wall.push_back(seconds);
    cpu.push_back(cpu_time);
  }
  std::printf("image of 1920x1080 by optimal weights: %.3f s, %.3f CPU s\n", median(wall), median(cpu));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string usage =
      "usage: smallvcm CACHE | mitsuba SHARED | plans SCENE.xml | weights SCENE.xml | development SCENE.xml "
      "[--scenes A,B] "
      "[--integrators A,B] "
      "[--rounds N] "
      "[--iterations N] [--reference-iterations N] [--seeds N] [--set k=v]";
  if (argc < 3 || argc % 2 == 0) fail(usage);
  Options options;
  options.mode = argv[1];
  options.folder = argv[2];
  for (int i = 3; i + 1 < argc; i += 2) {
    const std::string option = argv[i], value = argv[i + 1];
    const auto number = [&] { return bench::count_argument(option, argv[i + 1], 1, 1e9); };
    if (option == "--scenes") {
      options.scenes = split(value);
    } else if (option == "--integrators") {
      options.integrators = split(value);
    } else if (option == "--rounds") {
      options.rounds = number();
    } else if (option == "--iterations") {
      options.iterations = number();
    } else if (option == "--reference-iterations") {
      options.reference_iterations = std::max<std::uint64_t>(2, number());
    } else if (option == "--seeds") {
      options.seeds = number();
    } else if (option == "--set" && value.find('=') != std::string::npos) {
      options.chosen[value.substr(0, value.find('='))] = value.substr(value.find('=') + 1);
    } else {
      fail("unknown option " + option + '\n' + usage);
    }
  }
  if (options.mode == "smallvcm") return smallvcm(options);
  if (options.mode == "mitsuba") return mitsuba(options);
  if (options.mode == "plans") return plans(options);
  if (options.mode == "weights") return weights(options);
  if (options.mode == "development") return development(options);
  fail(usage);
}
