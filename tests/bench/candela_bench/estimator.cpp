#include "tests/bench/candela_bench/estimator.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>
#include <optional>

#include "common/base/version.h"
#include "common/bundle/gather.h"
#include "common/chains/chains.h"
#include "common/film/codec.h"
#include "common/film/development.h"
#include "common/film/film.h"
#include "common/stages/development.h"
#include "common/stats/image_error.h"
#include "common/stats/inner_merges.h"
#include "tests/epoch_run.h"
#include "worker/render/renderer.h"

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_START_INSTRUMENTATION
#define CALLGRIND_TOGGLE_COLLECT
#define CALLGRIND_DUMP_STATS
#endif

namespace candela::bench {
namespace {

double cpu_now() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double wall_now() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count();
}

// Most memory this process has had in RAM. (ru_maxrss would count the parent's, from before the exec.)
std::uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  std::uint64_t kibibytes = 0;
  for (std::string word; status >> word;)
    if (word == "VmHWM:" && status >> kibibytes) break;
  return kibibytes * 1024;
}

void put_text(std::string& out, std::string_view text) {
  film::put_u64(out, text.size());
  out += text;
}
std::string_view read_text(film::Reader& reader) {
  return reader.bytes(reader.u64());
}

// Runs what renders, and adds what it took. Instrumentation stays on from the first call: to stop it has
// Valgrind translate all code anew.
template <class Call>
auto timed(Cost& cost, const Call& call) {
  CALLGRIND_START_INSTRUMENTATION;  // nothing but a few moves of registers outside of Valgrind
  CALLGRIND_TOGGLE_COLLECT;
  const double cpu = cpu_now(), wall = wall_now();
  auto result = call();
  cost.wall_seconds += wall_now() - wall;
  cost.cpu_seconds += cpu_now() - cpu;
  CALLGRIND_TOGGLE_COLLECT;
  return result;
}

void add(Cost& cost, const film::SampleCounts& sample_counts) {
  cost.eye_samples += sample_counts.eye_samples;
  cost.light_paths += sample_counts.light_paths;
  cost.rays += sample_counts.rays;
  cost.rejected +=
      std::accumulate(sample_counts.rejected.begin(), sample_counts.rejected.end(), std::uint64_t{0});
}

// Both kinds of jobs are this: units of two halves, whose films are encoded, decoded and merged as on a farm.
class RenderEstimator : public Estimator {
 public:
  RenderEstimator(std::unique_ptr<render::Renderer> renderer, const RunSpec& run)
      : renderer_(std::move(renderer)) {
    context_.threads = run.threads;
  }

  Result<Cost> advance(std::uint64_t units) override {
    for (const Unit& unit : units_between(cost_.units, units)) {
      output_.clear();
      CANDELA_TRY(render(unit));
      cost_.peak_memory_bytes = peak_memory_bytes();
      CANDELA_TRY(deliver(unit));
    }
    cost_.units = std::max(cost_.units, units);
    return cost_;
  }

  Result<Snapshot> snapshot() override {
    CANDELA_ASSIGN(const film::Development development, this->development());
    Snapshot snapshot;
    snapshot.image = film::develop_image(*merged_, development);
    snapshot.own_relmse = cost_.units < 2 ? std::numeric_limits<double>::quiet_NaN()
                                          : stats::estimate_error(*merged_, development).relmse;
    return snapshot;
  }

  Result<stats::HalfImages> halves() override {
    CANDELA_ASSIGN(const film::Development development, this->development());
    return stats::images_of(stats::halves_of(*merged_, development));
  }

  // The cost, what the job keeps beside the film with its length, the film.
  Result<std::string> save() override {
    static_assert(std::is_trivially_copyable_v<Cost>);
    const std::string others = save_others();
    const std::uint64_t length = others.size();
    std::string saved(reinterpret_cast<const char*>(&cost_), sizeof cost_);
    saved.append(reinterpret_cast<const char*>(&length), sizeof length);
    return saved + others + merged_->serialise();
  }

