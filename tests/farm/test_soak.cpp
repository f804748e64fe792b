// A farm of real processes that is harmed at random: deaths and sleeps of master and workers, flipped bits
// and deleted files among checkpoints of jobs that run and that have ended, among the master's scene files,
// and in the workers' caches.
//
// The short form is part of every run of the tests. The long one: CANDELA_SOAK_EVENTS=200
// build/bin/farm_tests
// --gtest_filter='Soak.*'. CANDELA_SOAK_SEED repeats a run's choice of events, though not their timing.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <thread>

#include "tests/farm/farm.h"
#include "tests/integrators.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr int kShortEvents = 16;
constexpr std::size_t kMaxJobs = 8;

std::uint64_t number_from(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

struct Kind {
  std::string integrator;
  std::uint64_t iterations;
  std::vector<std::string> options;
};
std::vector<Kind> kinds_of_rows() {
  std::vector<Kind> all;
  for (const test::IntegratorRow& row : test::integrators()) {
    if (row.soak_iterations == 0) continue;
    all.push_back({row.name, row.soak_iterations, {"--integrator", row.name}});
    if (row.chains)
      for (const char* word : {"--set", "chains=64", "--set", "bootstrap=2000"})
        all.back().options.emplace_back(word);
    if (row.merges) all.back().options.insert(all.back().options.end(), {"--set", "plan=full"});
    if (row.epochs)
      for (const auto& [name, value] : row.small)
        all.back().options.insert(all.back().options.end(), {"--set", name + "=" + value});
  }
  return all;
}
const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = kinds_of_rows();
  return all;
}

struct SoakJob {
  std::string id;
  const Kind* kind = nullptr;
  std::uint64_t iterations = 0;
};

class Soak : public testing::Test {
 protected:
  void SetUp() override {
    seed_ = number_from("CANDELA_SOAK_SEED", 1);
    random_.seed(seed_);
    farm_.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.1", "--lease-time", "2"});
    for (const char* name : {"a", "b"}) workers_[name] = &farm_.start_worker(name);
  }

  std::size_t pick(std::size_t n) { return static_cast<std::size_t>(random_() % n); }
  bool coin() { return pick(2) == 0; }
  void sleep_a_while() { std::this_thread::sleep_for(std::chrono::milliseconds(50 + pick(400))); }

  // --- jobs ---
  const image::Image& reference(const SoakJob& job) {
    const std::string key = fmt::format("{} {}", job.kind->integrator, job.iterations);
    const auto it = references_.find(key);
    if (it != references_.end()) return it->second;
    return references_.emplace(key, farm_.render(job.iterations, "cornell", job.kind->options)).first->second;
  }
  bool submit() {
    if (jobs_.size() >= kMaxJobs) return false;
    const Kind& kind = kinds()[pick(kinds().size())];
    jobs_.push_back({farm_.submit(kind.iterations, "cornell", kind.options), &kind, kind.iterations});
    told_ += fmt::format(" {} of {}", jobs_.back().id, kind.integrator);
    return true;
  }
  static bool ended(const v1::JobStatus& s) { return s.state() >= v1::JOB_STATE_DONE; }
  std::vector<SoakJob*> jobs_that(bool have_ended) {
    std::vector<SoakJob*> out;
    for (SoakJob& job : jobs_)
      if (ended(farm_.job(job.id)) == have_ended) out.push_back(&job);
    return out;
  }
  SoakJob* some_job(bool that_ended) {
    const auto found = jobs_that(that_ended);
    return found.empty() ? nullptr : found[pick(found.size())];
  }
  // Each image that is given out is the whole one, or what is missing is said.
  void check_images() {
    for (SoakJob* job : jobs_that(true)) {
      const v1::JobStatus status = farm_.job(job->id);
      ASSERT_EQ(status.state(), v1::JOB_STATE_DONE) << job->id << ": " << status.message();
      const std::string file = (farm_.folder() / "soak.exr").string();
      const CommandResult fetched = farm_.candela({"fetch", job->id, "-o", file});
      if (fetched.exit_code == 0) {
        const auto image = image::read_image(file);
        ASSERT_TRUE(image.ok()) << image.error().to_string();
        expect_identical(*image, reference(*job), fmt::format("{} of {}", job->id, job->kind->integrator));
      } else {
        EXPECT_EQ(fetched.exit_code, 1) << fetched.err;
        EXPECT_NE(fetched.err.find("candela repair " + job->id), std::string::npos) << fetched.err;
        EXPECT_GT(farm_.job(job->id).lost(), 0U);
        ++losses_;
      }
      if (HasFailure()) return;
    }
  }

