// Markov chains over a known function, as a renderer: what a farm makes of them can be computed beforehand,
// to the last bit, and its expectation is known.
//
// Primary sample space is [0, 1); pixel p is what floor(u * pixels) says. The chains follow f(p), independent
// samples (the large steps) bring g(p): the image is f + g, b is the mean of f.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/chains/chains.h"
#include "common/film/delta.h"
#include "common/rng/stream.h"
#include "worker/render/renderer.h"

namespace candela::toy {

inline constexpr double kLargeStep = 0.3;
inline constexpr int kPilotScale = 12;
inline constexpr const char* kStepRule = "toy.step";  // a state: a double

struct Toy {
  ChainPlan plan{40, 1000, 200};
  bool black = false;           // f is zero
  bool direct = false;          // g is not
  std::size_t state_bytes = 0;  // padding of states
  double step = 0.02;           // of small steps; of a job with epochs: in the first ones

  static Toy from(const SettingsMap& settings) {
    const auto number = [&](const char* key) { return std::stoull(settings.at(key)); };
    Toy toy;
    toy.plan = {static_cast<std::uint32_t>(number("chains")), number("bootstrap"), number("mutations")};
    toy.black = number("black") != 0;
    toy.direct = number("direct") != 0;
    toy.state_bytes = number("state");
    return toy;
  }
  SettingsMap settings() const {
    return {{"chains", std::to_string(plan.chains)},
            {"bootstrap", std::to_string(plan.bootstrap_samples)},
            {"mutations", std::to_string(plan.segment_mutations)},
            {"black", black ? "1" : "0"},
            {"direct", direct ? "1" : "0"},
            {"state", std::to_string(state_bytes)}};
  }
  float f(std::uint32_t pixel) const {
    return black || pixel % 5 == 0 ? 0.0F : 0.25F + static_cast<float>(pixel % 13);
  }
  float g(std::uint32_t pixel) const { return direct ? 0.5F * static_cast<float>(pixel % 3) : 0.0F; }
};

class ToyRenderer final : public render::Renderer {
 public:
  ToyRenderer(const JobSettings& settings, std::chrono::microseconds per_segment = {})
      : toy_(Toy::from(settings.integrator_settings)),
        width_(settings.width),
        pixels_(settings.width * settings.height),
        seed_(settings.seed),
        per_segment_(per_segment) {
    layout_ = {settings.width, settings.height, 3};
  }

