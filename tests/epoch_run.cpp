#include "tests/epoch_run.h"

#include <algorithm>
#include <cmath>

#include "common/film/codec.h"
#include "common/film/sparse_sums.h"

namespace candela::test {
namespace {

void put_text(std::string& out, std::string_view text) {
  film::put_u64(out, text.size());
  out += text;
}
std::string_view read_text(film::Reader& reader) {
  return reader.bytes(reader.u64());
}

Result<void> merge(film::MergedAccumulator& into, const film::UnitAccumulator& sums) {
  std::string bytes;
  sums.put_sums(bytes);
  film::Reader reader(bytes);
  CANDELA_ASSIGN(
      const film::SparseSums sparse,
      film::SparseSums::read(reader, film::Layout{into.width(), into.height(), 1}, into.spec().channels));
  into.merge(sparse);
  return {};
}

bool per_epoch(const film::AccumulatorSpec& spec) {
  return spec.per == film::AccumulatorSpec::Per::epoch;
}

}  // namespace

EpochRun::EpochRun(const render::Renderer& renderer, const PilotResult& pilot)
    : renderer_(renderer), state_(pilot.state), plan_(pilot.work.epochs) {
  if (pilot.work.chains) return;
  const render::UnitOutput output = renderer.make_output(pilot.state);
  layout_ = output.film->layout();
  for (const auto& sums : output.accumulators) accumulators_.push_back(sums->spec());
  if (!plan_) return;
  epochs_.emplace(plan_->first, plan_->growth);
  carry_ = empty_carry(accumulators_, layout_.width, layout_.height);
}

std::vector<Unit> EpochRun::cut(const std::vector<Unit>& units) const {
  if (!epochs_) return units;
  std::vector<Unit> parts;
  for (Unit unit : units)
    while (unit.begin < unit.end) {
      Unit part = unit;
      part.end = std::min(unit.end, epochs_->begin_index(epochs_->of_index(unit.begin) + 1));
      parts.push_back(part);
      unit.begin = part.end;
    }
  std::stable_sort(parts.begin(), parts.end(), [&](const Unit& a, const Unit& b) {
    return epochs_->of_index(a.begin) < epochs_->of_index(b.begin);
  });
  return parts;
}

std::vector<Unit> EpochRun::units(std::uint64_t from, std::uint64_t to) const {
  std::vector<Unit> halves;
  for (std::uint32_t half = 0; half < 2; ++half) {
    const Unit unit{Unit::Kind::iterations, half, (from + 1 - half) / 2, (to + 1 - half) / 2};
    if (unit.begin < unit.end) halves.push_back(unit);
  }
  return cut(halves);
}

EpochRun::OpenEpoch& EpochRun::open_epoch(std::uint64_t epoch) {
  OpenEpoch& open = open_[epoch];
  if (open.sums.empty())
    for (const film::MergedAccumulator& sums : carry_.sums)
      open.sums.emplace_back(layout_.width, layout_.height, sums.spec());
  return open;
}

Result<void> EpochRun::decide_next() {
  const std::uint64_t epoch = states_.size();
  DecisionInput input{*plan_, epoch, layout_.width, layout_.height, {}, {}};
  if (epoch > 0) input.previous = states_.back();
  if (epoch > plan_->lag) {
    const std::uint64_t folded = epoch - 1 - plan_->lag;
    const OpenEpoch& whole = open_epoch(folded);
    const std::uint64_t length = epochs_->begin_index(folded + 1) - epochs_->begin_index(folded);
    if (whole.indices[0].count() != length || whole.indices[1].count() != length)
      return internal_error("units of epoch " + std::to_string(folded) + " are missing");
    input.folded = {folded, states_[folded], {}};
    for (const film::MergedAccumulator& sums : whole.sums) input.folded->sums.push_back(&sums);
  }
  CANDELA_ASSIGN(std::string state, decide(input, carry_));
  if (input.folded) open_.erase(input.folded->epoch);
  states_.push_back(std::move(state));
  return {};
}

Result<render::UnitInput> EpochRun::input(const Unit& unit) {
  render::UnitInput input{state_, {}, {}};
  if (!epochs_) return input;
  const std::uint64_t epoch = epochs_->of_index(unit.begin);
  while (states_.size() <= epoch) CANDELA_TRY(decide_next());
  input.states.emplace(plan_->rule, states_[epoch]);
  return input;
}

Result<void> EpochRun::add(const Unit& unit, const render::UnitOutput& output) {
  if (!epochs_) return {};
  OpenEpoch& open = open_epoch(epochs_->of_index(unit.begin));
  if (!open.indices[unit.half].insert(unit.begin, unit.end))
    return internal_error("indices of a unit have been added before");
  auto sums = open.sums.begin();
  for (const auto& of_unit : output.accumulators)
    if (per_epoch(of_unit->spec())) CANDELA_TRY(merge(*sums++, *of_unit));
  return {};
}

Result<void> EpochRun::run(const Unit& unit, render::UnitOutput& output, const render::RunContext& context) {
  CANDELA_ASSIGN(const render::UnitInput from, input(unit));
  CANDELA_TRY(renderer_.run(unit, from, output, context));
  return add(unit, output);
}

Result<StateReport> EpochRun::describe(bool with_layers) const {
  if (states_.empty()) return StateReport{};
  CANDELA_ASSIGN(const DecisionRule rule, find_rule(plan_->rule));
  if (rule.describe == nullptr) return StateReport{};
  return rule.describe(*plan_, states_.size() - 1, layout_.width, layout_.height, states_.back(), carry_,
                       with_layers);
}

std::string EpochRun::save() const {
  std::string out;
  film::put_u64(out, states_.size());
  for (const std::string& state : states_) put_text(out, state);
  for (const film::MergedAccumulator& sums : carry_.sums) put_text(out, sums.serialise());
  put_text(out, carry_.memo);
  film::put_u64(out, open_.size());
  for (const auto& [epoch, open] : open_) {
    film::put_u64(out, epoch);
    for (const film::IndexSet& indices : open.indices) {
      film::put_u64(out, indices.ranges().size());
      for (const auto& [begin, end] : indices.ranges()) {
        film::put_u64(out, begin);
        film::put_u64(out, end);
      }
    }
    for (const film::MergedAccumulator& sums : open.sums) put_text(out, sums.serialise());
  }
  return out;
}

Result<void> EpochRun::restore(std::string_view saved) {
  film::Reader reader(saved);
  states_.clear();
  open_.clear();
  const auto read_sums = [&](std::vector<film::MergedAccumulator>& all) -> Result<void> {
    for (film::MergedAccumulator& sums : all) {
      CANDELA_ASSIGN(sums, film::MergedAccumulator::parse(read_text(reader), layout_.width, layout_.height,
                                                          sums.spec()));
    }
    return {};
  };
  for (std::uint64_t i = reader.u64(); i > 0 && reader.ok(); --i) states_.emplace_back(read_text(reader));
  CANDELA_TRY(read_sums(carry_.sums));
  carry_.memo = read_text(reader);
  for (std::uint64_t i = reader.u64(); i > 0 && reader.ok(); --i) {
    OpenEpoch& open = open_epoch(reader.u64());
    for (film::IndexSet& indices : open.indices)
      for (std::uint64_t ranges = reader.u64(); ranges > 0 && reader.ok(); --ranges) {
        const std::uint64_t begin = reader.u64();
        indices.insert(begin, reader.u64());
      }
    CANDELA_TRY(read_sums(open.sums));
  }
  if (!reader.ok() || !reader.rest().empty()) return input_error("kept states that are not those of a run");
  return {};
}

film::SampleCounts JobSums::sample_counts() const {
  film::SampleCounts sum = halves[0].sample_counts;
  sum.add(halves[1].sample_counts);
  return sum;
}

std::vector<double> JobSums::mean(std::size_t layer) const {
  const std::size_t values = layout.pixel_count() * film::kChannels;
  const double to_value =
      std::ldexp(1.0, -scale_log2) / static_cast<double>(halves[0].iterations + halves[1].iterations);
  std::vector<double> mean(values);
  for (std::size_t i = 0; i < values; ++i) {
    const std::size_t at = layer * values + i;
    mean[i] = static_cast<double>(halves[0].sums[at] + halves[1].sums[at]) * to_value;
  }
  return mean;
}

Result<JobSums> render_job(const render::Renderer& renderer, const PilotResult& pilot,
                           std::uint64_t iterations, const render::RunContext& context) {
  EpochRun epochs(renderer, pilot);
  render::UnitOutput output = renderer.make_output(pilot.state);
  JobSums job;
  job.layout = output.film->layout();
  job.scale_log2 = output.film->scale_log2();
  const std::size_t values = job.layout.pixel_count() * film::kChannels * job.layout.layers;
  for (JobSums::Half& half : job.halves) half.sums.assign(values, 0);
  for (const Unit& unit : epochs.units(0, iterations)) {
    output.clear();
    CANDELA_TRY(epochs.run(unit, output, context));
    JobSums::Half& half = job.halves[unit.half];
    for (std::size_t i = 0; i < values; ++i) half.sums[i] += output.film->sums()[i];
    half.sample_counts.add(output.film->sample_counts());
    half.iterations += unit.end - unit.begin;
  }
  job.states = epochs.states();
  return job;
}

}  // namespace candela::test