  // --- harm ---
  static bool flip_bit(const fs::path& path, std::uint64_t at) {
    std::error_code code;
    const std::uint64_t size = fs::file_size(path, code);
    if (code || size == 0) return false;
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(static_cast<std::streamoff>(at % size));
    const int byte = file.get();
    file.seekp(static_cast<std::streamoff>(at % size));
    file.put(static_cast<char>(byte ^ (1 << (at % 8))));
    return file.good();
  }
  bool harm(const fs::path& path) {
    std::error_code code;
    const bool flip = pick(3) != 0;
    if (flip)
      flip_bit(path, random_());
    else
      fs::remove(path, code);
    told_ += fmt::format(" {} {}", flip ? "flip" : "remove", path.filename().string());
    return true;
  }
  // Regular files below a folder, in order; checkpoints only where `prefix` is given.
  static std::vector<fs::path> files_in(const fs::path& folder, const std::string& prefix = "") {
    std::vector<fs::path> out;
    std::error_code code;
    for (auto it = fs::recursive_directory_iterator(folder, code);
         !code && it != fs::recursive_directory_iterator(); it.increment(code))
      if (it->is_regular_file(code) && it->path().filename().string().starts_with(prefix))
        out.push_back(it->path());
    std::sort(out.begin(), out.end());
    return out;
  }
  bool harm_job(SoakJob* job, bool while_the_master_is_down) {
    if (job == nullptr) return false;
    const auto files = files_in(farm_.folder() / "data" / "jobs" / job->id);
    if (files.empty()) return false;
    told_ = job->id;
    if (while_the_master_is_down) farm_.kill_master();
    if (pick(3) == 0)
      for (const fs::path& path : files) harm(path);
    else
      harm(files[pick(files.size())]);
    if (while_the_master_is_down) farm_.restart_master();
    return true;
  }

  struct Event {
    const char* name;
    std::function<bool()> act;  // false: there was nothing to do it to
  };
  bool kill_master() {
    farm_.kill_master();
    farm_.restart_master();
    return true;
  }
  bool kill_worker() {
    const std::string name = coin() ? "a" : "b";
    told_ = name;
    farm_.forget_worker(*workers_[name]);
    workers_[name] = &farm_.start_worker(name);
    return true;
  }
  bool sleep_past_a_lease() {
    Process& worker = *workers_[coin() ? "a" : "b"];
    worker.signal(SIGSTOP);
    std::this_thread::sleep_for(std::chrono::milliseconds(2500));
    worker.signal(SIGCONT);
    return true;
  }
  // The next submission of the scene brings what the master then lacks.
  bool harm_scene() {
    const auto files = files_in(farm_.folder() / "data" / "blobs");
    if (files.empty()) return false;
    harm(files[pick(files.size())]);
    sleep_a_while();
    if (jobs_.size() >= kMaxJobs) jobs_.erase(jobs_.begin());
    return submit();
  }
  bool harm_cache() {
    const fs::path cache = farm_.folder() / (coin() ? "cache-a" : "cache-b");
    const auto files = files_in(cache);
    if (files.empty()) return false;
    if (pick(3) != 0) return harm(files[pick(files.size())]);
    std::error_code code;
    fs::remove_all(cache, code);
    told_ = "remove " + cache.filename().string();
    return true;
  }
  bool extend() {
    SoakJob* job = some_job(true);
    if (job == nullptr) return false;
    told_ = job->id;
    const std::uint64_t more = std::max<std::uint64_t>(job->kind->iterations / 4, 2);
    const CommandResult done = farm_.candela({"extend", job->id, "--iterations", fmt::format("+{}", more)});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    job->iterations += more;
    return true;
  }
  bool repair() {
    bool any = false;
    for (const SoakJob* job : jobs_that(true)) {
      if (farm_.job(job->id).lost() == 0) continue;
      any = true;
      told_ += job->id + " ";
      const CommandResult done = farm_.candela({"repair", job->id});
      EXPECT_EQ(done.exit_code, 0) << done.err;
    }
    return any;
  }
  std::vector<Event> events() {
    return {{"submit", [this] { return submit(); }},
            {"kill the master", [this] { return kill_master(); }},
            {"kill a worker", [this] { return kill_worker(); }},
            {"let a worker sleep past its lease", [this] { return sleep_past_a_lease(); }},
            {"harm a running job", [this] { return harm_job(some_job(false), false); }},
            {"harm a running job, master down", [this] { return harm_job(some_job(false), true); }},
            {"harm an ended job", [this] { return harm_job(some_job(true), false); }},
            {"harm an ended job, master down", [this] { return harm_job(some_job(true), true); }},
            {"harm a scene file of the master", [this] { return harm_scene(); }},
            {"harm a worker's cache", [this] { return harm_cache(); }},
            {"extend", [this] { return extend(); }},
            {"repair", [this] { return repair(); }}};
  }
  void happen(const Event& event, int number) {
    ++happened_[event.name];
    if (verbose_) std::printf("%4d %s: %s\n", number, event.name, told_.c_str());
    SCOPED_TRACE(fmt::format("seed {}, event {}: {}: {}", seed_, number, event.name, told_));
    sleep_a_while();
    check_images();
  }

