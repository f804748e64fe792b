// A master under the load of a large farm: real candela-master, real protocol and sockets, simulated workers
// (swarm.h). Measures the master's CPU time and memory, the time a worker waits for a lease, deltas a second
// and each job's share of the farm; checks ledgers and films at the end. docs/lab/scale.md has the results.
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "candela/v1/client.grpc.pb.h"
#include "common/base/files.h"
#include "common/film/film.h"
#include "common/wire/grpc_settings.h"
#include "common/wire/wire.h"
#include "tests/farm/process.h"
#include "tests/paths.h"
#include "tests/scale/process_figures.h"
#include "tests/scale/swarm.h"
#include "tests/token_channel.h"

namespace candela::scale {
namespace {

namespace fs = std::filesystem;

struct Options {
  SwarmOptions swarm;
  std::string scene = test::source_path("deploy/scenes/cornell/scene.xml");
  // Tells of violated invariants of its scheduler, for at most a tenth of the time.
  std::string master_program = "checked-master";
  std::string integrator = "path", size = "1920x1080", csv;
  std::vector<std::string> master_options;
  double seconds = 60, warm_up_seconds = 20;
  double urgent_seconds = 10;  // of the whole farm's work, in a job of higher priority; 0: no such job
  std::size_t recordings = 2;
  std::uint64_t master_files = 1024;
  unsigned record_threads = 2;
  // Bounds that --check allows; 0: none.
  double max_cpu = 0, max_lease_p99_ms = 0, max_share_error = 0, max_resident_mb = 0, min_busy = 0;
};

// Shares of the jobs of equal priority.
constexpr double kShares[] = {1, 2, 3, 4};
constexpr std::uint64_t kEndless = 100'000'000;  // iterations

template <class T>
T unwrap(Result<T> result) {
  if (!result.ok()) throw std::runtime_error(result.error().to_string());
  return std::move(result).value();
}

double quantile_ms(std::vector<float> values, double p) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(p * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return static_cast<double>(*at) * 1e3;
}

class Run {
 public:
  explicit Run(const Options& options) : options_(options) {}

  // The number of checks that failed.
  int operator()() {
    start_master();
    for (const double share : kShares)
      jobs_.push_back(
          submit({"--iterations", std::to_string(kEndless), "--share", fmt::format("{}", share)}));
    const JobSettings settings = unwrap(wire::from_proto(show(jobs_[0]).settings()));
    recording_ =
        std::make_unique<Recording>(options_.scene, settings, options_.record_threads, options_.recordings);
    for (std::size_t i = 0; i < recording_->count(); ++i)
      std::printf("recording %zu: %.2f MB\n", i, static_cast<double>(recording_->film_bytes(i)) * 1e-6);
    SwarmOptions swarm = options_.swarm;
    swarm.address = address_;
    swarm_ = std::make_unique<Swarm>(swarm, *recording_);
    const bool all =
        farm::eventually(60 + swarm.ramp_seconds, [&] { return swarm_->registered() == swarm.workers; });
    expect(all, fmt::format("{} of {} workers registered", swarm_->registered(), swarm.workers));
    pause(options_.warm_up_seconds);
    measure();
    if (options_.urgent_seconds > 0) urgent();
    swarm_.reset();
    for (const std::string& id : jobs_) audit(id);
    std::istringstream log(master_->err());
    for (std::string line; std::getline(log, line);) expect(!line.starts_with(farm::kViolation), line);
    std::printf("%s\n",
                failures_ == 0 ? "all checks hold" : fmt::format("{} checks FAILED", failures_).c_str());
    return failures_;
  }

 private:
  void expect(bool holds, const std::string& what) {
    if (holds) return;
    ++failures_;
    std::printf("FAILED: %s\n", what.c_str());
  }
  static void pause(double seconds) {
    std::this_thread::sleep_for(std::chrono::milliseconds(std::lround(seconds * 1e3)));
  }

