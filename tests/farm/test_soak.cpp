// A farm of real processes that is harmed at random: deaths and sleeps of master and workers, a link that is
// cut or slow, a full disk, jumps of the wall clock, deliveries that come late, twice or broken, storms of
// viewers, workers that join, drain and are paused, urgent jobs, flipped bits and deleted files among
// checkpoints of jobs that run and that have ended, among the master's scene files, and in the workers'
// caches. The farm has certificates of four roles, or one token, by seed. All units are audited, and one of
// its six workers delivers false samples now and then.
//
// Invariants, looked at after each event:
//   equal-or-said    an image that is given out is equal to the last bit to one rendered in peace, or its job
//                    says what is lost; or that the liar had a part in it, once it is found
//   no-failure       no job fails
//   ledger-is-film   no unit is in a ledger twice, none overlaps, and ledger and film have the same indices
//   no-gap           a job that has ended whole has every iteration
//   fenced           who lost a lease, and who delivers again, is never merged
//   alive            no process ends but those that are killed or drained
//   answers          the master answers its page within seconds
//   roles            who lacks a role, or the job, is refused, and told the role
//   liar             nobody is distrusted but the liar
//   progress         whatever is waited for, the farm gets on meanwhile
//   flat             the memory of each process does not grow with the number of events (in long runs)
// and at the end: the liar is set aside by name; whole, every loss can be rendered again.
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
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <thread>

#include "common/wire/token.h"
#include "tests/farm/hand_worker.h"
#include "tests/farm/soak.h"
#include "tests/farm/soak_tools.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr int kShortEvents = 8;
// The short form begins with these.
constexpr const char* kFirstEvents[] = {"submit an urgent job", "ask without the role", "pause a worker"};
constexpr std::uint64_t kEndlessSeconds = 1'000'000'000;

