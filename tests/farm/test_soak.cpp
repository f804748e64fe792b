// A farm of real processes that is harmed at random: deaths and sleeps of master and workers, a link that is
// cut or slow, a full disk, jumps of the wall clock, deliveries that come late, twice or broken, storms of
// viewers, workers that join and drain, flipped bits and deleted files among checkpoints of jobs that run and
// that have ended, among the master's scene files, and in the workers' caches. The farm has TLS and people of
// four roles, all units are audited, and one of its six workers delivers false samples now and then.
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
//   roles            who lacks a role, or the job, is refused by its name
//   liar             nobody is distrusted but the liar
//   flat             the memory of each process does not grow with the number of events (in long runs)
// and at the end: whole, every loss can be rendered again.
//
// The short form is part of every run of the tests. A long one, of so many events or so many seconds:
//   CANDELA_SOAK_EVENTS=1000 CANDELA_SOAK_SECONDS=7200 build/bin/farm_tests --gtest_filter='Soak.*'
// CANDELA_SOAK_SEED repeats a run's choice of events, though not their timing.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

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
#include "tests/farm/metrics_page.h"
#include "tests/farm/people.h"
#include "tests/farm/slow_link.h"
#include "tests/farm/soak_tools.h"
#include "tests/paths.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr int kShortEvents = 8;
constexpr std::uint64_t kEndlessSeconds = 1'000'000'000;
constexpr std::size_t kMaxJobs = 8;
// Worker b is behind a link that can be cut. The liar is as the others, until it lies.
constexpr const char* kLiar = "liar";
constexpr const char* kWorkers[] = {"a", "b", "c", "d", "e", kLiar};

