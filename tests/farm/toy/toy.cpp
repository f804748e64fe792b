#include "tests/farm/toy/toy.h"

#include <array>
#include <cstring>

#include "common/rng/stream.h"
#include "common/stages/epochs.h"

namespace candela::toy {
namespace {

constexpr std::uint64_t kFirst = 4;
constexpr std::uint32_t kGrowth = 4, kLag = 1;
constexpr std::int64_t kThreshold = 12;  // of the mean square, in units of the accumulator
constexpr int kSquareScale = 12;
constexpr std::size_t kMemoBytes = 2 * sizeof(std::uint32_t);  // of a pixel

}  // namespace

WorkPlan work_plan() {
  WorkPlan plan;
  plan.accumulators = {{kSquares, 1, kSquareScale, film::AccumulatorSpec::Per::epoch}};
  plan.epochs = EpochPlan{kFirst, kGrowth, kLag, kRule, {{"threshold", std::to_string(kThreshold)}}};
  return plan;
}

integrators::UnitOutput make_output(std::uint32_t width, std::uint32_t height, int film_scale_log2) {
  integrators::UnitOutput output;
  output.film = std::make_unique<film::UnitFilm>(film::Layout{width, height, 1}, film_scale_log2);
  output.accumulators.push_back(
      std::make_unique<film::UnitAccumulator>(width, height, work_plan().accumulators[0]));
  return output;
}

Result<void> render(const Unit& unit, std::string_view state, std::uint32_t width, std::uint32_t height,
                    std::uint64_t seed, integrators::UnitOutput& output) {
  if (state.size() != std::size_t{width} * height)
    return input_error("the state is not of this film").with_field("state");
  film::SampleCounts sample_counts;
  for (std::uint64_t i = unit.begin; i < unit.end; ++i)
    for (std::uint32_t y = 0; y < height; ++y)
      for (std::uint32_t x = 0; x < width; ++x) {
        const std::uint64_t key = rng::key(seed, unit.half, i, y, x);
        const int level = static_cast<unsigned char>(state[std::size_t{y} * width + x]);
        // Pixels differ in power, so that they stop doubling at different levels.
        const double amplitude = 1 + static_cast<double>((x * 7 + y * 13) % 16);
        const double value = amplitude * rng::to_double(key) / static_cast<double>(1ULL << level);
        const auto v = static_cast<float>(value);
        sample_counts.eye_samples += 1;
        output.film->add(0, x, y, {v, v * 0.5F, v * 0.25F}, key, sample_counts);
        const double square = value * value;
        output.accumulators[0]->add(x, y, 0, {&square, 1}, key, sample_counts);
      }
  output.film->count(sample_counts);
  return {};
}

Result<std::string> double_where_squares_say_so(const DecisionInput& input, Carry& carry) {
  const std::size_t pixels = std::size_t{input.width} * input.height;
  if (carry.sums.size() != 1) return failed_error("there are no squares");
  if (input.epoch == 0) {
    carry.memo.assign(pixels * kMemoBytes, '\0');
    return std::string(pixels, '\0');
  }
  if (input.previous.size() != pixels || carry.memo.size() != pixels * kMemoBytes)
    return failed_error("the state before is of another film");
  std::string state(input.previous);
  if (!input.folded) return state;
  const DecisionInput::Folded& folded = *input.folded;
  const Epochs epochs(input.plan.first, input.plan.growth);
  const auto samples =
      static_cast<std::uint32_t>(epochs.begin(folded.epoch + 1) - epochs.begin(folded.epoch));
  const std::int64_t threshold = std::stoll(input.plan.constants.at("threshold"));
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x) {
      const std::size_t p = std::size_t{y} * input.width + x;
      if (folded.state[p] != input.previous[p]) continue;  // samples of another number tell nothing
      std::array<std::uint32_t, 2> memo;
      std::memcpy(memo.data(), carry.memo.data() + p * kMemoBytes, kMemoBytes);
      auto& [looks, iterations] = memo;
      film::Int128 sum = carry.sums[0].sum(x, y, 0) + folded.sums[0]->sum(x, y, 0);
      iterations += samples;
      ++looks;
      if (state[p] < 40 && sum > film::Int128{threshold} * iterations) {
        ++state[p];
        sum = 0;
        iterations = 0;
      }
      carry.sums[0].set_pixel(x, y, {&sum, 1});
      std::memcpy(carry.memo.data() + p * kMemoBytes, memo.data(), kMemoBytes);
    }
  return state;
}

Result<StateReport> describe(const EpochPlan& /*plan*/, std::uint64_t /*epoch*/, std::uint32_t width,
                             std::uint32_t height, std::string_view state, const Carry& carry,
                             bool with_layers) {
  const std::size_t pixels = std::size_t{width} * height;
  if (state.size() != pixels || carry.memo.size() != pixels * kMemoBytes)
    return failed_error("the state is of another film");
  double doublings = 0, looks = 0;
  StateReport out;
  std::vector<float> levels(pixels);
  for (std::size_t p = 0; p < pixels; ++p) {
    std::uint32_t of_pixel = 0;
    std::memcpy(&of_pixel, carry.memo.data() + p * kMemoBytes, sizeof(of_pixel));
    looks += of_pixel;
    doublings += state[p];
    levels[p] = static_cast<float>(state[p]);
  }
  out.figures = {{"doublings", doublings}, {"looks", looks}};
  if (with_layers) out.layers.push_back({"level", std::move(levels)});
  return out;
}

}  // namespace candela::toy
