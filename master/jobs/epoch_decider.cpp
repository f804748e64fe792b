#include "master/jobs/epoch_decider.h"

#include <fmt/format.h>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/stages/decision.h"

namespace candela::master {
namespace {

constexpr double kDecideSeconds = 0.05;  // between looks for decisions that are due
constexpr double kRetrySeconds = 1;      // after one that could not be made

Result<void> put_blob(BlobStore& blobs, const std::string& sha256, std::string_view bytes) {
  CANDELA_ASSIGN(const bool there, blobs.check(sha256));
  if (there) return {};
  CANDELA_ASSIGN(const auto upload, blobs.begin(sha256, bytes.size()));
  CANDELA_TRY(upload->append(bytes));
  return upload->finish();
}

}  // namespace

Result<std::optional<std::string>> EpochDecider::decide_state(const DueDecision& due) {
  CANDELA_ASSIGN(const std::shared_ptr<JobFilm> film, truth_.open_film(due.job_id));
  if (!film) return std::optional<std::string>();
  if (!covers(film->account().merged, due.needed)) {  // a checkpoint was lost, and its units are made again
    truth_.agree_if_short(due.job_id, *film);
    return std::optional<std::string>();
  }
  std::vector<std::shared_ptr<const film::MergedAccumulator>> held;
  const auto sums = [&](std::string_view name, std::uint64_t epoch) -> const film::MergedAccumulator* {
    held.push_back(film->accumulator(name, epoch));
    return held.back().get();
  };
  const auto accumulators =
      table_.with_scheduler([&](Scheduler& s) { return s.job(due.job_id)->row.accumulators; });
  auto replayed = replay(due.plan, accumulators, due.epoch + 1, due.width, due.height, sums);
  Result<std::string> state =
      replayed.ok() ? Result<std::string>(std::move(replayed->states.back())) : std::move(replayed).error();
  if (!state.ok()) {
    table_.with_scheduler([&](Scheduler& s) {
      s.fail_job(
          due.job_id,
          fmt::format("the state of epoch {} cannot be decided: {}", due.epoch, state.error().to_string()),
          JobTable::now());
    });
    return std::optional<std::string>();
  }
  StateRow row{due.job_id, due.epoch, due.plan.rule, sha256_hex(*state), state->size()};
  CANDELA_TRY(put_blob(blobs_, row.sha256, *state));
  table_.with_scheduler([&](Scheduler& s) { s.decided(row, JobTable::now()); });
  table_.remember_states(due.job_id, *film);
  return std::optional<std::string>(std::move(row.sha256));
}

void EpochDecider::decide_loop() {
  while (!wake_.stopping()) {
    bool any = false;
    for (const DueDecision& due : table_.with_scheduler([](Scheduler& s) { return s.due_decisions(); })) {
      if (wake_.stopping() || retry_at_[due.job_id] > JobTable::now().seconds) continue;
      const auto state = decide_state(due);
      if (state.ok() && *state) {
        any = true;
        continue;
      }
      retry_at_[due.job_id] = JobTable::now().seconds + (state.ok() ? kDecideSeconds : kRetrySeconds);
      if (state.ok()) continue;
      const std::string text = state.error().to_string();
      if (std::exchange(reported_error_, text) == text) continue;
      table_.with_scheduler([&](Scheduler& s) {
        s.event(JobTable::now(), due.job_id, "", "undecided",
                fmt::format("the state of epoch {}: {}", due.epoch, text));
      });
    }
    if (!any) wake_.sleep(kDecideSeconds);
  }
}

}  // namespace candela::master