  render::UnitOutput make_output(const NamedState& state) const override {
    render::UnitOutput output;
    output.film = std::make_unique<film::UnitFilm>(layout_, state.film_scale_log2);
    return output;
  }
  Result<PilotResult> pilot(const render::RunContext&) const override {
    const double seconds = std::max(std::chrono::duration<double>(per_segment_).count(), 1e-4);
    return PilotResult{
        {kPilotScale}, "a toy", seconds, {.layers = {"independent", "segments"}, .chains = toy_.plan}};
  }
  Result<void> run(const Unit& unit, const render::UnitInput& input, render::UnitOutput& output,
                   const render::RunContext& context) const override {
    return unit.kind == Unit::Kind::bootstrap ? run_bootstrap(unit, output, context)
                                              : run_segments(unit, input, output, context);
  }
  Result<void> run_bootstrap(const Unit& unit, render::UnitOutput& output,
                             const render::RunContext& context) const {
    for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
      const std::uint32_t p = pixel(start_of(i));
      output.table.push_back(toy_.f(p));
      if (p % 20 == 0) ++output.counts.rejected[static_cast<std::size_t>(film::RejectCause::infinite)];
    }
    std::this_thread::sleep_for(per_segment_ * (unit.end - unit.begin) / toy_.plan.segment_mutations);
    if (context.stop != nullptr && *context.stop) return refused_error("stopped");
    return {};
  }
  Result<void> run_segments(const Unit& unit, const render::UnitInput& input, render::UnitOutput& output,
                            const render::RunContext& context) const {
    const auto starts = input.starts;
    film::UnitFilm& film = *output.film;
    film::SampleCounts sample_counts;
    for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
      const std::uint64_t chain = chains::chain_of(unit.half, i, toy_.plan.chains);
      if (starts[i - unit.begin].record.segments != chains::segment_of(i, toy_.plan.chains))
        return input_error("a start of another segment");
      const chains::ChainRecord& start = starts[i - unit.begin].record;
      output.records.push_back(segment(chain, starts[i - unit.begin], step_of(input), input.state.bootstrap_b,
                                       film, sample_counts));
      if (!output.accumulators.empty())
        count_small_steps(start.counts, output.records.back().counts, rng::key(seed_, 5, chain, i),
                          *output.accumulators[0], sample_counts);
      std::this_thread::sleep_for(per_segment_);
      if (context.stop != nullptr && *context.stop) return refused_error("stopped");
      if (context.progress != nullptr)
        *context.progress =
            static_cast<float>(i + 1 - unit.begin) / static_cast<float>(unit.end - unit.begin);
    }
    film.count(sample_counts);
    return {};
  }
  Result<std::string> plan_text() const override { return std::string("a toy"); }

 private:
  double start_of(std::uint64_t sample) const {
    return rng::Stream(rng::key(seed_, 0x62ULL, sample)).next_double();
  }
  std::uint32_t pixel(double u) const {
    return std::min(static_cast<std::uint32_t>(u * pixels_), pixels_ - 1);
  }
  void splat(film::UnitFilm& film, std::uint32_t layer, std::uint32_t p, double value, std::uint64_t key,
             film::SampleCounts& sample_counts) const {
    const auto v = static_cast<float>(value);
    film.splat(layer, p % width_, p / width_, {v, v, v}, key, sample_counts);
  }
  // The decided one, if the job has epochs.
  double step_of(const render::UnitInput& input) const {
    double step = toy_.step;
    const auto state = input.states.find(kStepRule);
    if (state != input.states.end()) std::memcpy(&step, state->second.data(), sizeof step);
    return step;
  }
  // Proposed and accepted ones of a segment, into the only entry of a table.
  static void count_small_steps(const chains::ChainCounts& before, const chains::ChainCounts& after,
                                std::uint64_t key, film::UnitAccumulator& table,
                                film::SampleCounts& sample_counts) {
    const auto small = [](std::uint64_t all, std::uint64_t large) {
      return static_cast<double>(all - large);
    };
    const std::array<double, 2> counts{
        small(after.mutations - before.mutations, after.large_steps - before.large_steps),
        small(after.accepted - before.accepted, after.large_accepted - before.large_accepted)};
    table.splat(0, 0, 0, counts, key, sample_counts);
  }
  chains::ChainRecord segment(std::uint64_t chain, const chains::ChainStart& start, double step, double b0,
                              film::UnitFilm& film, film::SampleCounts& sample_counts) const {
    chains::ChainRecord record = start.record;
    chains::ChainCounts& c = record.counts;
    double u = start_of(start.bootstrap_sample);
    if (record.segments > 0) std::memcpy(&u, record.state.data(), sizeof u);
    const auto mutations = static_cast<double>(toy_.plan.segment_mutations);
    const double unit = b0 * pixels_ / mutations;  // each mutation's share of a film whose mean is b0
    for (std::uint64_t k = 0; k < toy_.plan.segment_mutations; ++k) {
      const std::uint64_t m = record.segments * toy_.plan.segment_mutations + k;
      rng::Stream stream(rng::key(seed_, 0x6dULL, chain, m));
      const bool large = stream.next_double() < kLargeStep;
      const double shift = stream.next_double();
      double v = large ? shift : u + step * (shift - 0.5);
      v -= std::floor(v);
      const double now = toy_.f(pixel(u)), then = toy_.f(pixel(v));
      ++c.mutations;
      ++sample_counts.eye_samples;
      if (large) {
        ++c.large_steps;
        c.large_sum += then;
        c.large_square_sum += then * then;
        splat(film, 1, pixel(v), toy_.g(pixel(v)) * pixels_ / (mutations * kLargeStep),
              rng::key(seed_, 3, chain, m), sample_counts);
      }
      const double accept = !(b0 > 0) ? 0 : now > 0 ? std::min(1.0, then / now) : 1;
      if (b0 > 0) {
        splat(film, 0, pixel(v), accept * unit, rng::key(seed_, 1, chain, m), sample_counts);
        splat(film, 0, pixel(u), (1 - accept) * unit, rng::key(seed_, 2, chain, m), sample_counts);
      }
      const bool moved = stream.next_double() < accept;
      if (moved) {
        u = v;
        ++c.accepted;
        if (large) ++c.large_accepted;
      }
      c.present_stay = moved ? 0 : c.present_stay + 1;
      if (c.present_stay > c.longest_stay) {
        c.longest_stay = c.present_stay;
        c.stay_x = static_cast<float>(pixel(u) % width_) + 0.5F;
        c.stay_y = static_cast<float>(pixel(u) / width_) + 0.5F;
      }
    }
    splat(film, 2, static_cast<std::uint32_t>(chain) % pixels_, 1, rng::key(seed_, 4, chain, record.segments),
          sample_counts);
    ++record.segments;
    record.state.assign(sizeof u + chain % 7 + toy_.state_bytes, 's');
    std::memcpy(record.state.data(), &u, sizeof u);
    return record;
  }

  Toy toy_;
  film::Layout layout_;
  std::uint32_t width_, pixels_;
  std::uint64_t seed_;
  std::chrono::microseconds per_segment_;
};

