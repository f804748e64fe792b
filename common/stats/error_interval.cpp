#include "common/stats/error_interval.h"

#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>

#include "common/stats/image_error.h"

namespace candela::stats {
namespace {

// Chosen on half of the scenes of `candela-bench coverage` (docs/lab/error-coverage.md).
constexpr std::uint32_t kReach = 2;  // pixels around one that its denominator is smoothed over
constexpr double kNormal = 1.645;    // one-sided 95 %
constexpr double kTail = 0.05;
// The bias of merging, as the movement of the image tells it, or as it is measured. Its upper end is added to
// those of other parts, so that all together are exceeded less often.
constexpr double kTailOfBias = 0.15, kTailOfMeasuredBias = 0.35;
// The image's own error spreads about what is expected as much as the estimate does.
constexpr double kBoth = 1.41421356;
// Shares of the noise that the upper end adds for light that was found too rarely to be in the noise, and for
// light that both groups of chains have found too often or too rarely alike. Where photons measure their bias
// the upper end has leaks besides, which are larger.
constexpr double kUnseen = 0.5, kUnseenByChains = 0.75, kUnseenByPhotons = 0.1;
constexpr double kStandsOut = 0.5;  // standard errors
// From so many iterations of each half on the movement has two groups, unless an older build merged them:
// then the prior stands for the bias.
constexpr double kKnown = 4;
constexpr double kUnknown = 100;         // its standard error, of the prior's mean
constexpr double kFewIterations = 16;    // up to here the bias is too uncertain to leave a denominator of 0
constexpr std::size_t kManyBlocks = 16;  // from so many on the spread of their energies is known

using Row = std::vector<double>;

// Rows of both halves around the present one.
class Rows {
 public:
  // factor: of squared differences, the noise of the image.
  Rows(const Halves& halves, double factor)
      : halves_(halves), factor_(factor), values_(std::size_t{halves.width} * film::kChannels) {
    for (auto& slot : slots_)
      for (Row* row : {&slot.a, &slot.b, &slot.scaled, &slot.product, &slot.noise, &slot.lesser})
        row->resize(values_);
  }
  struct Slot {
    Row a, b, scaled;
    Row product, noise, lesser;  // a * b, (a - b)^2 * factor, min(a, b)
  };
  // Makes rows [y - kReach, y + kReach] of the image available. To be called for y = 0, 1, 2 ...
  void move_to(std::uint32_t y) {
    for (; next_ < halves_.height && next_ <= y + kReach; ++next_) {
      Slot& slot = slots_[next_ % slots_.size()];
      halves_.row(next_, slot.a, slot.b, slot.scaled);
      for (std::size_t i = 0; i < values_; ++i) {
        const double a = slot.a[i], b = slot.b[i], d = a - b;
        slot.product[i] = a * b;
        slot.noise[i] = d * d * factor_;
        slot.lesser[i] = std::min(a, b);
      }
    }
  }
  const Slot& row(std::uint32_t y) const { return slots_[y % slots_.size()]; }
  std::size_t values() const { return values_; }

 private:
  const Halves& halves_;
  double factor_;
  std::size_t values_;
  std::uint32_t next_ = 0;
  std::array<Slot, 2 * kReach + 1> slots_;
};

// The brightest of the pixels around each of a row, by their lesser halves.
class Brightest {
 public:
  explicit Brightest(std::size_t values) : columns_(values + 2 * film::kChannels), around_(values) {}
  // rows: below, itself, above, as many as there are.
  void fill(const Rows& rows, std::uint32_t y, std::uint32_t height) {
    std::fill(columns_.begin(), columns_.end(), 0.0);
    std::fill(around_.begin(), around_.end(), 0.0);
    for (std::uint32_t v = y == 0 ? 0 : y - 1; v < std::min(height, y + 2); ++v) {
      const double* lesser = rows.row(v).lesser.data();
      double* columns = columns_.data() + film::kChannels;
      for (std::size_t i = 0; i < around_.size(); ++i) columns[i] = std::max(columns[i], lesser[i]);
      if (v == y) continue;
      for (std::size_t i = 0; i < around_.size(); ++i) around_[i] = std::max(around_[i], lesser[i]);
    }
    for (std::size_t i = 0; i < around_.size(); ++i)
      around_[i] = std::max(around_[i], std::max(columns_[i], columns_[i + 2 * film::kChannels]));
  }
  double operator[](std::size_t i) const { return around_[i]; }

