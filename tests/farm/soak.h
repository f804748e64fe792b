// The farm of the soak: six workers, of which one lies, people of four roles, jobs, and what must hold for
// them whatever happens (test_soak.cpp).
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/farm/farm.h"
#include "tests/farm/people.h"
#include "tests/farm/shifted_clock.h"
#include "tests/farm/slow_link.h"

namespace candela::farm {

// The scene and settings of the jobs.
struct Kind {
  std::string integrator;
  std::uint64_t iterations = 0;
  std::vector<std::string> options;
};

struct SoakJob {
  std::string id;
  const Kind* kind = nullptr;
  std::uint64_t iterations = 0;
  std::string submitter;
};

class SoakFarm : public testing::Test {
 protected:
  static constexpr std::size_t kMaxJobs = 8;
  // Worker b is behind a link that can be cut. The liar is as the others, until it lies.
  static constexpr const char* kLiar = "liar";
  static constexpr const char* kWorkers[] = {"a", "b", "c", "d", "e", kLiar};

  SoakFarm();
  void SetUp() override;
  std::vector<std::string> master_options(const std::string& unit_time) const;
  void start_worker(const std::string& name);
  std::string some_worker() { return kWorkers[pick(std::size(kWorkers))]; }

  std::size_t pick(std::size_t n) { return static_cast<std::size_t>(random_() % n); }
  bool coin() { return pick(2) == 0; }
  void sleep_a_while();
  // Waits as long as the farm gets on: it renders, or jobs and workers change. False, and a failure, if
  // nothing happens for a time that is long on any machine.
  bool await(const std::string& what, const std::function<bool()>& condition);

  // --- jobs ---
  void submit_job(const Kind& kind, std::uint64_t iterations, const std::vector<std::string>& more = {});
  bool submit();          // unless there are many
  bool submit_another();  // the oldest is forgotten for it
  const std::vector<Kind>& kinds() const { return kinds_; }
  std::string steerer(const SoakJob& job) { return coin() ? job.submitter : "olga"; }
  static bool ended(const v1::JobStatus& s) { return s.state() >= v1::JOB_STATE_DONE; }
  std::vector<SoakJob*> jobs_that(bool have_ended);
  SoakJob* some_job(bool that_ended);
  const image::Image& reference(const SoakJob& job);

  // --- the liar ---
  std::size_t lies();
  std::vector<v1::DistrustedWorker> distrusted();
  int cuts();  // of units, for urgent jobs

  // --- invariants ---
  void check();  // all that can be looked at while the farm is at work
  void check_images();
  void check_end();
  void expect_flat() const;
  std::string summary();

  std::uint64_t seed_ = 0;
  std::mt19937_64 random_;
  const bool short_form_;
  Farm farm_;
  std::unique_ptr<People> people_;
  std::unique_ptr<ShiftedClock> clock_;
  std::unique_ptr<SlowLink> link_;
  std::map<std::string, Process*> workers_;
  std::vector<SoakJob> jobs_;
  std::vector<std::string> urgent_;  // ids
  std::string told_;                 // of the present event
  int losses_ = 0, equal_ = 0;       // images that were refused, and that were right
  bool is_found_ = false;            // the liar, and it is not trusted again

 private:
  std::string progress();
  bool liar_had_a_part(const std::string& id);
  void check_image(const SoakJob& job);
  void check_processes();
  void check_liar();
  void count_audits();

  std::vector<Kind> kinds_;
  std::map<std::string, image::Image> references_;
  std::map<std::string, std::vector<double>> resident_mb_;
  struct Count {
    double last = 0, sum = 0;
  };
  std::map<std::string, Count> audits_;
  std::set<std::string> liar_ids_, false_;  // ids of workers, and of jobs that had false samples
  std::size_t known_lies_ = 0;
  std::vector<std::size_t> lies_to_be_found_;
};

}  // namespace candela::farm