  // --- the farm ---
  std::map<std::string, std::string> environment() const {
    return {{"HOME", folder_.path().string()},
            {"PATH", "/usr/bin:/bin"},
            {"CANDELA_CONFIG", (folder_ / "config.toml").string()},
            {"CANDELA_MASTER", address_}};
  }
  void start_master() {
    std::ofstream(folder_ / "config.toml") << "# nothing of the machine's own settings\n";
    std::vector<std::string> arguments = {test::program_path(options_.master_program), "--data",
                                          (folder_ / "data").string(), "--listen", "127.0.0.1:0"};
    arguments.insert(arguments.end(), options_.master_options.begin(), options_.master_options.end());
    // The limit that the master finds, and none for ourselves.
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = std::min<rlim_t>(options_.master_files, limit.rlim_max);
    ::setrlimit(RLIMIT_NOFILE, &limit);
    master_ = std::make_unique<farm::Process>(
        arguments, folder_ / "master",
        std::map<std::string, std::string>{{"HOME", folder_.path().string()},
                                           {"CANDELA_CONFIG", (folder_ / "config.toml").string()}});
    limit.rlim_cur = limit.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &limit);
    address_ = master_->wait_for_line("listening on ", 60);
    if (address_.empty()) throw std::runtime_error("the master does not listen: " + master_->err());
    ::setenv("CANDELA_TOKEN_FILE", (folder_ / "data" / "token").c_str(), 1);
    stub_ = v1::FarmService::NewStub(test::token_channel_by_environment(address_));
  }
  std::string candela(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), test::program_path("candela"));
    farm::Process process(arguments, folder_ / fmt::format("candela-{}", ++serial_), environment());
    const int code = process.wait(300).value_or(-1);
    if (code != 0)
      throw std::runtime_error(fmt::format("candela {}: exit {}: {}", arguments[1], code, process.err()));
    std::string out = process.out();
    while (!out.empty() && out.back() == '\n') out.pop_back();
    return out;
  }
  std::string submit(std::vector<std::string> more) {
    std::vector<std::string> arguments = {"submit", options_.scene, "--integrator", options_.integrator,
                                          "--size", options_.size,  "--timeout",    "120s"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return candela(std::move(arguments));
  }
  v1::JobStatus show(const std::string& id) {
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::JobStatus out;
    grpc::ClientContext context;
    const grpc::Status status = stub_->GetJob(&context, request, &out);
    if (!status.ok()) throw std::runtime_error("GetJob: " + status.error_message());
    return out;
  }

  // Merged, of all jobs. A unit that two workers render counts once.
  std::uint64_t iterations() {
    std::uint64_t sum = 0;
    for (const std::string& id : jobs_) sum += show(id).iterations();
    return sum;
  }

  // --- the window in which four jobs of equal priority share the farm ---
  void measure() {
    swarm_->counts();
    const std::uint64_t iterations_before = iterations();
    const farm::Stopwatch clock;
    const ProcessFigures before = figures_of(master_->pid());
    const ProcessFigures self_before = figures_of(::getpid());
    std::uint64_t most = 0;
    while (clock.seconds() < options_.seconds) {
      pause(std::min(1.0, options_.seconds - clock.seconds() + 1e-3));
      most = std::max(most, figures_of(master_->pid()).resident_bytes);
    }
    const double seconds = clock.seconds();
    const ProcessFigures after = figures_of(master_->pid());
    const ProcessFigures self = figures_of(::getpid());
    const std::uint64_t iterations_after = iterations();
    SwarmCounts c = swarm_->counts();
    double load[1] = {};
    ::getloadavg(load, 1);

    double busy = 0, shares = 0, worst = 0;
    for (const double share : kShares) shares += share;
    for (const auto& [id, s] : c.busy_seconds) busy += s;
    for (std::size_t i = 0; i < jobs_.size(); ++i) {
      const double fraction = c.busy_seconds[jobs_[i]] / std::max(busy, 1e-9), fair = kShares[i] / shares;
      std::printf("job %zu: share %.4f of the farm, %.4f is fair\n", i, fraction, fair);
      worst = std::max(worst, std::abs(fraction / fair - 1));
    }
    const double cpu = (after.cpu_seconds - before.cpu_seconds) / seconds;
    const double p50 = quantile_ms(c.lease_seconds, 0.5), p99 = quantile_ms(c.lease_seconds, 0.99);
    const double merged = static_cast<double>(c.merged) / seconds;
    const double busy_fraction = busy / seconds / static_cast<double>(options_.swarm.workers);
    const auto mb = [](std::uint64_t bytes) { return static_cast<double>(bytes) * 1e-6; };
    const std::vector<std::pair<const char*, std::string>> row = {
        {"workers", std::to_string(options_.swarm.workers)},
        {"size", options_.size},
        {"seconds", fmt::format("{:.1f}", seconds)},
        {"load", fmt::format("{:.2f}", load[0])},
        {"master_cores", fmt::format("{:.3f}", cpu)},
        {"swarm_cores", fmt::format("{:.3f}", (self.cpu_seconds - self_before.cpu_seconds) / seconds)},
        {"deltas_per_s", fmt::format("{:.2f}", merged)},
        {"iterations_per_s",
         fmt::format("{:.2f}", static_cast<double>(iterations_after - iterations_before) / seconds)},
        {"delta_mb_per_s", fmt::format("{:.2f}", mb(c.delta_bytes) / seconds)},
        {"leases_per_s", fmt::format("{:.2f}", static_cast<double>(c.leases) / seconds)},
        {"lease_p50_ms", fmt::format("{:.2f}", p50)},
        {"lease_p99_ms", fmt::format("{:.2f}", p99)},
        {"heartbeat_p99_ms", fmt::format("{:.2f}", quantile_ms(c.heartbeat_seconds, 0.99))},
        {"push_p50_ms", fmt::format("{:.1f}", quantile_ms(c.push_seconds, 0.5))},
        {"push_p99_ms", fmt::format("{:.1f}", quantile_ms(c.push_seconds, 0.99))},
        {"resident_mb", fmt::format("{:.0f}", mb(most))},
        {"peak_mb", fmt::format("{:.0f}", mb(after.peak_resident_bytes))},
        {"threads", std::to_string(after.threads)},
        {"files", std::to_string(after.open_files)},
        {"busy", fmt::format("{:.4f}", busy_fraction)},
        {"share_error", fmt::format("{:.4f}", worst)},
        {"queue_full", std::to_string(c.queue_full)},
        {"failed_calls", std::to_string(c.failed_calls)},
        {"revoked", std::to_string(c.revoked)},
        {"cut", std::to_string(c.cut)}};
    for (const auto& [name, value] : row) std::printf("%-18s %s\n", name, value.c_str());
    if (!options_.csv.empty()) {
      const bool fresh = !fs::exists(options_.csv);
      std::ofstream file(options_.csv, std::ios::app);
      for (std::size_t i = 0; fresh && i < row.size(); ++i) file << (i > 0 ? "," : "") << row[i].first;
      if (fresh) file << "\n";
      for (std::size_t i = 0; i < row.size(); ++i) file << (i > 0 ? "," : "") << row[i].second;
      file << "\n";
    }
    const auto at_most = [&](const char* what, double value, double limit) {
      expect(limit == 0 || value <= limit,
             fmt::format("{} is {:.4g}, at most {:.4g} is allowed", what, value, limit));
    };
    at_most("the master's part of a core", cpu, options_.max_cpu);
    at_most("the 99th percentile of a lease's time in ms", p99, options_.max_lease_p99_ms);
    at_most("the relative error of a share", worst, options_.max_share_error);
    at_most("the master's memory in MB", mb(most), options_.max_resident_mb);
    expect(busy_fraction >= options_.min_busy,
           fmt::format("workers rendered for {:.3f} of the time", busy_fraction));
    expect(c.merged > 0, "no delta was merged");
    expect(c.failed_calls == 0, fmt::format("{} calls failed: {}", c.failed_calls, c.last_failure));
    expect(c.other_verdicts == 0, fmt::format("{} deltas were not merged", c.other_verdicts));
    std::fflush(stdout);
  }

  // --- a job of higher priority gets the farm while it has units, and the others go on after it ---
  void urgent() {
    const double iterations = options_.urgent_seconds * static_cast<double>(options_.swarm.workers) /
                              options_.swarm.seconds_per_iteration;
    swarm_->counts();
    const farm::Stopwatch clock;
    const std::string id = submit({"--iterations", fmt::format("{}", std::max(2.0, std::floor(iterations))),
                                   "--priority", "1", "--share", "1"});
    swarm_->hurry(id);
    double first = 0;
    const bool done = farm::eventually(120 + 20 * options_.urgent_seconds, [&] {
      const v1::JobStatus status = show(id);
      if (first == 0 && status.units_merged() > 0) first = clock.seconds();
      pause(0.05);
      return status.state() == v1::JOB_STATE_DONE;
    });
    const double took = clock.seconds();
    SwarmCounts during = swarm_->counts();
    std::printf(
        "urgent job: %.1f s of the whole farm's work; first delta after %.1f s, done after %.1f s, worker "
        "%.0f s, %llu units of others cut short\n",
        options_.urgent_seconds, first, took, during.busy_seconds[id],
        static_cast<unsigned long long>(during.cut));
    expect(done, "the job of higher priority did not end");
    pause(std::max(1.0, options_.seconds / 8));
    SwarmCounts after = swarm_->counts();
    for (const std::string& job : jobs_)
      expect(after.busy_seconds[job] > 0, "a job had nothing of the farm after the job of higher priority");
    jobs_.push_back(id);
    std::fflush(stdout);
  }

  // The ledger is the film's own account, no index is in it twice, and each sum is that of the recordings.
  void audit(const std::string& id) {
    if (show(id).state() < v1::JOB_STATE_DONE) candela({"cancel", id, "--timeout", "120s"});
    const bool ended = farm::eventually(120, [&] { return show(id).state() >= v1::JOB_STATE_DONE; });
    expect(ended, "a job did not end");
    v1::GetLedgerRequest request;
    request.set_job_id(id);
    v1::GetLedgerResponse ledger;
    grpc::ClientContext context;
    const grpc::Status status = stub_->GetLedger(&context, request, &ledger);
    expect(status.ok(), "GetLedger: " + status.error_message());
    std::array<film::IndexSet, 2> rows, film_ranges;
    std::array<std::vector<film::Int128>, 2> times;  // by half and recording
    for (auto& of_half : times) of_half.resize(recording_->count());
    std::uint64_t units = 0;
    for (const v1::LedgerRow& row : ledger.merged()) {
      if (row.unit().kind() == v1::Unit::KIND_PILOT) continue;
      ++units;
      expect(rows[row.unit().half()].insert(row.unit().begin(), row.unit().end()),
             "an index is merged twice");
      ++times[row.unit().half()][Swarm::recording_of(row.unit_id(), *recording_)];
    }
    for (const auto& range : ledger.film())
      expect(film_ranges[range.half()].insert(range.begin(), range.end()), "the film has an index twice");
    // A cancelled job ends at once; its last checkpoint follows.
    v1::JobStatus job;
    farm::eventually(120, [&] {
      job = show(id);
      return job.checkpoint_iterations() == rows[0].count() + rows[1].count();
    });
    expect(rows == film_ranges, id + ": ledger and film differ");
    expect(units == job.units_merged(), id + ": units of ledger and status differ");
    const auto checkpoint =
        read_file(folder_ / "data" / "jobs" / id / fmt::format("film.{}.ckpt", job.checkpoint_generation()),
                  std::uint64_t{1} << 32);
    if (!checkpoint.ok()) return expect(false, checkpoint.error().to_string());
    const auto film = film::MergedFilm::parse(*checkpoint);
    if (!film.ok()) return expect(false, film.error().to_string());
    for (std::uint32_t half = 0; half < 2; ++half)
      expect(film->merged(half) == rows[half],
             fmt::format("{}: checkpoint {} holds other units than the ledger", id,
                         job.checkpoint_generation()));
    std::vector<film::MergedFilm> one;
    for (std::size_t i = 0; i < recording_->count(); ++i) {
      one.emplace_back(film->layout(), film->scale_log2());
      expect(one.back().merge(recording_->delta(i)).ok(), "a recording is not of the job's film");
    }
    std::uint64_t wrong = 0;
    for (std::uint32_t half = 0; half < 2; ++half)
      for (std::uint32_t y = 0; y < film->layout().height; ++y)
        for (std::uint32_t x = 0; x < film->layout().width; ++x)
          for (int c = 0; c < film::kChannels; ++c) {
            film::Int128 sum = 0;
            for (std::size_t i = 0; i < one.size(); ++i) sum += times[half][i] * one[i].sum(0, 0, x, y, c);
            if (sum == film->sum(half, 0, x, y, c)) continue;
            if (wrong++ < 3) {
              std::printf("half %u, pixel %u, %u, channel %d: %.17g, should be %.17g; of recordings", half, x,
                          y, c, static_cast<double>(film->sum(half, 0, x, y, c)), static_cast<double>(sum));
              for (std::size_t i = 0; i < one.size(); ++i)
                std::printf(" %.17g x %.17g", static_cast<double>(times[half][i]),
                            static_cast<double>(one[i].sum(0, 0, x, y, c)));
              std::printf("\n");
            }
          }
    expect(wrong == 0, fmt::format("{}: {} sums are not those of its {} units", id, wrong, units));
    std::printf("job %s: %lu units, ledger and film agree to the last bit\n", id.c_str(),
                static_cast<unsigned long>(units));
  }

  const Options options_;
  farm::TempDir folder_;
  std::string address_;
  std::unique_ptr<farm::Process> master_;
  std::unique_ptr<v1::FarmService::Stub> stub_;
  std::vector<std::string> jobs_;
  std::unique_ptr<Recording> recording_;
  std::unique_ptr<Swarm> swarm_;
  int serial_ = 0, failures_ = 0;
};

}  // namespace
}  // namespace candela::scale

