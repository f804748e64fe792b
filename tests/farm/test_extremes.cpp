// The extremes of all settings: what a master spends on a job before it renders anything.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/files.h"
#include "common/base/thread_cpu.h"
#include "common/job/aov.h"
#include "common/stages/decision.h"
#include "common/stages/memory_need.h"
#include "master/merge/job_film.h"
#include "master/scheduler/scheduler.h"
#include "tests/farm/process.h"
#include "worker/render/renderer.h"

namespace candela::farm {
namespace {

using master::JobRow;
using master::Now;
using master::Scheduler;

// A job of defaults needs some tens of kilobytes and a millisecond. A busy machine may take longer for
// either.
constexpr double kMaxCpuSeconds = 0.1;
constexpr std::uint64_t kMaxBytes = 3'000'000;  // beside what memory_need() tells

// The values at the ends of a setting's documented range, or all of its names, from the error that a value of
// no meaning gets.
std::vector<std::string> extremes(const std::string& integrator, const std::string& setting) {
  const auto refused = render::complete_integrator_settings(integrator, {}, {{setting, "?"}});
  if (refused.ok()) return {};  // any text
  const std::string& text = refused.error().message;
  if (text.find("neither true nor false") != std::string::npos) return {"true", "false"};
  std::vector<std::string> values;
  const auto words_after = [&](const std::string& mark, const char* stops) {
    const std::size_t at = text.find(mark);
    if (at == std::string::npos) return std::string();
    const std::size_t begin = at + mark.size();
    return text.substr(begin, text.find_first_of(stops, begin) - begin);
  };
  if (const std::size_t names = text.find("is not one of "); names != std::string::npos) {
    for (std::size_t at = names + 14; at < text.size();) {
      const std::size_t end = std::min(text.find(", ", at), text.size());
      values.push_back(text.substr(at, end - at));
      at = end + 2;
    }
    return values;
  }
  const std::string from = words_after("from ", " "), to = words_after(" to ", " ");
  const std::string above = words_after("above ", " "), most = words_after("at most ", " ");
  const std::string below = words_after("below ", " ");
  if (!from.empty()) values.push_back(from);
  if (!above.empty()) values.push_back(fmt::format("{}", std::max(std::stod(above), 1e-12) * (1 + 1e-12)));
  if (!to.empty()) values.push_back(to);
  if (!most.empty()) values.push_back(most);
  if (!below.empty()) values.push_back(fmt::format("{}", std::stod(below) * (1 - 1e-12)));
  return values;
}

std::uint64_t live_bytes() {
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
}

struct Spent {
  double seconds = 0;
  std::uint64_t bytes = 0;
};

// Takes the job as a master does: its plan is checked, its pilot ends, units of three epochs are leased, its
// film is made.
Spent accept(const JobSettings& settings, const WorkPlan& work, const std::filesystem::path& folder) {
  const double begin = thread_cpu_seconds();
  const std::uint64_t before = live_bytes();
  EXPECT_TRUE(validate(work, settings.width, settings.height).ok());
  EXPECT_TRUE(check_memory(memory_need(work, settings.width, settings.height), settings, 1ULL << 50).ok());
  Scheduler scheduler({}, 1, 1);
  const Now now{100, 100'000};
  JobRow row;
  row.id = "j";
  row.settings = settings;
  row.stop.iterations = Limits::max_iterations;
  scheduler.submit(row, now);
  master::WorkerRow worker;
  worker.id = worker.session = "w";
  worker.isas = {settings.isa};
  EXPECT_TRUE(scheduler.register_worker(worker, now).ok());
  scheduler.authenticate("w", "w", now);
  const auto pilot = scheduler.acquire("w", {}, {}, now).lease;
  EXPECT_TRUE(pilot);
  EXPECT_TRUE(scheduler.complete_pilot("w", pilot->row.token, {NamedState{20}, "", 0.01, work}, now));
  for (std::uint64_t e = 0; e < 3 && work.epochs; ++e)
    scheduler.decided({"j", e, work.epochs->rule, std::string(64, 'a'), 1}, now);
  for (int i = 0; i < 3; ++i) scheduler.acquire("w", {}, {}, now);
  scheduler.epoch_jobs();
  const JobRow& planned = scheduler.job("j")->row;
  master::JobFilm film(folder, master::layout_of(planned), 20, &write_file_atomically,
                       master::CheckpointShape{planned.chains ? planned.chains->chains : 0,
                                               planned.accumulators, planned.epochs});
  EXPECT_TRUE(film.ensure_loaded().ok());
  film.next_decision();
  return {thread_cpu_seconds() - begin, live_bytes() - std::min(before, live_bytes())};
}

// Claim: no setting of any integrator, at either end of its documented range, costs the master more than a
// small bound of memory and time when the job is taken, beside the memory that it is known to need.
TEST(Extremes, OfAllSettingsCostTheMasterLittle) {
  const TempDir folder;
  std::uint64_t cases = 0, refused = 0;
  Spent most;
  std::string most_seconds, most_bytes;
  for (const std::string& integrator : render::integrator_names()) {
    const auto docs = render::integrator_settings(integrator);
    ASSERT_TRUE(docs.ok());
    for (const auto& doc : *docs)
      for (const std::string& value : extremes(integrator, doc.name)) {
        const std::string name = fmt::format("{} {}={}", integrator, doc.name, value);
        SCOPED_TRACE(name);
        JobSettings job;
        job.integrator = integrator;
        job.width = 64;
        job.height = 48;
        const auto complete = render::complete_integrator_settings(integrator, {}, {{doc.name, value}});
        if (!complete.ok()) {  // it needs another setting beside it
          ++refused;
          continue;
        }
        job.integrator_settings = *complete;
        const double begin = thread_cpu_seconds();
        const auto work = render::largest_work(job);
        EXPECT_LT(thread_cpu_seconds() - begin, 10 * kMaxCpuSeconds) << "planning";
        if (!work.ok()) {
          ++refused;
          continue;
        }
        ++cases;
        const MemoryNeed need = memory_need(*work, job.width, job.height);
        const Spent spent = accept(job, *work, folder.path() / "job");
        EXPECT_LT(spent.seconds, kMaxCpuSeconds);
        EXPECT_LT(spent.bytes, kMaxBytes + need.held());
        if (spent.seconds > most.seconds) most_seconds = name;
        if (spent.bytes > most.bytes) most_bytes = name;
        most = {std::max(most.seconds, spent.seconds), std::max(most.bytes, spent.bytes)};
      }
  }
  EXPECT_GT(cases, 300U);
  EXPECT_LT(refused, cases / 4);
  std::printf("%llu cases, %llu refused; at most %.1f ms (%s), %.2f MB (%s)\n",
              static_cast<unsigned long long>(cases), static_cast<unsigned long long>(refused),
              1e3 * most.seconds, most_seconds.c_str(), 1e-6 * static_cast<double>(most.bytes),
              most_bytes.c_str());
}

// Claim: options of a job at their limits are judged without memory: the largest film there may be is told
// what it needs and refused by a master that has less.
TEST(Extremes, OfFilmsAreJudgedBeforeTheyAreMade) {
  const std::uint64_t before = live_bytes();
  for (const auto& [width, height] :
       {std::pair(1U, 1U), std::pair(65536U, 4096U), std::pair(4096U, 65536U), std::pair(16384U, 16384U)})
    for (const std::size_t layers : {0UL, 3UL}) {
      JobSettings job;
      job.width = width;
      job.height = height;
      WorkPlan work;
      for (std::size_t i = 0; i < layers; ++i) work.layers.push_back(fmt::format("layer{}", i));
      const double begin = thread_cpu_seconds();
      const MemoryNeed need = memory_need(work, width, height);
      EXPECT_GE(need.film, std::uint64_t{48} * width * height * (layers + 1));
      EXPECT_EQ(check_memory(need, job, 4ULL << 30).ok(), width == 1);
      EXPECT_LT(thread_cpu_seconds() - begin, kMaxCpuSeconds);
    }
  EXPECT_LT(live_bytes(), before + 100'000);
}

}  // namespace
}  // namespace candela::farm
