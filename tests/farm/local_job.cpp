#include "tests/farm/local_job.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/stages/epochs.h"
#include "tests/replay.h"

namespace candela::farm {
namespace {

using film::AccumulatorSpec;

// Adds the unit's part, as a master reads it from a delta.
void merge(LocalJob& job, const Unit& unit, std::uint64_t epoch, const integrators::UnitOutput& output) {
  film::DeltaInfo info;
  info.unit = unit;
  info.job_id = "j";
  const auto delta = film::Delta::decode(integrators::encode_delta(info, output),
                                         {job.film.layout(), job.work.accumulators});
  ASSERT_TRUE(delta.ok()) << delta.error().to_string();
  ASSERT_TRUE(job.film.merge(*delta).ok());
  for (std::uint32_t i = 0; i < job.work.accumulators.size(); ++i) {
    const AccumulatorSpec& spec = job.work.accumulators[i];
    auto& sums = job.accumulators[{i, spec.per == AccumulatorSpec::Per::epoch ? epoch : unit.half}];
    if (!sums)
      sums =
          std::make_shared<film::MergedAccumulator>(job.film.layout().width, job.film.layout().height, spec);
    sums->merge(delta->accumulators()[i]);
  }
}

// The sums of a whole epoch, by the order of the carry.
std::vector<const film::MergedAccumulator*> sums_of_epoch(const LocalJob& job, std::uint64_t epoch) {
  std::vector<const film::MergedAccumulator*> sums;
  for (std::uint32_t i = 0; i < job.work.accumulators.size(); ++i)
    if (job.work.accumulators[i].per == AccumulatorSpec::Per::epoch)
      sums.push_back(job.accumulators.at({i, epoch}).get());
  return sums;
}

void decide_next(LocalJob& job) {
  const EpochPlan& plan = *job.work.epochs;
  const std::uint64_t epoch = job.states.size();
  DecisionInput input{plan, epoch, job.film.layout().width, job.film.layout().height, {}, {}};
  if (epoch > 0) input.previous = job.states.back();
  if (epoch > plan.lag) {
    const std::uint64_t folded = epoch - 1 - plan.lag;
    input.folded = {folded, job.states[folded], sums_of_epoch(job, folded)};
  }
  auto state = decide(input, job.carry);
  ASSERT_TRUE(state.ok()) << state.error().to_string();
  job.states.push_back(std::move(*state));
}

void expect_decisions(const master::Decisions& decisions, const LocalJob& job) {
  ASSERT_EQ(decisions.states.size(), job.states.size());
  ASSERT_EQ(decisions.made, job.states.size());
  bool changed = false;
  for (std::size_t e = 0; e < job.states.size(); ++e) {
    EXPECT_EQ(decisions.states[e].epoch, e);
    EXPECT_EQ(decisions.states[e].sha256, sha256_hex(job.states[e])) << "epoch " << e;
    changed |= e > 0 && job.states[e] != job.states[e - 1];
  }
  // A state may be one byte that tells nothing: what is decided is in the memo then.
  if (job.states.back().size() == 1) changed = job.carry.memo.find_first_not_of('\0') != std::string::npos;
  EXPECT_TRUE(changed) << "no state differs from the first: nothing is tested";
  EXPECT_TRUE(decisions.carry->memo == job.carry.memo) << "the memo";
  ASSERT_EQ(decisions.carry->sums.size(), job.carry.sums.size());
  for (std::size_t i = 0; i < job.carry.sums.size(); ++i)
    EXPECT_TRUE(decisions.carry->sums[i].serialise() == job.carry.sums[i].serialise()) << "carry " << i;
}

void expect_replay(const LocalJob& job) {
  const film::Layout& layout = job.film.layout();
  const auto sums = [&](std::string_view name, std::uint64_t epoch) {
    std::uint32_t i = 0;
    while (job.work.accumulators[i].name != name) ++i;
    return job.accumulators.at({i, epoch}).get();
  };
  const auto again =
      replay(*job.work.epochs, job.work.accumulators, job.states.size(), layout.width, layout.height, sums);
  ASSERT_TRUE(again.ok()) << again.error().to_string();
  EXPECT_EQ(again->states, job.states) << "the replay";
  EXPECT_EQ(again->carry.memo, job.carry.memo) << "the replay";
}

}  // namespace

LocalJob local_job(const WorkPlan& work, const film::Layout& layout, int film_scale_log2,
                   std::uint64_t iterations, const RenderUnit& render) {
  LocalJob job{work,
               film::MergedFilm(layout, film_scale_log2),
               {},
               {},
               empty_carry(work.accumulators, layout.width, layout.height)};
  const std::array<std::uint64_t, 2> target = {(iterations + 1) / 2, iterations / 2};
  const Unit::Kind kind = work.chains ? Unit::Kind::segments : Unit::Kind::iterations;
  const auto run = [&](const Unit& unit, std::uint64_t epoch, std::string_view state) {
    if (unit.begin >= unit.end) return;
    integrators::UnitOutput output = render(unit, state);
    output.epoch = epoch;
    merge(job, unit, epoch, output);
  };
  if (!work.epochs) {
    for (std::uint32_t half = 0; half < 2; ++half) run({kind, half, 0, target[half]}, 0, {});
    return job;
  }
  const Epochs epochs(work.epochs->first, work.epochs->growth);
  for (std::uint64_t e = 0; epochs.begin_index(e) < target[0] && !testing::Test::HasFatalFailure(); ++e) {
    decide_next(job);
    for (std::uint32_t half = 0; half < 2; ++half)
      run({kind, half, epochs.begin_index(e), std::min(epochs.begin_index(e + 1), target[half])}, e,
          job.states.back());
  }
  return job;
}

void expect_checkpoint(const std::filesystem::path& file, const LocalJob& job) {
  const auto bytes = read_file(file, 1 << 28);
  ASSERT_TRUE(bytes.ok()) << bytes.error().to_string();
  const std::uint32_t chains = job.work.chains ? job.work.chains->chains : 0;
  const auto found = master::parse_checkpoint(*bytes, {chains, job.work.accumulators, job.work.epochs});
  ASSERT_TRUE(found.ok()) << found.error().to_string();
  EXPECT_TRUE(found->film.serialise() == job.film.serialise()) << "the film";
  ASSERT_EQ(found->records.size(), job.records.size());
  for (std::size_t c = 0; c < job.records.size(); ++c)
    EXPECT_TRUE(*found->records[c] == job.records[c]) << "chain " << c;
  std::uint64_t folded = 0;
  if (job.work.epochs) {
    expect_decisions(found->decisions, job);
    expect_replay(job);
    folded = epochs_folded(found->decisions.made, job.work.epochs->lag);
  }
  // The sums of folded epochs are gone, all others are there.
  std::size_t open = 0;
  for (const auto& [key, sums] : job.accumulators) {
    const bool per_epoch = job.work.accumulators[key.first].per == AccumulatorSpec::Per::epoch;
    if (per_epoch && key.second < folded) continue;
    ++open;
    const auto there = found->accumulators.find(key);
    ASSERT_NE(there, found->accumulators.end()) << key.first << ' ' << key.second;
    EXPECT_TRUE(there->second->serialise() == sums->serialise())
        << job.work.accumulators[key.first].name << (per_epoch ? ", epoch " : ", half ") << key.second;
  }
  EXPECT_EQ(found->accumulators.size(), open);
}

}  // namespace candela::farm