 private:
  Row columns_;  // the brightest of three, with a pixel of zeros at both ends
  Row around_;
};

// Energies of a field by scale: the orthonormal Haar transform, level by level, of a field that comes row by
// row. Blocks at the border are cut.
class Bands {
 public:
  explicit Bands(std::uint32_t width) { levels_.push_back(Level(width)); }

  void push(std::span<const double> values) {
    push(0, Row(values.begin(), values.end()), Row(values.size() / 3, 1));
  }

  struct Band {
    std::size_t blocks = 0;
    double energy = 0, squares = 0;  // sums over blocks of their energy, and of its square
  };
  // From fine to coarse, the last of one block, the whole field's mean. To be called once, after all rows.
  std::vector<Band> finish() {
    for (std::size_t l = 0; l < levels_.size(); ++l) {
      if (!levels_[l].sums.empty()) pair(l, {}, {});
      if (levels_[l].width == 1 && levels_[l].rows <= 1) break;
    }
    std::vector<Band> bands;
    for (const Level& level : levels_)
      if (level.band.blocks > 0) bands.push_back(level.band);
    Band whole{1, 0, 0};
    for (std::size_t c = 0; c < film::kChannels; ++c)
      whole.energy += last_sums_[c] * last_sums_[c] / last_size_;
    bands.push_back(whole);
    return bands;
  }

 private:
  struct Level {
    explicit Level(std::uint32_t w) : width(w) {}
    std::uint32_t width;
    std::size_t rows = 0;  // that came
    Row sums, sizes;       // the first row of a pair
    Band band;
  };

  void push(std::size_t l, Row sums, Row sizes) {
    if (l == levels_.size()) levels_.push_back(Level(static_cast<std::uint32_t>(sizes.size())));
    Level& level = levels_[l];
    ++level.rows;
    std::copy(sums.begin(), sums.begin() + film::kChannels, last_sums_.begin());
    last_size_ = sizes[0];
    if (level.sums.empty()) {
      level.sums = std::move(sums);
      level.sizes = std::move(sizes);
      return;
    }
    pair(l, sums, sizes);
  }
  // Joins the kept row of the level with another, or none, to one of the next level.
  void pair(std::size_t l, std::span<const double> sums, std::span<const double> sizes) {
    const Row first = std::move(levels_[l].sums), first_sizes = std::move(levels_[l].sizes);
    levels_[l].sums.clear();
    levels_[l].sizes.clear();
    if (levels_[l].width == 1 && sizes.empty() && levels_[l].rows == 1) return;
    const std::size_t width = (first_sizes.size() + 1) / 2;
    Row joined(width * film::kChannels, 0.0), joined_sizes(width, 0.0);
    for (std::size_t x = 0; x < width; ++x) {
      double children = 0, parent = 0;
      std::array<double, film::kChannels> total{};
      for (std::size_t i = 2 * x; i < std::min(first_sizes.size(), 2 * x + 2); ++i)
        for (const bool second : {false, true}) {
          if (second && sizes.empty()) continue;
          const double size = second ? sizes[i] : first_sizes[i];
          joined_sizes[x] += size;
          for (std::size_t c = 0; c < film::kChannels; ++c) {
            const double sum = (second ? sums : std::span<const double>(first))[i * film::kChannels + c];
            children += sum * sum / size;
            total[c] += sum;
          }
        }
      for (std::size_t c = 0; c < film::kChannels; ++c) {
        parent += total[c] * total[c] / joined_sizes[x];
        joined[x * film::kChannels + c] = total[c];
      }
      const double energy = std::max(0.0, children - parent);
      ++levels_[l].band.blocks;
      levels_[l].band.energy += energy;
      levels_[l].band.squares += energy * energy;
    }
    push(l + 1, std::move(joined), std::move(joined_sizes));
  }