int main(int argc, char** argv) {
  using namespace candela::scale;
  Options o;
  CLI::App app{"A master under the load of many simulated workers."};
  app.option_defaults()->always_capture_default();
  app.add_option("--workers", o.swarm.workers, "how many");
  app.add_option("--threads", o.swarm.threads_per_worker, "that each worker says it has");
  app.add_option("--seconds-per-iteration", o.swarm.seconds_per_iteration, "of a worker of middle speed");
  app.add_option("--spread", o.swarm.spread, "the fastest worker is so many times as fast as the slowest");
  app.add_option("--ramp", o.swarm.ramp_seconds, "seconds in which the workers register");
  app.add_option("--scene", o.scene, "what the recorded deltas show");
  app.add_option("--integrator", o.integrator, "that renders them");
  app.add_option("--size", o.size, "of the film");
  app.add_option("--recordings", o.recordings, "different deltas");
  app.add_option("--warm-up", o.warm_up_seconds, "seconds before the window that is measured");
  app.add_option("--seconds", o.seconds, "of the window");
  app.add_option("--urgent", o.urgent_seconds,
                 "seconds of the whole farm's work in a job of higher priority");
  app.add_option("--csv", o.csv, "append a row of figures to this file");
  app.add_option("--master-option", o.master_options, "word of the master's command line; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--master-files", o.master_files, "open files that the master may have when it starts");
  app.add_option("--max-cpu", o.max_cpu, "fail if the master takes more of a core");
  app.add_option("--max-lease-p99", o.max_lease_p99_ms, "fail if a lease takes more milliseconds");
  app.add_option("--max-share-error", o.max_share_error,
                 "fail if a job's share is further from the fair one");
  app.add_option("--max-resident", o.max_resident_mb, "fail if the master takes more MB");
  app.add_option("--min-busy", o.min_busy, "fail if workers render for less of the time");
  CLI11_PARSE(app, argc, argv);
  candela::wire::configure_grpc();
  try {
    return Run(o)() == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::printf("FAILED: %s\n", error.what());
    return 1;
  }
}