  Result<Cost> restore(std::string_view saved) override {
    Cost cost;
    std::uint64_t length = 0;
    if (saved.size() < sizeof cost + sizeof length) return input_error("a kept state that is cut short");
    std::memcpy(&cost, saved.data(), sizeof cost);
    std::memcpy(&length, saved.data() + sizeof cost, sizeof length);
    saved.remove_prefix(sizeof cost + sizeof length);
    if (saved.size() < length) return input_error("a kept state that is cut short");
    CANDELA_ASSIGN(film::MergedFilm merged, film::MergedFilm::parse(saved.substr(length)));
    if (!(merged.layout() == merged_->layout()) || merged.scale_log2() != merged_->scale_log2() ||
        merged.iterations() != cost.units)
      return input_error("a kept state that belongs to another run");
    CANDELA_TRY(restore_others(saved.substr(0, length)));
    merged_ = std::move(merged);
    cost.setup_seconds = cost_.setup_seconds;
    return cost_ = cost;
  }

  std::string plan() const override { return plan_text_; }
  void set_plan(std::string text) { plan_text_ = std::move(text); }
  void set_setup_seconds(double seconds) { cost_.setup_seconds = seconds; }

 protected:
  // The units [from, to) in ranges, in order. Unit i is index i / 2 of half i % 2.
  virtual std::vector<Unit> units_between(std::uint64_t from, std::uint64_t to) const = 0;
  virtual Result<void> render(const Unit& unit) = 0;
  // Keeps what the image is read from beside the film. `delta`: of the unit that was rendered last.
  virtual void keep(const Unit& /*unit*/, const film::Delta& /*delta*/) {}
  virtual Result<film::Development> development() const = 0;
  virtual std::string save_others() const { return {}; }
  virtual Result<void> restore_others(std::string_view saved) {
    return saved.empty() ? Result<void>() : input_error("a kept state that belongs to another run");
  }

  void make_films(const NamedState& state) {
    output_ = renderer_->make_output(state);
    merged_.emplace(output_.film->layout(), output_.film->scale_log2());
  }

  std::unique_ptr<render::Renderer> renderer_;
  render::RunContext context_;
  render::UnitOutput output_;
  std::optional<film::MergedFilm> merged_;
  Cost cost_;

 private:
  std::string plan_text_;

  // The film's way to the master.
  Result<void> deliver(const Unit& unit) {
    film::DeltaInfo info;
    info.unit = unit;
    info.job_id = "bench";
    info.build_id = std::string(build_id());
    const std::string bytes = encode_delta(info, output_);
    film::DeltaShape shape(output_.film->layout());
    for (const auto& sums : output_.accumulators) shape.accumulators.push_back(sums->spec());
    for (const auto& sums : output_.aovs) shape.accumulators.push_back(sums->spec());
    CANDELA_ASSIGN(const film::Delta delta, film::Delta::decode(bytes, shape));
    CANDELA_TRY(merged_->merge(delta));
    keep(unit, delta);
    ++cost_.deltas;
    cost_.delta_bytes += bytes.size();
    add(cost_, delta.sample_counts());
    return {};
  }
};

class IterationEstimator final : public RenderEstimator {
 public:
  IterationEstimator(std::unique_ptr<render::Renderer> renderer, const RunSpec& run, const PilotResult& pilot)
      : RenderEstimator(std::move(renderer), run), epochs_(*renderer_, pilot), plan_(pilot.work.development) {
    make_films(pilot.state);
    measures_ = stats::find_inner_merges(output_.accumulators) != nullptr;
    if (!keeps()) return;
    for (auto& half : sums_)
      for (const film::AccumulatorSpec& spec : epochs_.accumulators())
        half.emplace_back(run.job.width, run.job.height, spec);
  }
  std::string unit_name() const override { return "iterations"; }
  stats::Movement::Bias measured_bias() const override {
    if (!measures_) return {};
    return stats::measured_bias({sums_of(stats::kInnerMerges, 0), sums_of(stats::kInnerMerges, 1)},
                                merged_->layout().width, merged_->layout().height,
                                static_cast<double>(merged_->merged(0).count()),
                                static_cast<double>(merged_->merged(1).count()));
  }