  std::vector<Level> levels_;
  std::array<double, film::kChannels> last_sums_{};
  double last_size_ = 1;
};

// Sums over 5 x 5 pixels of a row's channels, cut at the border: by running sums along the row.
class Neighborhoods {
 public:
  explicit Neighborhoods(std::size_t values) : columns_(values), along_(values + film::kChannels) {}
  // Sums one member over the rows [y0, y1).
  void fill(const Rows& rows, std::uint32_t y0, std::uint32_t y1, Row Rows::Slot::*member) {
    std::fill(columns_.begin(), columns_.end(), 0.0);
    for (std::uint32_t y = y0; y < y1; ++y) {
      const double* values = (rows.row(y).*member).data();
      for (std::size_t i = 0; i < columns_.size(); ++i) columns_[i] += values[i];
    }
    for (std::size_t i = 0; i < columns_.size(); ++i) along_[i + film::kChannels] = along_[i] + columns_[i];
  }
  double sum(std::size_t x0, std::size_t x1, std::size_t c) const {
    return along_[x1 * film::kChannels + c] - along_[x0 * film::kChannels + c];
  }

 private:
  Row columns_, along_;
};

struct Means {
  double a = 0, b = 0;
  bool black = true;
};

Means means_of(const Halves& halves) {
  Means means;
  Row a(std::size_t{halves.width} * film::kChannels), b(a.size()), scaled(a.size());
  for (std::uint32_t y = 0; y < halves.height; ++y) {
    halves.row(y, a, b, scaled);
    for (std::size_t i = 0; i < a.size(); ++i) {
      means.a += a[i];
      means.b += b[i];
      means.black = means.black && a[i] == 0 && b[i] == 0;
    }
  }
  const double count = static_cast<double>(halves.height) * static_cast<double>(a.size());
  means.a /= count;
  means.b /= count;
  return means;
}

// Maximum shortfall of the sum of the energies below its expectation.
double excess(const std::vector<Bands::Band>& bands) {
  double squares = 0;
  for (const Bands::Band& band : bands) {
    const auto n = static_cast<double>(band.blocks);
    double up = 0;
    if (band.blocks >= kManyBlocks) {
      const double variance = std::max(0.0, band.squares / n - band.energy / n * band.energy / n);
      up = kBoth * kNormal * std::sqrt(n * variance);
    } else {  // as of normal coefficients
      const double freedom = film::kChannels * n;
      up = band.energy * (freedom / boost::math::quantile(boost::math::chi_squared(freedom), kTail) - 1);
    }
    squares += up * up;
  }
  return std::sqrt(squares);
}

struct Blur {
  double value = 0, error = 0;  // an estimate, which may be below 0, and its standard error
};

// The bias of merging, from how the image moves: the product of what either half tells has no noise in its
// expectation. `weights`: means over blocks of 1 / denominator; `sizes`: their pixels.
Blur blur_of(const Movement::Bias& bias, const Row& weights, const Row& sizes) {
  if (bias.a.empty()) return {};
  // The standard error is that of the noise, by d = a - b: a bias that both halves tell alike is certain.
  // Normal noise of variance s in each half, which d^2 / 2 estimates, gives the product of a bias b a
  // variance of s^2 + 2 s b^2; d^4 / 12 estimates s^2.
  double sum = 0, variance = 0, pixels = 0;
  for (std::size_t block = 0; block < sizes.size(); ++block) {
    double product = 0, spread = 0;
    for (std::size_t c = 0; c < film::kChannels; ++c) {
      const std::size_t i = block * film::kChannels + c;
      const double d = double{bias.a[i]} - bias.b[i];
      product += double{bias.a[i]} * bias.b[i] * weights[i];
      spread += d * d / 2 * weights[i];
    }
    product *= sizes[block];
    spread *= sizes[block];
    sum += product;
    variance += spread * spread / 3 + 2 * std::max(0.0, product) * spread;
    pixels += sizes[block];
  }
  const double values = pixels * film::kChannels;
  return {sum / values, std::sqrt(variance) / values};
}

// The mean of two independent estimates of the bias, by their precision. Empty ones do not count.
Movement::Bias combined(const Movement::Bias& measured, const Movement::Bias& moved, const Row& weights) {
  if (moved.a.empty()) return measured;
  const auto noise_of = [&](const Movement::Bias& bias) {
    double sum = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double d = double{bias.a[i]} - bias.b[i];
      sum += d * d * weights[i];
    }
    return sum;
  };
  const double noise = noise_of(measured), other = noise_of(moved);
  const double share = noise + other > 0 ? other / (noise + other) : 1;
  Movement::Bias bias = measured;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    bias.a[i] = static_cast<float>(share * measured.a[i] + (1 - share) * moved.a[i]);
    bias.b[i] = static_cast<float>(share * measured.b[i] + (1 - share) * moved.b[i]);
  }
  return bias;
}

struct Posterior {
  double mean = 0, upper = 0;  // `upper`: exceeded with probability `tail`
};

