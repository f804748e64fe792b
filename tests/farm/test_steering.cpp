// Pausing, resuming, extending, cancelling, interrupting: whatever is asked of a job on its way, its
// iterations make the same image.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

const std::vector<std::string> kShortLeases = {"--unit-time", "0.05",         "--checkpoint-interval",
                                               "0.2",         "--lease-time", "3"};

class Steering : public testing::Test {
 protected:
  void start(std::uint64_t iterations, std::vector<std::string> options = kShortLeases) {
    farm_.start_master(std::move(options));
    worker_ = &farm_.start_worker("one");
    id_ = farm_.submit(iterations);
  }
  // Runs a command that must succeed.
  std::string tell(std::vector<std::string> arguments, bool process = false) {
    const CommandResult result = process ? farm_.candela_process(arguments) : farm_.candela(arguments);
    EXPECT_EQ(result.exit_code, 0) << arguments[0] << ": " << result.err;
    return result.out;
  }
  // Returns when the worker's unit is to be cut, of which the worker does not know yet: it slept meanwhile.
  std::string submit_urgent() {
    const Asleep worker(*worker_);
    const std::string urgent = farm_.submit(4, "cornell", {"--priority", "5"});
    EXPECT_TRUE(eventually(kPatienceSeconds, [&] {
      const std::vector<v1::Event> events = farm_.events(urgent);
      return std::any_of(events.begin(), events.end(), [](const auto& e) { return e.kind() == "cut"; });
    })) << "no unit is to be cut: make the job longer";
    return urgent;
  }
  std::string shown_state() { return nlohmann::json::parse(tell({"show", id_, "--json"})).at("state"); }

  Farm farm_;
  Process* worker_ = nullptr;
  std::string id_;
};

// Claim: a paused job stands still and goes on where it was; `show --json` has what scripts were promised.
TEST_F(Steering, PauseAndResume) {
  constexpr std::uint64_t iterations = kJobIterations;
  start(iterations);
  farm_.wait_for_iterations(id_, 1);
  {
    const Asleep worker(*worker_);
    tell({"pause", id_}, true);
  }
  ASSERT_EQ(shown_state(), "paused");
  // Units that were out when it was paused may still come in.
  ASSERT_TRUE(eventually(20, [&] { return farm_.job(id_).units_leased() == 0; }));
  const std::uint64_t paused_at = farm_.job(id_).iterations();
  ASSERT_LT(paused_at, iterations) << "the job ended before it was paused: make it longer";
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_EQ(farm_.job(id_).iterations(), paused_at) << "a paused job went on";
  farm_.audit(id_, iterations, false);
  tell({"resume", id_}, true);
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  const auto shown = nlohmann::json::parse(tell({"show", id_, "--json"}, true));
  EXPECT_EQ(shown.at("id"), id_);
  EXPECT_EQ(shown.at("state"), "done");
  EXPECT_EQ(shown.at("iterations"), iterations);
  EXPECT_GT(shown.at("units_merged"), 1);
  EXPECT_TRUE(shown.at("error").is_number());
  expect_identical(farm_.fetch(id_), farm_.render(iterations), "after a pause");
  farm_.audit(id_, iterations);
}

// Claim: a pause outlives a restart of the master.
TEST_F(Steering, PauseAndRestart) {
  constexpr std::uint64_t iterations = kJobIterations;
  start(iterations);
  farm_.wait_for_iterations(id_, 1);
  {
    const Asleep worker(*worker_);
    tell({"pause", id_});
  }
  farm_.master().signal(SIGTERM);
  ASSERT_TRUE(farm_.master().wait(60).has_value()) << "the master did not stop on SIGTERM";
  farm_.restart_master();
  EXPECT_EQ(shown_state(), "paused");
  tell({"resume", id_});
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  expect_identical(farm_.fetch(id_), farm_.render(iterations), "after a pause and a restart");
  farm_.audit(id_, iterations);
}

// Claim: 8 iterations and 8 more are the 16 of one job, also after a restart of the master; odd numbers too.
TEST_F(Steering, Extend) {
  start(8);
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  const image::Image eight = farm_.fetch(id_);
  tell({"extend", id_, "--iterations", "+8"});
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  farm_.audit(id_, 16);
  const image::Image sixteen = farm_.fetch(id_);
  expect_identical(sixteen, farm_.render(16), "8 + 8");
  EXPECT_NE(eight.rgb, sixteen.rgb);
  farm_.kill_master();
  farm_.restart_master();
  tell({"extend", id_, "--iterations", "+17"});
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  expect_identical(farm_.fetch(id_), farm_.render(33), "8 + 8 + 17");
  farm_.audit(id_, 33);
}

