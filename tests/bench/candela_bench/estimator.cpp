#include "tests/bench/candela_bench/estimator.h"

#include <fmt/format.h>
#include <time.h>

#include <chrono>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>

#include "common/base/version.h"
#include "common/bundle/bundle.h"
#include "common/film/film.h"
#include "common/stats/image_error.h"
#include "worker/render/renderer.h"

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_START_INSTRUMENTATION
#define CALLGRIND_STOP_INSTRUMENTATION
#endif

namespace candela::bench {
namespace {

double cpu_now() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double wall_now() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count();
}

// Most memory this process has had in RAM. (ru_maxrss would count the parent's, from before the exec.)
std::uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  std::uint64_t kibibytes = 0;
  for (std::string word; status >> word;)
    if (word == "VmHWM:" && status >> kibibytes) break;
  return kibibytes * 1024;
}

// Jobs of iterations. Films are encoded, decoded and merged as on a farm.
class IterationEstimator final : public Estimator {
 public:
  IterationEstimator(std::unique_ptr<render::Renderer> renderer, const RunSpec& run, NamedState state)
      : renderer_(std::move(renderer)),
        threads_(run.threads),
        film_(renderer_->make_film(state)),
        merged_(film_->layout(), film_->scale_log2()) {}

  std::string unit_name() const override { return "iterations"; }
  void set_setup_seconds(double seconds) { cost_.setup_seconds = seconds; }

  Result<Cost> advance(std::uint64_t units) override {
    // Iteration i is index i / 2 of half i % 2.
    for (std::uint32_t half = 0; half < 2 && units > cost_.units; ++half) {
      const Unit unit{Unit::Kind::iterations, half, (cost_.units + 1 - half) / 2, (units + 1 - half) / 2};
      if (unit.begin == unit.end) continue;
      film_->clear();
      render::RunContext context;
      context.threads = threads_;
      CALLGRIND_START_INSTRUMENTATION;  // nothing but a few moves of registers outside of Valgrind
      const double cpu = cpu_now(), wall = wall_now();
      const Result<void> done = renderer_->run(unit, *film_, context);
      CALLGRIND_STOP_INSTRUMENTATION;
      cost_.wall_seconds += wall_now() - wall;
      cost_.cpu_seconds += cpu_now() - cpu;
      CANDELA_TRY(done);
      cost_.peak_memory_bytes = peak_memory_bytes();
      CANDELA_TRY(deliver(unit));
    }
    cost_.units = std::max(cost_.units, units);
    return cost_;
  }

  Result<Snapshot> snapshot() override {
    Snapshot snapshot;
    snapshot.image = merged_.develop(0);
    snapshot.own_relmse =
        cost_.units < 2 ? std::numeric_limits<double>::quiet_NaN() : stats::estimate_error(merged_).relmse;
    return snapshot;
  }

  Result<std::string> save() override {
    static_assert(std::is_trivially_copyable_v<Cost>);
    std::string saved(reinterpret_cast<const char*>(&cost_), sizeof cost_);
    return saved + merged_.serialise();
  }

  Result<Cost> restore(std::string_view saved) override {
    if (saved.size() < sizeof cost_) return input_error("a kept state that is cut short");
    Cost cost;
    std::memcpy(&cost, saved.data(), sizeof cost);
    CANDELA_ASSIGN(film::MergedFilm merged, film::MergedFilm::parse(saved.substr(sizeof cost)));
    if (!(merged.layout() == merged_.layout()) || merged.scale_log2() != merged_.scale_log2() ||
        merged.iterations() != cost.units)
      return input_error("a kept state that belongs to another run");
    const double setup = cost_.setup_seconds;
    merged_ = std::move(merged);
    cost_ = cost;
    cost_.setup_seconds = setup;
    return cost_;
  }

 private:
  // The film's way to the master.
  Result<void> deliver(const Unit& unit) {
    film::DeltaInfo info;
    info.unit = unit;
    info.job_id = "bench";
    info.build_id = std::string(build_id());
    const std::string bytes = film::encode_delta(*film_, info);
    CANDELA_ASSIGN(const film::Delta delta, film::Delta::decode(bytes, film_->layout()));
    CANDELA_TRY(merged_.merge(delta));
    ++cost_.deltas;
    cost_.delta_bytes += bytes.size();
    const film::Tallies& tallies = delta.tallies();
    cost_.eye_samples += tallies.eye_samples;
    cost_.light_paths += tallies.light_paths;
    cost_.rays += tallies.rays;
    cost_.rejected += std::accumulate(tallies.rejected.begin(), tallies.rejected.end(), std::uint64_t{0});
    return {};
  }

  std::unique_ptr<render::Renderer> renderer_;
  unsigned threads_;
  std::unique_ptr<film::UnitFilm> film_;
  film::MergedFilm merged_;
  Cost cost_;
};

}  // namespace

Result<std::unique_ptr<Estimator>> make_render_estimator(const RunSpec& run) {
  const double start = wall_now();
  const std::filesystem::path file = run.scene_file;
  const bundle::DiskSource files(file.parent_path());
  CANDELA_ASSIGN(auto renderer, render::Renderer::create(files, file.filename(), {}, run.job, run.threads));
  render::RunContext context;
  context.threads = run.threads;
  CANDELA_ASSIGN(const PilotResult pilot, renderer->pilot(context));
  if (pilot.chains)
    return usage_error(fmt::format("'{}' is an integrator of Markov chains", run.job.integrator))
        .with_field("integrator")
        .with_mend("this program measures integrators of iterations");
  auto estimator = std::make_unique<IterationEstimator>(std::move(renderer), run, pilot.state);
  estimator->set_setup_seconds(wall_now() - start);
  return std::unique_ptr<Estimator>(std::move(estimator));
}

}  // namespace candela::bench