// The bias b >= 0 by Bayes' rule. Its estimate is normal. Its prior is of Pareto's kind [Lomax 1954],
//   p(b) = (1 + b / expected)^-3 * 2 / expected,
// of mean `expected`: a few times as much is likely enough for an image that tells so to be believed, and
// what cannot be told from the noise is no larger than expected. The integral is over log(1 + b / expected).
Posterior posterior_of(const Blur& blur, double expected, double tail) {
  const double known = std::max(0.0, blur.value);
  if (!(blur.error > 0) || !(expected > 0) || !std::isfinite(blur.value) || !std::isfinite(blur.error))
    return {known, known};
  constexpr std::size_t kSteps = 256;
  constexpr double kErrors = 8;  // to each side
  const double from = std::log1p(std::max(0.0, blur.value - kErrors * blur.error) / expected);
  const double step = (std::log1p((known + kErrors * blur.error) / expected) - from) / kSteps;
  const auto bias_at = [&](double steps) { return expected * std::expm1(from + step * steps); };
  std::array<double, kSteps> weights{};  // logarithms at first
  for (std::size_t i = 0; i < kSteps; ++i) {
    const double middle = static_cast<double>(i) + 0.5, errors = (bias_at(middle) - blur.value) / blur.error;
    weights[i] = -2 * (from + step * middle) - errors * errors / 2;
  }
  const double most = *std::max_element(weights.begin(), weights.end());
  double sum = 0, mean = 0;
  for (std::size_t i = 0; i < kSteps; ++i) {
    weights[i] = std::exp(weights[i] - most);
    sum += weights[i];
    mean += weights[i] * bias_at(static_cast<double>(i) + 0.5);
  }
  mean /= sum;
  double above = 0;
  std::size_t i = kSteps;
  while (i > 0 && above <= tail * sum) above += weights[--i];
  const double upper = bias_at(static_cast<double>(i) + (above - tail * sum) / weights[i]);
  return {mean, std::max(mean, upper)};
}

// Light that leaks into a block by its measured bias. It leaks along edges, and is lost on their other side,
// so means over squares cancel: the largest mean over a line of blocks, in four directions, as far as it
// stands out of the noise around.
double leak_along_lines(const Movement::Bias& bias, const BlockMeans& now, std::uint32_t x, std::uint32_t y,
                        std::uint32_t c) {
  constexpr int kAround = kReach;
  constexpr std::array<std::array<int, 2>, 4> kDirections = {{{1, 0}, {0, 1}, {1, 1}, {1, -1}}};
  // visit(value index) of the block at this offset, if there is one.
  const auto at = [&](int dx, int dy, const auto& visit) {
    const auto u = static_cast<std::int64_t>(x) + dx, v = static_cast<std::int64_t>(y) + dy;
    if (u < 0 || v < 0 || u >= now.width || v >= now.height) return;
    visit((static_cast<std::size_t>(v) * now.width + static_cast<std::size_t>(u)) * film::kChannels + c);
  };
  double squares = 0, around = 0;
  for (int dy = -kAround; dy <= kAround; ++dy)
    for (int dx = -kAround; dx <= kAround; ++dx)
      at(dx, dy, [&](std::size_t i) {
        const double d = double{bias.a[i]} - bias.b[i];
        squares += d * d / 4;
        around += 1;
      });
  double most = 0;
  for (const auto& [dx, dy] : kDirections) {
    double sum = 0, count = 0;
    for (int t = -kAround; t <= kAround; ++t)
      at(t * dx, t * dy, [&](std::size_t i) {
        sum += (double{bias.a[i]} + bias.b[i]) / 2;
        count += 1;
      });
    most = std::max(most, sum / count - kStandsOut * std::sqrt(squares / around / count));
  }
  return most;
}

