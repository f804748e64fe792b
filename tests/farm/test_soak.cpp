// A farm of real processes that is harmed at random: deaths and sleeps of master and workers, a link that is
// cut or slow, a full disk, jumps of the wall clock, deliveries that come late, twice or broken, storms of
// viewers, workers that join and drain, flipped bits and deleted files among checkpoints of jobs that run and
// that have ended, among the master's scene files, and in the workers' caches.
//
// Invariants, looked at after each event:
//   equal-or-said    an image that is given out is equal to the last bit to one rendered in peace, or its job
//                    says what is lost
//   no-failure       no job fails
//   ledger-is-film   no unit is in a ledger twice, none overlaps, and ledger and film have the same indices
//   no-gap           a job that has ended whole has every iteration
//   fenced           who lost a lease, and who delivers again, is never merged
//   alive            no process ends but those that are killed or drained
//   answers          the master answers its page within seconds
//   flat             the memory of each process does not grow with the number of events (in long runs)
// and at the end: whole, every loss can be rendered again.
//
// The short form is part of every run of the tests. A long one, of so many events or so many seconds:
//   CANDELA_SOAK_EVENTS=1000 CANDELA_SOAK_SECONDS=7200 build/bin/farm_tests --gtest_filter='Soak.*'
// CANDELA_SOAK_SEED repeats a run's choice of events, though not their timing.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <thread>

#include "common/wire/token.h"
#include "tests/farm/farm.h"
#include "tests/farm/hand_worker.h"
#include "tests/farm/slow_link.h"
#include "tests/integrators.h"
#include "tests/paths.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr int kShortEvents = 8;
constexpr std::uint64_t kEndlessSeconds = 1'000'000'000;
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