 protected:
  std::vector<Unit> units_between(std::uint64_t from, std::uint64_t to) const override {
    return epochs_.units(from, to);
  }
  Result<void> render(const Unit& unit) override {
    CANDELA_ASSIGN(const render::UnitInput input, epochs_.input(unit));
    CANDELA_TRY(timed(cost_, [&] { return renderer_->run(unit, input, output_, context_); }));
    return epochs_.add(unit, output_);
  }
  void keep(const Unit& unit, const film::Delta& delta) override {
    auto& sums = sums_[unit.half];
    for (std::size_t i = 0; i < sums.size(); ++i)
      if (of_job(sums[i])) sums[i].merge(delta.accumulators()[i].sums);
  }
  // As the master reads a job's image (master/jobs/develop.h).
  Result<film::Development> development() const override {
    film::Development out;
    if (!plan_) return out;
    const auto sums = [&](std::string_view name, std::uint32_t half) { return sums_of(name, half); };
    const DevelopmentInput input{*plan_, {}, merged_->layout().width, merged_->layout().height, sums};
    CANDELA_ASSIGN(Corrections corrections, correct(input));
    for (std::size_t half = 0; half < 2; ++half)
      if (!corrections[half].empty())
        out.corrections[half] = std::make_shared<const std::vector<float>>(std::move(corrections[half]));
    return out;
  }
  std::string save_others() const override {
    if (!epochs_.plan() && !keeps()) return {};
    std::string out;
    put_text(out, epochs_.save());
    for (const auto& half : sums_)
      for (const film::MergedAccumulator& sums : half) put_text(out, sums.serialise());
    return out;
  }
  Result<void> restore_others(std::string_view saved) override {
    if (!epochs_.plan() && !keeps()) return RenderEstimator::restore_others(saved);
    film::Reader reader(saved);
    CANDELA_TRY(epochs_.restore(read_text(reader)));
    for (auto& half : sums_)
      for (film::MergedAccumulator& sums : half) {
        CANDELA_ASSIGN(sums, film::MergedAccumulator::parse(read_text(reader), merged_->layout().width,
                                                            merged_->layout().height, sums.spec()));
      }
    if (!reader.ok() || !reader.rest().empty())
      return input_error("a kept state that belongs to another run");
    return {};
  }

 private:
  static bool of_job(const film::MergedAccumulator& sums) {
    return sums.spec().per == film::AccumulatorSpec::Per::job;
  }

  bool keeps() const { return plan_.has_value() || measures_; }
  const film::MergedAccumulator* sums_of(std::string_view name, std::uint32_t half) const {
    for (const film::MergedAccumulator& a : sums_[half])
      if (a.spec().name == name && of_job(a)) return &a;
    return nullptr;
  }

  test::EpochRun epochs_;
  std::optional<DevelopmentPlan> plan_;
  bool measures_ = false;  // photons measure the bias
  // By half, those of the plan in its order; of a job without a development or such sums: none. Those that
  // are kept for each epoch stay empty.
  std::array<std::vector<film::MergedAccumulator>, 2> sums_;
};

// A job of Markov chains (common/chains/chains.h). The bootstrap counts as rendering: the first row has it.
class ChainEstimator final : public RenderEstimator {
 public:
  ChainEstimator(std::unique_ptr<render::Renderer> renderer, const RunSpec& run, const PilotResult& pilot)
      : RenderEstimator(std::move(renderer), run), plan_(*pilot.work.chains), records_(plan_.chains) {
    state_ = pilot.state;
    seed_ = run.job.seed;
  }
  std::string unit_name() const override { return "segments"; }