// 1 / denominator of the blocks without the light that merging has carried there: where photons leak into
// pixels that are nearly black, that light would be its own denominator. `values`: means over blocks of what
// the denominators are the squares of. `measured`: the bias is.
Row weights_without(const Movement::Bias& bias, bool measured, const BlockMeans& now, const Row& values) {
  Row left = values, weights(values.size()), errors(values.size(), 0.0);
  const bool few = now.n0 + now.n1 < kFewIterations;
  double mean = 0;
  for (std::uint32_t y = 0; y < now.height; ++y)
    for (std::uint32_t x = 0; x < now.width; ++x)
      for (std::uint32_t c = 0; c < film::kChannels; ++c) {
        // The lesser half, around the block, as far as it stands out of its own spread: noise alone does not.
        double sum = 0, squares = 0, count = 0;
        for (std::uint32_t v = y < kReach ? 0 : y - kReach; v < std::min(now.height, y + kReach + 1); ++v)
          for (std::uint32_t u = x < kReach ? 0 : x - kReach; u < std::min(now.width, x + kReach + 1); ++u) {
            const std::size_t i = (std::size_t{v} * now.width + u) * film::kChannels + c;
            const double least = double{std::min(bias.a[i], bias.b[i])};
            sum += least;
            squares += least * least;
            count += 1;
          }
        const std::size_t j = (std::size_t{y} * now.width + x) * film::kChannels + c;
        const double mean_bias = sum / count;
        const double error = std::sqrt(std::max(0.0, squares / count - mean_bias * mean_bias) / count);
        double leaked = std::max(0.0, mean_bias - kStandsOut * error);
        if (measured) leaked = std::max(leaked, leak_along_lines(bias, now, x, y, c));
        left[j] = std::max(0.0, values[j] - leaked);
        if (few) errors[j] = std::min(error, values[j]);
        mean += left[j] / static_cast<double>(values.size());
      }
  for (std::size_t j = 0; j < left.size(); ++j) {
    const double square = left[j] * left[j] + errors[j] * errors[j] + kDarkFraction * mean * mean;
    weights[j] = square > 0 ? 1 / square : 0;
  }
  return weights;
}

}  // namespace