// Claim: cancelling keeps the partial image; a cancelled job can be extended to the image it would have been.
TEST_F(Steering, CancelKeepsWhatIsThere) {
  constexpr std::uint64_t more = 100, iterations = kJobIterations - more;
  start(iterations);
  farm_.wait_for_iterations(id_, 1);
  {
    const Asleep worker(*worker_);
    tell({"cancel", id_});
  }
  EXPECT_EQ(shown_state(), "cancelled");
  const std::uint64_t kept = farm_.job(id_).iterations();
  ASSERT_LT(kept, iterations) << "the job ended before it was cancelled: make it longer";
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_EQ(farm_.job(id_).iterations(), kept) << "a cancelled job went on";
  farm_.audit(id_, iterations, false);
  const image::Image partial = farm_.fetch(id_);
  tell({"cancel", id_});  // idempotent
  const CommandResult watched = farm_.candela({"watch", id_, "--quiet"});
  EXPECT_EQ(watched.exit_code, 1) << "a cancelled job's result is a failure to those who waited";
  farm_.kill_master();
  farm_.restart_master();
  expect_identical(farm_.fetch(id_), partial, "after a restart");
  tell({"extend", id_, "--iterations", fmt::format("+{}", more)});
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  expect_identical(farm_.fetch(id_), farm_.render(iterations + more), "cancelled, then extended");
  farm_.audit(id_, iterations + more);
}

// Claim: submitting again with the same token makes no second job; with other content it is refused.
TEST_F(Steering, TokenMakesSubmitSafeToRepeat) {
  farm_.start_master_here(kShortLeases);
  const std::string first = farm_.submit(16, "cornell", {"--token", "t-1"});
  EXPECT_EQ(farm_.submit(16, "cornell", {"--token", "t-1"}), first);
  EXPECT_EQ(nlohmann::json::parse(tell({"list", "--json"})).dump().find("\"t-1\""), std::string::npos);
  std::vector<std::string> other = {"submit", scene_path("cornell"), "--token", "t-1"};
  for (const std::string& word : job_options(17)) other.push_back(word);
  const CommandResult result = farm_.candela(other);
  EXPECT_NE(result.exit_code, 0);
  EXPECT_TRUE(result.out.empty()) << result.out;
}

// Claim: a drained worker leaves by itself, with its unit delivered; the job goes on elsewhere.
TEST_F(Steering, Drain) {
  constexpr std::uint64_t iterations = kJobIterations;
  farm_.start_master(kShortLeases);
  Process& leaving = farm_.start_worker("leaving");
  id_ = farm_.submit(iterations);
  farm_.wait_for_iterations(id_, 1);
  tell({"drain", "leaving", "--wait"});  // by its name, as a pod does before it stops
  EXPECT_EQ(leaving.wait(20).value_or(-1), 0);
  farm_.start_worker("staying");
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  expect_identical(farm_.fetch(id_), farm_.render(iterations), "after a drain");
  farm_.audit(id_, iterations);
}

// Claim: an urgent job starts while the only worker is in the middle of a long unit: that one is cut short
// and brings what it has. The picture of the job that stepped aside is the same to the bit.
TEST_F(Steering, UrgentJobsCutUnitsShort) {
  constexpr std::uint64_t iterations = 1501;
  // Half of the job is one unit, and longer than what is worth a cut: a second.
  start(iterations, {"--unit-time", "1000", "--checkpoint-interval", "1", "--lease-time", "3"});
  ASSERT_TRUE(eventually(30, [&] {
    const v1::JobStatus low = farm_.job(id_);
    return !low.plan().empty() && low.units_leased() > 0;
  }));
  const std::string urgent = submit_urgent();
  farm_.wait_for(urgent, v1::JOB_STATE_DONE);
  EXPECT_LT(farm_.job(id_).iterations(), iterations / 2) << "the unit was not cut: make the job longer";
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  expect_identical(farm_.fetch(id_), farm_.render(iterations), "after a cut");
  farm_.audit(id_, iterations);
}