  std::uint64_t seed_ = 0;
  std::mt19937_64 random_;
  Farm farm_;
  std::map<std::string, Process*> workers_;
  std::vector<SoakJob> jobs_;
  std::map<std::string, image::Image> references_;
  std::string told_;  // of the present event
  std::map<std::string, int> happened_;
  int losses_ = 0;  // images that were refused
  bool verbose_ = false;
};

// Claim: whatever happens to the farm, every image that it gives out is equal to the last bit to one rendered
// in peace, or it says what is lost; no job fails, and in the end all jobs can be made whole.
TEST_F(Soak, EveryImageIsEqualOrEveryLossIsSaid) {
  const int count = static_cast<int>(number_from("CANDELA_SOAK_EVENTS", kShortEvents));
  verbose_ = count != kShortEvents;
  const std::vector<Event> all = events();
  submit();
  // One loss for certain: a done job, both of whose checkpoints go.
  ASSERT_EQ(farm_.wait_for(jobs_.front().id, v1::JOB_STATE_DONE).state(), v1::JOB_STATE_DONE);
  farm_.kill_master();
  for (const fs::path& path : files_in(farm_.folder() / "data" / "jobs" / jobs_.front().id, "film."))
    fs::remove(path);
  farm_.restart_master();
  happen({"remove all checkpoints", {}}, 0);
  EXPECT_GT(losses_, 0);
  for (int i = 1; i < count && !HasFailure(); ++i) {
    told_.clear();
    // A farm without work is harmed in vain.
    if (jobs_that(false).empty() && jobs_.size() < kMaxJobs && submit()) told_ += " to render meanwhile;";
    const Event* event = nullptr;
    do event = &all[pick(all.size())];
    while (!event->act());
    happen(*event, i);
  }
  if (HasFailure()) return;
  // Peace: what the master lacks comes with a submission, what is lost is rendered again.
  if (jobs_.size() >= kMaxJobs) jobs_.erase(jobs_.begin());
  submit();
  for (const SoakJob& job : jobs_) {
    ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return ended(farm_.job(job.id)); }))
        << "seed " << seed_ << ": " << farm_.job(job.id).ShortDebugString();
    const CommandResult repaired = farm_.candela({"repair", job.id, "--wait", "--quiet"});
    ASSERT_EQ(repaired.exit_code, 0) << repaired.err;
    expect_identical(farm_.fetch(job.id), reference(job), job.id);
    farm_.audit(job.id, job.iterations);
  }
  std::string summary = fmt::format("{} events, {} images refused for a loss:", count, losses_);
  for (const auto& [name, times] : happened_) summary += fmt::format(" {} x {};", times, name);
  std::printf("%s\n", summary.c_str());
}

}  // namespace
}  // namespace candela::farm