ErrorInterval error_interval(const Halves& halves, const ErrorContext& context) {
  ErrorInterval result;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Means means = means_of(halves);
  const bool both = halves.n0 > 0 && halves.n1 > 0;
  if (!both) {
    result.mean = halves.n0 > 0 ? means.a : means.b;
    result.relmse = result.upper = result.noise = result.blur = result.unseen = result.rmse = nan;
    return result;
  }
  const double w0 = halves.weight0(), w1 = halves.weight1();
  const double factor = halves.chains ? (w0 * w0 + w1 * w1) / 2 : w0 * w1;
  result.mean = w0 * means.a + w1 * means.b;
  const double floor = kDarkFraction * std::min(means.a, means.b) * std::min(means.a, means.b);

  BlockMeans& blocks = result.blocks;
  blocks.side = block_side(halves.width, halves.height);
  blocks.width = (halves.width + blocks.side - 1) / blocks.side;
  blocks.height = (halves.height + blocks.side - 1) / blocks.side;
  blocks.n0 = halves.n0;
  blocks.n1 = halves.n1;
  const std::size_t block_values = std::size_t{blocks.width} * blocks.height * film::kChannels;
  Row sum_a(block_values), sum_b(block_values), weights(block_values), sizes(block_values / film::kChannels);
  Row values_of_blocks(block_values), variances_of_blocks(block_values);

  Rows rows(halves, factor);
  Bands bands(halves.width);
  Neighborhoods near_a(rows.values()), near_b(rows.values()), near_ab(rows.values()), near_v(rows.values());
  Brightest brightest(rows.values());
  Row field(rows.values());
  double noise = 0, of_factor = 0, variances = 0;
  for (std::uint32_t y = 0; y < halves.height; ++y) {
    rows.move_to(y);
    const std::uint32_t y0 = y < kReach ? 0 : y - kReach, y1 = std::min(halves.height, y + kReach + 1);
    near_a.fill(rows, y0, y1, &Rows::Slot::a);
    near_b.fill(rows, y0, y1, &Rows::Slot::b);
    near_ab.fill(rows, y0, y1, &Rows::Slot::product);
    near_v.fill(rows, y0, y1, &Rows::Slot::noise);
    brightest.fill(rows, y, halves.height);
    const Rows::Slot& row = rows.row(y);
    for (std::uint32_t x = 0; x < halves.width; ++x) {
      const std::uint32_t x0 = x < kReach ? 0 : x - kReach, x1 = std::min(halves.width, x + kReach + 1);
      const auto count = static_cast<double>((y1 - y0) * (x1 - x0));
      const std::size_t block = std::size_t{y / blocks.side} * blocks.width + x / blocks.side;
      sizes[block] += 1;
      for (std::size_t c = 0; c < film::kChannels; ++c) {
        const std::size_t i = std::size_t{x} * film::kChannels + c;
        const double a = row.a[i], b = row.b[i];
        const double mean_a = near_a.sum(x0, x1, c) / count, mean_b = near_b.sum(x0, x1, c) / count;
        // The part of the neighborhood's spread that both halves have is the picture's; the pixel's own value
        // counts as much as that, its neighbors' mean the rest.
        const double spread = std::max(0.0, near_ab.sum(x0, x1, c) / count - mean_a * mean_b);
        const double mean_v = near_v.sum(x0, x1, c) / count;
        const double share = spread > 0 ? spread / (spread + mean_v) : 0;
        // The lesser half: a rare bright sample is in one of them, and must not be its own denominator. The
        // mean where a pixel beside it is as bright in both.
        const double around =
            count > 1 ? std::min(mean_a * count - a, mean_b * count - b) / (count - 1) : std::min(a, b);
        const double own = std::min(w0 * a + w1 * b, std::max(row.lesser[i], brightest[i]));
        const double value = share * own + (1 - share) * around;
        const double square = value * value + floor;
        const double weight = square > 0 ? 1 / square : 0;
        field[i] = (a - b) * std::sqrt(factor * weight);
        noise += field[i] * field[i];
        variances += row.noise[i];
        values_of_blocks[block * film::kChannels + c] += value;
        variances_of_blocks[block * film::kChannels + c] += row.noise[i];
        if (halves.factor_variance > 0) {
          const double v = row.scaled[i] * row.scaled[i] * halves.factor_variance;
          of_factor += v * weight;
          variances += v;
        }
        const std::size_t j = block * film::kChannels + c;
        sum_a[j] += a;
        sum_b[j] += b;
        weights[j] += weight;
      }
    }
    bands.push(field);
  }
  for (std::size_t j = 0; j < block_values; ++j) {
    const double size = sizes[j / film::kChannels];
    blocks.a.push_back(static_cast<float>(sum_a[j] / size));
    blocks.b.push_back(static_cast<float>(sum_b[j] / size));
    weights[j] /= size;
    values_of_blocks[j] /= size;
  }
  const double values = static_cast<double>(halves.height) * static_cast<double>(rows.values());
  result.rmse = std::sqrt(variances / values);
  if (means.black) return result;
  result.noise = (noise + of_factor) / values;
  Movement::Bias bias;
  const bool measured =
      context.alpha < 1 && context.measured != nullptr && context.measured->a.size() == block_values;
  if (context.alpha < 1 && context.movement != nullptr) bias = context.movement->bias(blocks, context.alpha);
  // The movement does not show light that leaks and stays, but bias of radii that follow their photons.
  const Movement::Bias all = measured ? combined(*context.measured, bias, weights) : bias;
  if (measured) bias = *context.measured;
  const double tail = measured ? kTailOfMeasuredBias : kTailOfBias;
  const double unseen = measured ? kUnseenByPhotons : halves.chains ? kUnseenByChains : kUnseen;
  result.unseen = unseen * result.noise;
  // Independent samples have found too rarely also what makes the spread.
  const double spread = (halves.chains ? 1 : 1 + unseen) * excess(bands.finish()) / values;
  const auto upper_end = [&](double noise_there, const Posterior& blur) {
    return noise_there + result.unseen + blur.mean + std::hypot(spread, blur.upper - blur.mean);
  };
  Posterior blur;
  const double expected = context.expected_bias * result.noise;
  if (!bias.a.empty())
    blur = posterior_of(blur_of(all, weights, sizes), expected, tail);
  else if (context.alpha < 1 && context.movement != nullptr && std::min(blocks.n0, blocks.n1) >= kKnown)
    blur = posterior_of({0, kUnknown * expected}, expected, tail);
  result.blur = blur.mean;
  result.relmse = result.noise + result.blur;
  result.upper = upper_end(result.noise, blur);
  if (!bias.a.empty() && !context.connects) {
    const Row without = weights_without(bias, measured, blocks, values_of_blocks);
    double more_noise = of_factor;
    for (std::size_t i = 0; i < block_values; ++i) more_noise += variances_of_blocks[i] * without[i];
    more_noise /= values;
    const Posterior more =
        posterior_of(blur_of(bias, without, sizes), context.expected_bias * more_noise, tail);
    result.upper = std::max(result.upper, upper_end(more_noise, more));
  }
  return result;
}

}  // namespace candela::stats