// Claim: so it does while the only worker is in the middle of a long unit of segments of chains.
TEST_F(Steering, UrgentJobsCutSegmentsShort) {
  constexpr std::uint64_t rounds = 1;
  const std::vector<std::string> chains = {"--integrator", "pssmlt",        "--set", "chains=200",
                                           "--set",        "mutations=300", "--set", "bootstrap=2000"};
  farm_.start_master({"--unit-time", "1000", "--checkpoint-interval", "1", "--lease-time", "3"});
  worker_ = &farm_.start_worker("one");
  id_ = farm_.submit(rounds, "cornell", chains);
  ASSERT_TRUE(eventually(60, [&] {
    const v1::JobStatus low = farm_.job(id_);
    return low.has_named_state() && low.units_leased() > 0;
  }));
  const std::string urgent = submit_urgent();
  farm_.wait_for(urgent, v1::JOB_STATE_DONE);
  // One worker gets a quarter of the chains at a time.
  const v1::GetLedgerResponse ledger = farm_.ledger(id_);
  EXPECT_TRUE(std::any_of(ledger.merged().begin(), ledger.merged().end(), [](const v1::LedgerRow& row) {
    return row.unit().kind() == v1::Unit::KIND_SEGMENTS && row.unit().end() - row.unit().begin() < 50;
  })) << "no unit was cut: make the segments longer, or shorter if it was given back whole";
  farm_.wait_for(id_, v1::JOB_STATE_DONE);
  expect_identical(farm_.fetch(id_), farm_.render(rounds, "cornell", chains), "after a cut of segments");
  farm_.audit(id_, rounds);
}

// True if the error of the job below this folder was estimated.
bool has_an_error(const std::filesystem::path& folder) {
  const auto files = files_in(folder, "convergence.txt");
  std::error_code code;
  return !files.empty() && std::filesystem::file_size(files[0], code) > 0 && !code;
}

// Claim: `candela render` interrupted by Ctrl-C saves the image of what is there, which can be made again,
// and goes on with --resume to the image an uninterrupted render makes; so it does after SIGKILL.
TEST_F(Steering, RenderInterruptedAndResumed) {
  constexpr std::uint64_t iterations = 601;
  const std::string out = (farm_.folder() / "r.exr").string();
  std::vector<std::string> command = {"render", scene_path("cornell"), "-o", out, "--threads", "1"};
  for (const std::string& word : job_options(iterations)) command.push_back(word);
  for (const int number : {SIGINT, SIGKILL}) {
    const std::uint64_t before = newest_checkpoint(out + ".candela");
    const auto process = farm_.start_candela(command, "render");
    // Some work must be behind it: what the image of an interrupted render needs for its error, and what a
    // killed one had on disk.
    ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
      return !process->running() || (number == SIGINT ? has_an_error(out + ".candela")
                                                      : newest_checkpoint(out + ".candela") > before);
    }));
    ASSERT_TRUE(process->running()) << "the render ended too soon (make it longer) or failed: "
                                    << process->err();
    process->signal(number);
    EXPECT_EQ(process->wait(60).value_or(-1), 128 + number) << process->err();
    if (number == SIGINT) {
      const auto partial = image::read_image(out);
      ASSERT_TRUE(partial.ok()) << partial.error().to_string();
      EXPECT_EQ(partial.value().width, kWidth);
      EXPECT_NE(process->err().find("--resume"), std::string::npos)
          << "it does not say how to go on: " << process->err();
      // The error in the last line is the image's, not that of an estimate before it.
      const auto figure = [&](const char* name) {
        return fmt::format("{:.1e}", std::stod(partial.value().metadata.at(name)));
      };
      EXPECT_NE(process->err().find(fmt::format("relMSE {} (at most {}),", figure("candela:relmse_estimate"),
                                                figure("candela:relmse_upper"))),
                std::string::npos)
          << process->err();
      const CommandResult again = farm_.candela({"reproduce", out, "--run", "--quiet"});
      EXPECT_EQ(again.exit_code, 0) << again.out << again.err;
    }
    if (command.back() != "--resume") command.push_back("--resume");
  }
  const CommandResult resumed = farm_.candela_process(command);
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  const auto image = image::read_image(out);
  ASSERT_TRUE(image.ok()) << image.error().to_string();
  expect_identical(image.value(), farm_.render(iterations), "interrupted twice");
  EXPECT_FALSE(std::filesystem::exists(out + ".candela")) << "the state of a finished render stays behind";
}

// Claim: the embedded farm's own workers and threads do not matter either.
TEST_F(Steering, RenderWithSeveralWorkers) {
  const image::Image one = farm_.render(101, "studio", {"--threads", "1"});
  expect_identical(one, farm_.render(101, "studio", {"--threads", "3", "--workers", "2"}),
                   "two workers, three threads");
}

}  // namespace
}  // namespace candela::farm