  Result<void> bootstrap() {
    const Unit unit{Unit::Kind::bootstrap, 0, 0, plan_.bootstrap_samples};
    render::UnitOutput output;
    CANDELA_TRY(timed(cost_, [&] { return renderer_->run(unit, {state_, {}, {}}, output, context_); }));
    add(cost_, output.counts);
    chains::BootstrapTable table(plan_.bootstrap_samples);
    CANDELA_TRY(table.insert(0, output.table));
    sums_ = table.sums();
    starts_ = table.choose_starts(plan_.chains, seed_);
    state_.bootstrap_b = table.normalisation().b;
    state_.film_scale_log2 = chains::film_scale_log2(state_.bootstrap_b, state_.film_scale_log2);
    make_films(state_);
    return {};
  }

 protected:
  std::vector<Unit> units_between(std::uint64_t from, std::uint64_t to) const override {
    std::vector<Unit> units;
    for (std::uint32_t half = 0; half < 2 && to > from; ++half) {
      const std::uint64_t end = (to + 1 - half) / 2;
      for (std::uint64_t begin = (from + 1 - half) / 2; begin < end; begin = units.back().end)
        units.push_back({Unit::Kind::segments, half, begin, std::min(end, begin + plan_.chains / 2)});
    }
    return units;
  }

  Result<void> render(const Unit& unit) override {
    std::vector<chains::ChainStart> from;
    for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
      const std::uint64_t chain = chains::chain_of(unit.half, i, plan_.chains);
      from.push_back({starts_.empty() ? 0 : starts_[chain], records_[chain]});
    }
    CANDELA_TRY(timed(cost_, [&] { return renderer_->run(unit, {state_, {}, from}, output_, context_); }));
    for (std::size_t i = 0; i < output_.records.size(); ++i)
      records_[chains::chain_of(unit.half, unit.begin + i, plan_.chains)] = output_.records[i];
    return {};
  }

  Result<film::Development> development() const override {
    std::vector<chains::ChainCounts> counts;
    for (const chains::ChainRecord& record : records_) counts.push_back(record.counts);
    return chains::development(state_.bootstrap_b, chains::pool(sums_, counts));
  }

  std::string save_others() const override {
    return chains::encode(std::span<const chains::ChainRecord>(records_));
  }
  Result<void> restore_others(std::string_view saved) override {
    CANDELA_ASSIGN(records_, chains::decode(saved, plan_.chains));
    return {};
  }

 private:
  ChainPlan plan_;
  std::vector<chains::ChainRecord> records_;  // in the order of chains
  std::uint64_t seed_ = 0;
  NamedState state_;
  chains::BootstrapSums sums_;
  std::vector<std::uint64_t> starts_;
};

}  // namespace

void end_counting() {
  CALLGRIND_DUMP_STATS;
}

Result<std::unique_ptr<Estimator>> make_render_estimator(const RunSpec& run) {
  const double start = wall_now();
  const std::filesystem::path file = run.scene_file;
  const bundle::DiskSource files(file.parent_path());
  CANDELA_ASSIGN(auto renderer, render::Renderer::create(files, file.filename(), {}, run.job, run.threads));
  render::RunContext context;
  context.threads = run.threads;
  CANDELA_ASSIGN(const PilotResult pilot, renderer->pilot(context));
  const double seconds = wall_now() - start;
  if (pilot.work.chains) {
    auto estimator = std::make_unique<ChainEstimator>(std::move(renderer), run, pilot);
    CANDELA_TRY(estimator->bootstrap());
    estimator->set_plan(pilot.plan);
    estimator->set_setup_seconds(seconds);
    return std::unique_ptr<Estimator>(std::move(estimator));
  }
  auto estimator = std::make_unique<IterationEstimator>(std::move(renderer), run, pilot);
  estimator->set_plan(pilot.plan);
  estimator->set_setup_seconds(seconds);
  return std::unique_ptr<Estimator>(std::move(estimator));
}

}  // namespace candela::bench