class Soak : public SoakFarm {
 protected:
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
  bool kill_worker() {
    const std::string name = some_worker();
    told_ = name;
    farm_.forget_worker(*workers_[name]);
    start_worker(name);
    return true;
  }
  bool sleep_past_a_lease() {
    told_ = some_worker();
    const Asleep worker(*workers_[told_]);
    std::this_thread::sleep_for(std::chrono::milliseconds(2500));
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
    people_->expect_done(steerer(*job), {"extend", job->id, "--iterations", fmt::format("+{}", more)});
    job->iterations += more;
    return true;
  }
  bool repair() {
    bool any = false;
    for (const SoakJob* job : jobs_that(true)) {
      if (farm_.job(job->id).lost() == 0) continue;
      any = true;
      told_ += job->id + " ";
      people_->expect_done(steerer(*job), {"repair", job->id});
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
  // For all processes of the farm; not for this one, nor of clocks that never jump.
  bool jump_the_clock() {
    static constexpr std::int64_t kSeconds[] = {-86400 * 400, -3600, -5, 0, 5, 3600, 86400 * 400};
    const std::int64_t seconds = kSeconds[pick(std::size(kSeconds))];
    clock_->set(seconds);
    told_ = fmt::format("{} s from the true time", seconds);
    return true;
  }
  // Deliveries by a worker that misbehaves. One that meets the trouble of an earlier event gives up.
  enum class Delivery { late, twice, broken };
  bool deliver(Delivery how) {
    try {
      HandWorker worker(farm_.address(), fmt::format("hand-{}", ++hands_), people_->credentials("worker"));
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
    Process& guest = farm_.start_worker(name, 1, people_->options("worker"));
    await(name + " to join", [&] { return !farm_.worker(name).id().empty(); });
    sleep_a_while();
    people_->expect_done("olga", {"drain", name});
    await(name + " to leave", [&] { return !guest.running(); });
    EXPECT_EQ(guest.wait(0).value_or(-1), 0) << name;
    farm_.forget_worker(guest);
    return true;
  }
  bool cancel_and_extend() {
    SoakJob* job = some_job(false);
    if (job == nullptr) return false;
    told_ = job->id;
    people_->run(steerer(*job), {"cancel", job->id});  // refused if it has ended meanwhile
    await(job->id + " to end", [&] { return ended(farm_.job(job->id)); });
    people_->expect_done(steerer(*job), {"extend", job->id, "--iterations", "+2"});
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
    submit_job(kind, kind.iterations / 25, {"--priority", "9"});
    urgent_.push_back(jobs_.back().id);
    return true;
  }
  bool pause_a_worker() {
    const std::string name = some_worker();
    for (const v1::WorkerStatus& worker : farm_.workers()) {
      if (worker.name() != name || worker.state() == "lost") continue;
      told_ = name;
      people_->expect_done("olga", {"workers", "pause", worker.id()});
      sleep_a_while();
      people_->expect_done("olga", {"workers", "resume", worker.id()});
      return true;
    }
    return false;
  }
  bool prioritize() {
    SoakJob* job = some_job(false);
    if (job == nullptr) return false;
    told_ = job->id;
    people_->expect_done(steerer(*job), {"priority", job->id, std::to_string(pick(5))});
    return true;
  }
  bool trespass() {
    const SoakJob& job = jobs_[pick(jobs_.size())];
    const std::string other = job.submitter == "alice" ? "bob" : "alice";
    told_ = other;
    people_->expect_refused("rita", {"cancel", job.id}, "submit");
    people_->expect_refused("worker", {"fetch", job.id, "-o", (farm_.folder() / "no.exr").string()}, "read");
    people_->expect_refused(other, {"workers", "distrust", farm_.workers().front().id()}, "operate");
    people_->expect_refused(other, {coin() ? "cancel" : "repair", job.id}, "operate");
    try {
      const HandWorker worker(farm_.address(), "stranger", people_->credentials_without_role(other));
      ADD_FAILURE() << other << " works";
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find("role 'worker' is missing"), std::string::npos)
          << error.what();
    }
    return true;
  }
  bool trust_the_liar() {
    if (distrusted().empty()) return false;
    people_->expect_done("olga", {"workers", "trust", kLiar});
    is_found_ = false;
    return true;
  }
  std::vector<Event> events() {
    std::vector<Event> all{
        {"cut a worker's link", [this] { return cut_the_link(); }},
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
        {"ask without the role", [this] { return trespass(); }}};
    // A liar that is set aside lies no more, so it is trusted again soon.
    all.insert(all.end(), 3, {"trust the liar", [this] { return trust_the_liar(); }});
    return all;
  }
  static const Event& named(const std::vector<Event>& all, std::string_view name) {
    return *std::find_if(all.begin(), all.end(), [&](const Event& event) { return event.name == name; });
  }
  void happen(const Event& event, int number) {
    ++happened_[event.name];
    if (!short_form_) std::printf("%4d %s: %s\n", number, event.name, told_.c_str());
    std::fflush(stdout);
    SCOPED_TRACE(fmt::format("seed {}, event {}: {}: {}", seed_, number, event.name, told_));
    sleep_a_while();
    check();
  }

  int hands_ = 0;
  std::map<std::string, int> happened_;
};

// Claim: whatever happens to the farm, every image that it gives out is equal to the last bit to one rendered
// in peace, or it says what is lost or who made it false; no job fails, nobody is distrusted but who lies,
// and in the end the liar is found and all jobs can be made whole.
TEST_F(Soak, EveryImageIsEqualOrEveryLossIsSaid) {
  const std::vector<Event> all = events();
  submit();
  // One loss for certain: a done job, both of whose checkpoints go.
  if (!await("the first job", [&] { return ended(farm_.job(jobs_.front().id)); })) return;
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
  const int count =
      short_form_ ? kShortEvents : static_cast<int>(number_from("CANDELA_SOAK_EVENTS", 1'000'000));
  int done = 1;
  for (; done < count && std::chrono::steady_clock::now() < end && !HasFailure(); ++done) {
    told_.clear();
    // A farm without work is harmed in vain.
    if (jobs_that(false).empty() && submit_another()) told_ += " to render meanwhile;";
    const Event* event = nullptr;
    if (short_form_ && done <= static_cast<int>(std::size(kFirstEvents)))
      event = &named(all, kFirstEvents[done - 1]);
    if (event == nullptr || !event->act()) do
        event = &all[pick(all.size())];
      while (!event->act());
    happen(*event, done);
  }
  if (HasFailure()) return;
  submit_another();  // brings what the master lacks
  check_end();
  if (!short_form_) {
    expect_flat();
    EXPECT_GT(cuts(), 0);
  }
  std::printf("%d events, %s", done, summary().c_str());
  for (const auto& [name, times] : happened_) std::printf(" %d x %s;", times, name.c_str());
  std::printf("\n");
}

}  // namespace
}  // namespace candela::farm