// Somebody who looks at the page, and may not wait for the answer.
class Viewer {
 public:
  explicit Viewer(const std::string& address) {
    fd_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
    (void)::connect(fd_, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  ~Viewer() { ::close(fd_); }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;
  void ask(const std::string& path, const std::string& token, bool half) {
    std::string text =
        "GET " + path + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token + "\r\n\r\n";
    if (half) text.resize(text.size() / 2);
    (void)::send(fd_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  bool answered(double seconds) const {
    pollfd polled{fd_, POLLIN, 0};
    char first = 0;
    return ::poll(&polled, 1, static_cast<int>(seconds * 1e3)) == 1 && ::recv(fd_, &first, 1, 0) == 1;
  }

 private:
  int fd_ = -1;
};

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
    const fs::path shift = farm_.folder() / "clock-shift";
    std::ofstream(shift, std::ios::binary) << std::string(sizeof(std::int64_t), '\0');
    farm_.add_environment("LD_PRELOAD", test::program_path("libclock_shift.so"));
    farm_.add_environment("CANDELA_CLOCK_SHIFT", shift.string());
    farm_.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.1", "--lease-time", "2", "--http",
                        "127.0.0.1:0"});
    link_ = std::make_unique<SlowLink>(farm_.address(), LinkOptions{});
    for (const char* name : {"a", "b"}) start_worker(name);
  }
  // Worker b is behind a link that can be cut.
  void start_worker(const std::string& name) {
    workers_[name] = &farm_.start_worker(
        name, 1,
        name == "b" ? std::vector<std::string>{"--master", link_->address()} : std::vector<std::string>{});
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
        if (ended(farm_.job(job->id)) && farm_.job(job->id).lost() == 0)
          farm_.audit(job->id, job->iterations);
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
    start_worker(name);
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
  // Longer than a lease.
  bool cut_the_link() {
    link_->cut(true);
    std::this_thread::sleep_for(std::chrono::milliseconds(2500 + pick(2000)));
    link_->cut(false);
    return true;
  }
  bool slow_the_link() {
    link_->set_delay(0.02 + 0.01 * static_cast<double>(pick(30)));
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    link_->set_delay(0);
    return true;
  }
  bool fill_the_disk() {
    rlimit limit{};
    if (::prlimit(farm_.master().pid(), RLIMIT_FSIZE, nullptr, &limit) != 0) return false;
    limit.rlim_cur = 512;
    if (::prlimit(farm_.master().pid(), RLIMIT_FSIZE, &limit, nullptr) != 0) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(200 + pick(1000)));
    limit.rlim_cur = limit.rlim_max;
    return ::prlimit(farm_.master().pid(), RLIMIT_FSIZE, &limit, nullptr) == 0;
  }
  // Of all processes of the farm; not of this one, nor of clocks that never jump.
  bool jump_the_clock() {
    static constexpr std::int64_t kSeconds[] = {-86400 * 400, -3600, -5, 0, 5, 3600, 86400 * 400};
    const std::int64_t seconds = kSeconds[pick(std::size(kSeconds))];
    std::fstream file(farm_.folder() / "clock-shift", std::ios::in | std::ios::out | std::ios::binary);
    file.write(reinterpret_cast<const char*>(&seconds), sizeof seconds);
    told_ = fmt::format("{} s from the true time", seconds);
    return true;
  }
  // Deliveries by a worker that misbehaves. One that meets the trouble of an earlier event gives up.
  enum class Delivery { late, twice, broken };
  bool deliver(Delivery how) {
    try {
      HandWorker worker(farm_.address(), fmt::format("hand-{}", ++hands_));
      worker.scene_file_for_pilots = scene_path("cornell");
      std::optional<v1::Lease> lease;
      if (!eventually(3, [&] { return (lease = worker.try_acquire()).has_value(); })) return false;
      told_ = lease->job_id();
      const Push push = worker.delta_for(*lease, scene_path("cornell"));
      if (how == Delivery::late) {  // a lease that no heartbeat named lives twice as long
        std::this_thread::sleep_for(std::chrono::milliseconds(4500));
        EXPECT_NE(worker.push(push).verdict(), v1::DELTA_VERDICT_MERGED) << "fenced: the lease had run out";
      }
      if (how == Delivery::broken) {
        const HungPush hung(worker, push);
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
      }
      if (how != Delivery::late) worker.push(push);
      EXPECT_NE(worker.push(push).verdict(), v1::DELTA_VERDICT_MERGED) << "fenced: it was delivered before";
    } catch (const std::runtime_error& error) {
      told_ += fmt::format(" gave up: {}", error.what());
    }
    return true;
  }
  bool join_and_drain() {
    const std::string name = fmt::format("guest-{}", ++hands_);
    Process& guest = farm_.start_worker(name);
    EXPECT_TRUE(eventually(60, [&] { return !farm_.worker(name).id().empty(); })) << name << " does not join";
    sleep_a_while();
    const CommandResult drained = farm_.candela({"drain", name, "--wait"});
    EXPECT_EQ(drained.exit_code, 0) << drained.err;
    EXPECT_EQ(guest.wait(60).value_or(-1), 0) << name << " does not leave";
    farm_.forget_worker(guest);
    return true;
  }
  bool cancel_and_extend() {
    SoakJob* job = some_job(false);
    if (job == nullptr) return false;
    told_ = job->id;
    farm_.candela({"cancel", job->id});  // refused if it has ended meanwhile
    EXPECT_TRUE(eventually(kPatienceSeconds, [&] { return ended(farm_.job(job->id)); })) << job->id;
    const CommandResult done = farm_.candela({"extend", job->id, "--iterations", "+2"});
    EXPECT_EQ(done.exit_code, 0) << done.err;
    job->iterations += 2;
    return true;
  }
  bool storm_of_viewers() {
    const std::string http = farm_.master().wait_for_line("http on ", 10);
    const std::string token = wire::read_token_file(farm_.token_file()).value();
    std::vector<std::unique_ptr<Viewer>> viewers;
    for (int i = 0; i < 40; ++i) {
      static const char* const kPaths[] = {"/",           "/workers", "/metrics", "/api/jobs",
                                           "/api/stream", "/nowhere", "/api/%zz"};
      viewers.push_back(std::make_unique<Viewer>(http));
      if (pick(4) != 0) viewers.back()->ask(kPaths[pick(std::size(kPaths))], token, coin());
      if (coin()) viewers.erase(viewers.begin() + static_cast<std::ptrdiff_t>(pick(viewers.size())));
    }
    return true;
  }
  std::vector<Event> events() {
    return {{"cut a worker's link", [this] { return cut_the_link(); }},
            {"slow a worker's link", [this] { return slow_the_link(); }},
            {"fill the master's disk", [this] { return fill_the_disk(); }},
            {"jump the wall clock", [this] { return jump_the_clock(); }},
            {"deliver after the lease", [this] { return deliver(Delivery::late); }},
            {"deliver twice", [this] { return deliver(Delivery::twice); }},
            {"break off a delivery", [this] { return deliver(Delivery::broken); }},
            {"join and drain", [this] { return join_and_drain(); }},
            {"cancel and extend", [this] { return cancel_and_extend(); }},
            {"storm of viewers", [this] { return storm_of_viewers(); }},
            {"submit", [this] { return submit(); }},
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
    check_processes();
  }
  // alive, answers, flat
  void check_processes() {
    EXPECT_TRUE(farm_.master().running()) << "alive: the master has ended";
    for (const auto& [name, worker] : workers_) EXPECT_TRUE(worker->running()) << "alive: worker " << name;
    Viewer viewer(farm_.master().wait_for_line("http on ", 10));
    viewer.ask("/healthz", "", false);
    EXPECT_TRUE(viewer.answered(60)) << "answers: not even its health";
    resident_mb_["master"].push_back(resident_mb(farm_.master()));
    for (const auto& [name, worker] : workers_) resident_mb_[name].push_back(resident_mb(*worker));
  }
  static double resident_mb(const Process& process) {
    std::ifstream file(fmt::format("/proc/{}/statm", process.pid()));
    double pages = 0;
    file >> pages >> pages;
    return pages * static_cast<double>(::sysconf(_SC_PAGESIZE)) * 1e-6;
  }
  void expect_flat() {
    for (const auto& [name, mb] : resident_mb_) {
      const auto middle = mb.begin() + static_cast<std::ptrdiff_t>(mb.size() / 2);
      const double before = *std::max_element(mb.begin(), middle),
                   after = *std::max_element(middle, mb.end());
      std::printf("%s: at most %.0f MB in the first half, %.0f MB in the second\n", name.c_str(), before,
                  after);
      EXPECT_LE(after, 1.5 * before + 64) << "flat: " << name;
    }
  }

  std::uint64_t seed_ = 0;
  std::mt19937_64 random_;
  Farm farm_;
  std::unique_ptr<SlowLink> link_;
  std::map<std::string, Process*> workers_;
  std::map<std::string, std::vector<double>> resident_mb_;
  int hands_ = 0;
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
  std::this_thread::sleep_for(std::chrono::seconds(1));  // the store hears of the end a little later
  farm_.kill_master();
  for (const fs::path& path : files_in(farm_.folder() / "data" / "jobs" / jobs_.front().id, "film."))
    fs::remove(path);
  farm_.restart_master();
  // A store that had not heard of it lets the job run again, which is no loss.
  const bool stored = ended(farm_.job(jobs_.front().id));
  happen({"remove all checkpoints", {}}, 0);
  EXPECT_TRUE(losses_ > 0 || !stored);
  const auto end = std::chrono::steady_clock::now() +
                   std::chrono::seconds(number_from("CANDELA_SOAK_SECONDS", kEndlessSeconds));
  int done = 1;
  for (; done < count && std::chrono::steady_clock::now() < end && !HasFailure(); ++done) {
    told_.clear();
    // A farm without work is harmed in vain.
    if (jobs_that(false).empty() && jobs_.size() < kMaxJobs && submit()) told_ += " to render meanwhile;";
    const Event* event = nullptr;
    do event = &all[pick(all.size())];
    while (!event->act());
    happen(*event, done);
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
  if (done >= 40) expect_flat();
  std::string summary = fmt::format("{} events, {} images refused for a loss:", done, losses_);
  for (const auto& [name, times] : happened_) summary += fmt::format(" {} x {};", times, name);
  std::printf("%s\n", summary.c_str());
}

}  // namespace
}  // namespace candela::farm