struct SoakJob {
  std::string id;
  const Kind* kind = nullptr;
  std::uint64_t iterations = 0;
  std::string submitter = {};
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
    farm_.add_environment("CANDELA_LIES", lies_file().string());
    farm_.start_master(master_options("0.05"));
    link_ = std::make_unique<SlowLink>(farm_.address(), LinkOptions{});
    for (const char* name : kWorkers) start_worker(name);
  }
  std::vector<std::string> master_options(const std::string& unit_time) const {
    return people_.options("master", {"--unit-time", unit_time, "--checkpoint-interval", "0.1",
                                      "--lease-time", "2", "--http", "127.0.0.1:0", "--audit", "100%"});
  }
  void start_worker(const std::string& name) {
    std::vector<std::string> options;
    if (name == "b") options = {"--master", link_->address()};
    farm_.set_programs("checked-master", name == kLiar ? "lying-worker" : "candela-worker");
    workers_[name] = &farm_.start_worker(name, 1, people_.options("worker", std::move(options)));
    farm_.set_programs("checked-master", "candela-worker");
  }
  fs::path lies_file() { return farm_.folder() / "lies"; }
  std::size_t lies() {
    std::ifstream file(lies_file());
    return static_cast<std::size_t>(
        std::count(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>(), '\n'));
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
  void submit(const Kind& kind, std::uint64_t iterations, const std::vector<std::string>& more = {}) {
    const std::string submitter = coin() ? "alice" : "bob";
    farm_.set_client_options(people_.options(submitter));
    std::vector<std::string> options = kind.options;
    options.insert(options.end(), more.begin(), more.end());
    jobs_.push_back({farm_.submit(iterations, "cornell", options), &kind, iterations, submitter});
    told_ += fmt::format(" {} of {} by {}", jobs_.back().id, kind.integrator, submitter);
  }
  bool submit() {
    if (jobs_.size() >= kMaxJobs) return false;
    const Kind& kind = kinds()[pick(kinds().size())];
    submit(kind, kind.iterations);
    return true;
  }
  // The oldest is forgotten for it.
  bool submit_another() {
    if (jobs_.size() >= kMaxJobs) jobs_.erase(jobs_.begin());
    return submit();
  }
  // Somebody who may steer it.
  std::string steerer(const SoakJob& job) { return coin() ? job.submitter : "olga"; }
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
      const CommandResult fetched = people_.run("rita", {"fetch", job->id, "-o", file});
      if (fetched.exit_code == 0) {
        const auto image = image::read_image(file);
        ASSERT_TRUE(image.ok()) << image.error().to_string();
        expect_identical(*image, reference(*job), fmt::format("{} of {}", job->id, job->kind->integrator));
        ++equal_;
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
  // The next one cuts units of another size.
  bool kill_master() {
    static constexpr const char* kUnitTimes[] = {"0.05", "0.5", "4"};
    const char* unit_time = kUnitTimes[pick(std::size(kUnitTimes))];
    told_ = fmt::format("units of {} s", unit_time);
    farm_.kill_master();
    farm_.restart_master(master_options(unit_time));
    return true;
  }
  std::string some_worker() { return kWorkers[pick(std::size(kWorkers))]; }
  bool kill_worker() {
    const std::string name = some_worker();
    told_ = name;
    farm_.forget_worker(*workers_[name]);
    start_worker(name);
    return true;
  }
  bool sleep_past_a_lease() {
    told_ = some_worker();
    Process& worker = *workers_[told_];
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
    return submit_another();
  }
  bool harm_cache() {
    const fs::path cache = farm_.folder() / ("cache-" + some_worker());
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
    people_.expect_done(steerer(*job), {"extend", job->id, "--iterations", fmt::format("+{}", more)});
    job->iterations += more;
    return true;
  }
  bool repair() {
    bool any = false;
    for (const SoakJob* job : jobs_that(true)) {
      if (farm_.job(job->id).lost() == 0) continue;
      any = true;
      told_ += job->id + " ";
      people_.expect_done(steerer(*job), {"repair", job->id});
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
      HandWorker worker(farm_.address(), fmt::format("hand-{}", ++hands_), people_.credentials("worker"));
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
    Process& guest = farm_.start_worker(name, 1, people_.options("worker"));
    EXPECT_TRUE(eventually(60, [&] { return !farm_.worker(name).id().empty(); })) << name << " does not join";
    sleep_a_while();
    people_.expect_done("olga", {"drain", name, "--wait"});
    EXPECT_EQ(guest.wait(60).value_or(-1), 0) << name << " does not leave";
    farm_.forget_worker(guest);
    return true;
  }
  bool cancel_and_extend() {
    SoakJob* job = some_job(false);
    if (job == nullptr) return false;
    told_ = job->id;
    people_.run(steerer(*job), {"cancel", job->id});  // refused if it has ended meanwhile
    EXPECT_TRUE(eventually(kPatienceSeconds, [&] { return ended(farm_.job(job->id)); })) << job->id;
    people_.expect_done(steerer(*job), {"extend", job->id, "--iterations", "+2"});
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
  // --- people ---
  // A small job goes before all others, whose units are cut short for it.
  bool urgent() {
    if (some_job(false) == nullptr) return false;
    if (jobs_.size() >= kMaxJobs) jobs_.erase(jobs_.begin());
    const Kind& kind = kinds().front();
    submit(kind, kind.iterations / 25, {"--priority", "9"});
    const std::string id = jobs_.back().id;
    EXPECT_TRUE(eventually(kPatienceSeconds, [&] { return ended(farm_.job(id)); })) << id;
    int cuts = 0;
    for (const v1::Event& event : farm_.events(id)) cuts += event.kind() == "cut" ? 1 : 0;
    told_ += fmt::format(" cuts {}", cuts);
    cuts_ += cuts;
    return true;
  }
  bool pause_a_worker() {
    const std::string name = some_worker();
    for (const v1::WorkerStatus& worker : farm_.workers()) {
      if (worker.name() != name || worker.state() == "lost") continue;
      told_ = name;
      people_.expect_done("olga", {"workers", "pause", worker.id()});
      sleep_a_while();
      people_.expect_done("olga", {"workers", "resume", worker.id()});
      return true;
    }
    return false;
  }
  bool prioritize() {
    SoakJob* job = some_job(false);
    if (job == nullptr) return false;
    told_ = job->id;
    people_.expect_done(steerer(*job), {"priority", job->id, std::to_string(pick(5))});
    return true;
  }
  bool trespass() {
    const SoakJob& job = jobs_[pick(jobs_.size())];
    const std::string other = job.submitter == "alice" ? "bob" : "alice";
    told_ = other;
    people_.expect_refused("rita", {"cancel", job.id}, "submit");
    people_.expect_refused("worker", {"fetch", job.id, "-o", (farm_.folder() / "no.exr").string()}, "read");
    people_.expect_refused(other, {"workers", "distrust", farm_.workers().front().id()}, "operate");
    people_.expect_refused(other, {coin() ? "cancel" : "repair", job.id}, "operate");
    try {
      const HandWorker worker(farm_.address(), "stranger", people_.credentials(other));
      ADD_FAILURE() << other << " works";
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find("role 'worker' is missing"), std::string::npos)
          << error.what();
    }
    return true;
  }
  std::vector<v1::DistrustedWorker> distrusted() {
    v1::ListWorkersResponse all;
    eventually(30, [&] {
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(10));
      return farm_.stub().ListWorkers(&context, {}, &all).ok();
    });
    return {all.distrusted().begin(), all.distrusted().end()};
  }
  bool trust_the_liar() {
    if (distrusted().empty()) return false;
    people_.expect_done("olga", {"workers", "trust", kLiar});
    is_found_ = false;
    return true;
  }
  void check_liar() {
    const auto found = distrusted();
    for (const v1::DistrustedWorker& one : found)
      EXPECT_TRUE(one.worker().ends_with(std::string("/") + kLiar))
          << "liar: " << one.worker() << ": " << one.reason();
    if (!found.empty() && !std::exchange(is_found_, true)) {
      lies_to_be_found_.push_back(lies() - known_lies_);
      known_lies_ = lies();
      if (verbose_) std::printf("     %s\n", found.front().reason().c_str());
    }
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
            {"repair", [this] { return repair(); }},
            {"submit an urgent job", [this] { return urgent(); }},
            {"pause a worker", [this] { return pause_a_worker(); }},
            {"set a priority", [this] { return prioritize(); }},
            {"ask without the role", [this] { return trespass(); }},
            // A liar that is set aside lies no more: it is trusted again soon.
            {"trust the liar", [this] { return trust_the_liar(); }},
            {"trust the liar", [this] { return trust_the_liar(); }},
            {"trust the liar", [this] { return trust_the_liar(); }}};
  }
  void happen(const Event& event, int number) {
    ++happened_[event.name];
    if (verbose_) std::printf("%4d %s: %s\n", number, event.name, told_.c_str());
    std::fflush(stdout);
    SCOPED_TRACE(fmt::format("seed {}, event {}: {}: {}", seed_, number, event.name, told_));
    sleep_a_while();
    check_images();
    check_processes();
    check_liar();
  }
  // alive, answers, flat
  void check_processes() {
    EXPECT_TRUE(farm_.master().running()) << "alive: the master has ended";
    for (const auto& [name, worker] : workers_) EXPECT_TRUE(worker->running()) << "alive: worker " << name;
    Viewer viewer(farm_.master().wait_for_line("http on ", 10));
    viewer.ask("/healthz", "", false);
    EXPECT_TRUE(viewer.answered(60)) << "answers: not even its health";
    count_audits();
    resident_mb_["master"].push_back(resident_mb(farm_.master()));
    for (const auto& [name, worker] : workers_) resident_mb_[name].push_back(resident_mb(*worker));
  }
  // A master counts from its start.
  void count_audits() {
    const std::string page = http_get(farm_.master().wait_for_line("http on ", 10), "/metrics");
    for (const char* result : {"equal", "disputed", "alone", "rechecked"}) {
      const double now = metric(page, "candela_audits_total", fmt::format("\"{}\"", result));
      Count& count = audits_[result];
      count.sum += now >= count.last ? now - count.last : now;
      count.last = now;
    }
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
  People people_{farm_};
  std::unique_ptr<SlowLink> link_;
  std::map<std::string, Process*> workers_;
  std::map<std::string, std::vector<double>> resident_mb_;
  int hands_ = 0;
  std::vector<SoakJob> jobs_;
  std::map<std::string, image::Image> references_;
  std::string told_;  // of the present event
  std::map<std::string, int> happened_;
  int losses_ = 0, equal_ = 0;  // images that were refused, and that were right
  int cuts_ = 0;                // for urgent jobs
  struct Count {
    double last = 0, sum = 0;
  };
  std::map<std::string, Count> audits_;
  bool is_found_ = false;
  std::size_t known_lies_ = 0;
  std::vector<std::size_t> lies_to_be_found_;
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
    if (jobs_that(false).empty() && submit_another()) told_ += " to render meanwhile;";
    const Event* event = nullptr;
    do event = &all[pick(all.size())];
    while (!event->act());
    happen(*event, done);
  }
  if (HasFailure()) return;
  // Peace: what the master lacks comes with a submission, what is lost is rendered again.
  submit_another();
  for (const SoakJob& job : jobs_) {
    ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return ended(farm_.job(job.id)); }))
        << "seed " << seed_ << ": " << farm_.job(job.id).ShortDebugString();
    people_.expect_done("olga", {"repair", job.id, "--wait", "--quiet"});
    if (HasFailure()) return;
    farm_.set_client_options(people_.options("rita"));
    expect_identical(farm_.fetch(job.id), reference(job), job.id);
    farm_.audit(job.id, job.iterations);
  }
  if (done >= 40) {
    expect_flat();
    EXPECT_FALSE(lies_to_be_found_.empty());
    EXPECT_GT(cuts_, 0);
  }
  std::string summary = fmt::format(
      "{} events, {} images equal, {} refused for a loss; {} cuts for urgent jobs; lies until the "
      "liar was found: {}, {} in all; units audited:",
      done, equal_, losses_, cuts_, fmt::join(lies_to_be_found_, ", "), lies());
  for (const auto& [result, audits] : audits_) summary += fmt::format(" {} {},", audits.sum, result);
  for (const auto& [name, times] : happened_) summary += fmt::format(" {} x {};", times, name);
  std::printf("%s\n", summary.c_str());
}

}  // namespace
}  // namespace candela::farm