// The result of a farm, made here without one.
struct Expected {
  film::MergedFilm film;
  std::vector<chains::ChainRecord> records;  // by chain
  chains::BootstrapSums bootstrap;
  NamedState state;
  std::vector<chains::ChainCounts> counts() const {
    std::vector<chains::ChainCounts> out;
    for (const chains::ChainRecord& r : records) out.push_back(r.counts);
    return out;
  }
  film::Development development() const {
    return chains::development(state.bootstrap_b, chains::pool(bootstrap, counts()));
  }
};

// The bootstrap, without any segment. `samples`: the starts of the chains.
inline Expected expect_bootstrap(const JobSettings& settings, std::vector<std::uint64_t>& samples) {
  const ToyRenderer renderer(settings);
  const ChainPlan plan = Toy::from(settings.integrator_settings).plan;
  const film::Layout layout{settings.width, settings.height, 3};
  chains::BootstrapTable table(plan.bootstrap_samples);
  render::UnitOutput all;
  if (!renderer.run({Unit::Kind::bootstrap, 0, 0, plan.bootstrap_samples}, {}, all, {}) ||
      !table.insert(0, all.table))
    std::abort();
  NamedState state;
  state.bootstrap_b = table.normalisation().b;
  state.film_scale_log2 = chains::film_scale_log2(state.bootstrap_b, kPilotScale);
  Expected out{film::MergedFilm(layout, state.film_scale_log2), {}, table.sums(), state};
  out.records.resize(plan.chains);
  samples = table.choose_starts(plan.chains, settings.seed);
  return out;
}

inline Expected expect(const JobSettings& settings, std::uint64_t rounds) {
  const ToyRenderer renderer(settings);
  const ChainPlan plan = Toy::from(settings.integrator_settings).plan;
  const film::Layout layout{settings.width, settings.height, 3};
  std::vector<std::uint64_t> samples;
  Expected out = expect_bootstrap(settings, samples);
  const NamedState& state = out.state;
  const std::uint64_t n = plan.chains / 2;
  for (std::uint64_t round = 0; round < rounds; ++round)
    for (std::uint32_t half = 0; half < 2; ++half) {
      const Unit unit{Unit::Kind::segments, half, round * n, (round + 1) * n};
      std::vector<chains::ChainStart> starts;
      for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
        const std::uint64_t chain = chains::chain_of(half, i, plan.chains);
        starts.push_back({samples.empty() ? 0 : samples[chain], out.records[chain]});
      }
      auto output = renderer.make_output(state);
      if (!renderer.run(unit, {state, {}, starts}, output, {})) std::abort();
      for (std::uint64_t i = unit.begin; i < unit.end; ++i)
        out.records[chains::chain_of(half, i, plan.chains)] = output.records[i - unit.begin];
      const auto delta = film::Delta::decode(encode_delta({unit, {}, 0, "", ""}, output), layout);
      if (!delta || !out.film.merge(*delta)) std::abort();
    }
  return out;
}

}  // namespace candela::toy
