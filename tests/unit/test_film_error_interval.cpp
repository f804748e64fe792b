// Tests of the interval of an image's error, on made-up images whose truth is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "common/film/delta.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "common/stats/error_context.h"
#include "common/stats/error_interval.h"
#include "common/stats/image_error.h"
#include "common/stats/movement_sums.h"
#include "tests/half_images.h"

namespace candela::stats {
namespace {

constexpr std::uint32_t kSide = 32;
constexpr std::size_t kPixels = std::size_t{kSide} * kSide;

// Dark above, brighter below, with an edge down the middle.
double picture(std::size_t p) {
  const std::size_t x = p % kSide, y = p / kSide;
  return (y < 10 ? 0.15 : 0.5) * (x < 16 ? 0.5 : 1);
}

// Light that few samples find: in a square of `side` pixels, with this probability a sample.
struct Rare {
  std::uint32_t side = 0;
  double mean = 0, probability = 1;
  bool at(std::size_t p) const {
    return p % kSide >= 16 && p % kSide < 16 + side && p / kSide >= 16 && p / kSide < 16 + side;
  }
};

double truth_at(std::size_t p, const Rare& rare) {
  return picture(p) + (rare.at(p) ? rare.mean : 0);
}

// Exponential samples, an even number, in two halves.
HalfImages render(std::uint64_t seed, int samples, const Rare& rare = {}) {
  HalfImages image;
  image.width = image.height = kSide;
  image.n0 = image.n1 = samples / 2;
  rng::Stream stream(rng::key(seed, 7, 0));
  for (std::size_t p = 0; p < kPixels; ++p)
    for (std::vector<float>* half : {&image.a, &image.b}) {
      double sum = 0;
      for (int i = 0; i < samples / 2; ++i) {
        sum -= picture(p) * std::log(1 - stream.next_float());
        if (rare.at(p) && stream.next_float() < rare.probability) sum += rare.mean / rare.probability;
      }
      half->insert(half->end(), 3, static_cast<float>(sum / (samples / 2)));
    }
  return image;
}

double relmse_of(const HalfImages& image, const std::function<double(std::size_t)>& truth) {
  double mean = 0, sum = 0;
  for (std::size_t p = 0; p < kPixels; ++p) mean += truth(p) / kPixels;
  const double w0 = image.n0 / (image.n0 + image.n1);
  for (std::size_t i = 0; i < image.a.size(); ++i) {
    const double d = w0 * image.a[i] + (1 - w0) * image.b[i] - truth(i / 3);
    sum += d * d * relative_weight(truth(i / 3), mean);
  }
  return sum / static_cast<double>(image.a.size());
}

// The variance divided by the noisy image itself.
double by_own_image(const HalfImages& image) {
  double mean = 0, sum = 0;
  const auto values = static_cast<double>(image.a.size());
  for (std::size_t i = 0; i < image.a.size(); ++i) mean += (image.a[i] + image.b[i]) / 2 / values;
  for (std::size_t i = 0; i < image.a.size(); ++i) {
    const double d = double{image.a[i]} - image.b[i];
    sum += d * d / 4 * relative_weight((image.a[i] + image.b[i]) / 2, mean) / values;
  }
  return sum;
}

struct Coverage {
  int images = 0, covered = 0, covered_by_own = 0;
  std::vector<double> uppers, estimates;
  void add(const HalfImages& image, double truth, const ErrorInterval& shown) {
    ++images;
    covered += truth <= shown.upper ? 1 : 0;
    covered_by_own += truth <= by_own_image(image) ? 1 : 0;
    uppers.push_back(shown.upper / truth);
    estimates.push_back(shown.relmse / truth);
  }
  static double median(std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return v[v.size() / 2];
  }
};

// Claim: of images of skewed samples the upper end covers the truth, and is at most 2.2 times as large in the
// median; the estimate's median is within 20 % of the truth. At 4 samples dividing by the image itself covers
// next to none.
TEST(ErrorInterval, CoversSkewedNoise) {
  for (const int samples : {4, 16, 64}) {
    Coverage c;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
      const HalfImages image = render(seed, samples);
      c.add(image, relmse_of(image, [](std::size_t p) { return truth_at(p, {}); }),
            error_interval(halves_of(image)));
    }
    EXPECT_EQ(c.covered, c.images) << samples;
    EXPECT_LT(Coverage::median(c.uppers), 2.2) << samples;
    EXPECT_NEAR(Coverage::median(c.estimates), 1, 0.2) << samples;
    if (samples == 4) {
      EXPECT_LE(c.covered_by_own, 3);
    }
  }
}

// Claim: light that one sample in a hundred or a thousand finds is covered in at least 57 of 60 images once
// some ten samples have found it, where dividing by the image itself covers at most 3.
TEST(ErrorInterval, CoversRareLight) {
  const struct {
    Rare rare;
    int samples;
  } cases[] = {{{10, 1, 1e-2}, 16}, {{10, 1, 1e-3}, 128}, {{22, 0.3, 1e-3}, 32}};
  for (const auto& [rare, samples] : cases) {
    Coverage c;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
      const HalfImages image = render(seed, samples, rare);
      c.add(image, relmse_of(image, [&r = rare](std::size_t p) { return truth_at(p, r); }),
            error_interval(halves_of(image)));
    }
    EXPECT_GE(c.covered, 57) << rare.probability << ", " << samples;
    EXPECT_LE(c.covered_by_own, 3) << rare.probability << ", " << samples;
  }
}

// Claim: a bias that falls as i^(-1/3) and is far above the noise at the end is in the estimate to 40 %, and
// below the upper end from the second doubling on; without the movement of the image it is not.
TEST(ErrorInterval, CoversTheBiasOfMerging) {
  constexpr double kAlpha = 2.0 / 3;
  const auto bias = [](std::size_t p) { return 0.8 * picture(p) * (p % 7 < 3 ? 1 : -0.5); };
  Movement movement;
  const ErrorContext context{.alpha = kAlpha, .movement = &movement};
  HalfImages image;
  double weight = 0;
  int done = 0;
  for (const int samples : {4, 8, 16, 32, 64, 128, 256}) {
    HalfImages more = render(static_cast<std::uint64_t>(samples), samples - done);
    if (done == 0) image = more;
    double added = 0;
    for (int i = done + 1; i <= samples; ++i) added += std::pow(i, kAlpha - 1);
    weight += added;
    for (std::size_t i = 0; i < image.a.size(); ++i)
      for (auto [to, from] : {std::pair(&image.a, &more.a), std::pair(&image.b, &more.b)}) {
        const double mean = (*from)[i] + bias(i / 3) * added / (samples - done);
        (*to)[i] =
            static_cast<float>(((done > 0 ? (*to)[i] : 0.0) * done + mean * (samples - done)) / samples);
      }
    done = samples;
    image.n0 = image.n1 = samples / 2;
    const ErrorInterval shown = error_interval(halves_of(image), context);
    const double truth = relmse_of(image, [](std::size_t p) { return picture(p); });
    if (samples >= 8) {
      EXPECT_GE(shown.upper, truth) << samples;
    }
    if (samples == 256) {
      EXPECT_NEAR(shown.relmse / truth, 1, 0.4);
      EXPECT_LT(error_interval(halves_of(image)).upper, truth / 2);
      // Less is expected if connections find most light; the known part counts.
      const ErrorInterval connected = error_interval(
          halves_of(image),
          {.alpha = kAlpha, .expected_bias = 1.0 / 3, .connects = true, .movement = &movement});
      EXPECT_NEAR(connected.relmse / truth, 1, 0.4);
      EXPECT_LE(connected.upper, shown.upper);
    }
    movement.add(shown.blocks, kAlpha);
  }
}

// Claim: a bias that the image cannot tell from its noise is taken to be as large as is expected of it: if
// there is none, the upper end of 20 images is at most 5 and 4 times the truth in the median at 16 and 128
// samples; the truth is covered in at least 19 of them, and in 18 if the bias is three times the noise.
TEST(ErrorInterval, ExpectsABiasThatIsNotKnown) {
  constexpr double kAlpha = 5.0 / 6;
  for (const double ratio : {0.0, 1.0, 3.0}) {
    Coverage few, many;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      Movement movement;
      HalfImages sums = render(100 * seed, 4);
      for (const int samples : {4, 8, 16, 32, 64, 128}) {
        if (samples > 4) {
          const HalfImages more = render(100 * seed + static_cast<std::uint64_t>(samples), samples / 2);
          for (std::size_t i = 0; i < sums.a.size(); ++i) {
            sums.a[i] = (sums.a[i] + more.a[i]) / 2;
            sums.b[i] = (sums.b[i] + more.b[i]) / 2;
          }
          sums.n0 = sums.n1 = samples / 2;
        }
        // The noise's square falls as 1 / samples, that of the bias as samples^(-1/3).
        HalfImages image = sums;
        const double size = std::sqrt(ratio / 128) * std::pow(samples / 128.0, kAlpha - 1);
        for (std::size_t i = 0; i < image.a.size(); ++i) {
          const double bias = size * picture(i / 3) * (i / 3 % 2 == 0 ? 1 : -1);
          image.a[i] += static_cast<float>(bias);
          image.b[i] += static_cast<float>(bias);
        }
        const ErrorInterval shown =
            error_interval(halves_of(image), {.alpha = kAlpha, .movement = &movement});
        const double truth = relmse_of(image, picture);
        if (samples == 16) few.add(image, truth, shown);
        if (samples == 128) many.add(image, truth, shown);
        movement.add(shown.blocks, kAlpha);
      }
    }
    EXPECT_GE(few.covered, ratio > 1 ? 18 : 19) << ratio;
    EXPECT_GE(many.covered, ratio > 1 ? 18 : 19) << ratio;
    if (ratio == 0) {
      EXPECT_LE(Coverage::median(few.uppers), 5);
      EXPECT_LE(Coverage::median(many.uppers), 4);
    }
  }
}

// Claim: light that merging carries into black pixels, as much as the others have, is no denominator of its
// own: from the third doubling on the upper end is at least a third of the truth, which is a hundred times
// above the estimate; from 16 iterations on if it is measured with three times as much noise.
TEST(ErrorInterval, CoversLeaksIntoTheDark) {
  constexpr double kAlpha = 2.0 / 3;
  const auto dark = [](std::size_t p) { return p % kSide < kSide / 2; };
  Movement movement;
  const ErrorContext context{.alpha = kAlpha, .movement = &movement};
  HalfImages image;
  int done = 0;
  for (const int samples : {4, 8, 16, 32, 64}) {
    const HalfImages more = render(static_cast<std::uint64_t>(samples), samples - done);
    if (done == 0) image = more;
    double added = 0;
    for (int i = done + 1; i <= samples; ++i) added += std::pow(i, kAlpha - 1);
    for (std::size_t i = 0; i < image.a.size(); ++i)
      for (auto [to, from] : {std::pair(&image.a, &more.a), std::pair(&image.b, &more.b)}) {
        // The noise of a dark pixel is that of the light which leaks there.
        const double leaked = 1 * added / (samples - done);
        const double mean = dark(i / 3) ? leaked * (1 + 0.2 * ((*from)[i] - picture(i / 3))) : (*from)[i];
        (*to)[i] =
            static_cast<float>(((done > 0 ? (*to)[i] : 0.0) * done + mean * (samples - done)) / samples);
      }
    done = samples;
    image.n0 = image.n1 = samples / 2;
    const ErrorInterval shown = error_interval(halves_of(image), context);
    const double truth = relmse_of(image, [&](std::size_t p) { return dark(p) ? 0.0 : picture(p); });
    if (samples >= 32) {
      EXPECT_GE(shown.upper, truth / 3) << samples;
      EXPECT_LE(shown.upper, 20 * truth) << samples;
      EXPECT_GE(truth, 100 * shown.relmse) << samples;
    }
    if (samples == 16) {
      Movement::Bias measured;
      rng::Stream stream(rng::key(1, 9, 0));
      for (auto [half, bias] : {std::pair(&image.a, &measured.a), std::pair(&image.b, &measured.b)})
        for (std::size_t i = 0; i < half->size(); ++i) {
          const double noise = 3 * std::sqrt(12.0) * (stream.next_float() - 0.5);
          bias->push_back(dark(i / 3) ? static_cast<float>((*half)[i] * (1 + noise)) : 0);
        }
      const ErrorContext by_photons{.alpha = kAlpha, .movement = &movement, .measured = &measured};
      EXPECT_GE(error_interval(halves_of(image), by_photons).upper, truth / 3);
    }
    movement.add(shown.blocks, kAlpha);
  }
}

// Claim: the figures do not change if the image is a hundred times as bright; a black image has none, and
// neither has an image of one half.
TEST(ErrorInterval, KnowsItsLimits) {
  HalfImages image = render(1, 8);
  const ErrorInterval shown = error_interval(halves_of(image));
  EXPECT_EQ(shown.blur, 0);
  EXPECT_NEAR(shown.relmse + shown.unseen, shown.noise * 1.5, 1e-12);
  for (std::vector<float>* half : {&image.a, &image.b})
    for (float& value : *half) value *= 128;
  EXPECT_NEAR(error_interval(halves_of(image)).upper / shown.upper, 1, 1e-6);
  EXPECT_NEAR(error_interval(halves_of(image)).rmse / shown.rmse, 128, 1e-3);
  image.n1 = 0;
  EXPECT_TRUE(std::isnan(error_interval(halves_of(image)).relmse));
  EXPECT_TRUE(std::isnan(error_interval(halves_of(image)).upper));
  image.n1 = 4;
  std::fill(image.a.begin(), image.a.end(), 0.0F);
  std::fill(image.b.begin(), image.b.end(), 0.0F);
  EXPECT_EQ(error_interval(halves_of(image)).relmse, 0);
  EXPECT_EQ(error_interval(halves_of(image)).upper, 0);
}

// Claim: images of one pixel, one row, and more than kMaxBlocks a side have figures; of a large image the
// noise is that of its parts.
TEST(ErrorInterval, AnySize) {
  for (const auto& [width, height] :
       {std::pair(1U, 1U), std::pair(37U, 1U), std::pair(1U, 5U), std::pair(600U, 3U)}) {
    HalfImages image;
    image.width = width;
    image.height = height;
    image.n0 = image.n1 = 1;
    rng::Stream stream(rng::key(width, height, 0));
    for (std::size_t i = 0; i < std::size_t{width} * height * 3; ++i) {
      image.a.push_back(0.9F + 0.2F * stream.next_float());
      image.b.push_back(0.9F + 0.2F * stream.next_float());
    }
    const ErrorInterval shown = error_interval(halves_of(image));
    EXPECT_GT(shown.upper, shown.relmse);
    EXPECT_GT(shown.relmse, 0);
    EXPECT_LE(shown.blocks.width, kMaxBlocks);
    EXPECT_EQ(shown.blocks.a.size(), std::size_t{shown.blocks.width} * shown.blocks.height * 3);
    if (width == 600) {
      EXPECT_NEAR(shown.noise, 0.04 / 12 / 2, 0.0002);
    }
  }
}

BlockMeans blocks(double n, float a) {
  BlockMeans means;
  means.width = 2;
  means.height = 1;
  means.n0 = means.n1 = n / 2;
  means.a.assign(6, a);
  means.b.assign(6, 2 * a);
  return means;
}

// Claim: groups are doublings; of means that are 1 + c i^(alpha - 1) the bias is found to 1 % by half; what
// does not move has none; a group alone tells nothing; images of another size begin anew.
TEST(Movement, FindsTheBias) {
  constexpr double kAlpha = 0.75, kSlope = 0.3;
  Movement movement;
  double sum = 0;
  for (int n = 1; n <= 300; ++n) {
    sum += 1 + kSlope * std::pow(n, kAlpha - 1);
    if (n % 2 != 0) continue;
    const BlockMeans now = blocks(n, static_cast<float>(sum / n));
    if (n == 2) {
      EXPECT_TRUE(movement.bias(now, kAlpha).a.empty());
    }
    EXPECT_EQ(movement.due(n / 2, n / 2), (n & (n - 1)) == 0) << n;
    movement.add(now, kAlpha);
    if (n < 64) continue;
    const Movement::Bias bias = movement.bias(now, kAlpha);
    ASSERT_EQ(bias.a.size(), 6U);
    EXPECT_NEAR(bias.a[0] / (sum / n - 1), 1, 0.03) << n;
    EXPECT_NEAR(bias.b[5] / bias.a[5], 2, 1e-4);
  }
  BlockMeans other = blocks(1000, 1);
  other.side = 2;
  EXPECT_TRUE(movement.bias(other, kAlpha).a.empty());
  movement.add(other, kAlpha);
  EXPECT_FALSE(movement.due(500, 500));
  EXPECT_TRUE(movement.due(1000, 1000));
}

constexpr film::Layout kWide{300, 5, 2};  // blocks of 2 x 2 pixels, cut at the lower border
constexpr int kScaleLog2 = 20;
constexpr double kFalls = 0.75;

// A delta of iterations whose pixels are 1 + i^(kFalls - 1), alike in both halves, and others in another
// layer.
film::Delta delta_of(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  film::UnitFilm film(kWide, kScaleLog2);
  film::SampleCounts sample_counts;
  for (std::uint64_t i = begin; i < end; ++i)
    for (std::uint32_t layer = 0; layer < 2; ++layer)
      for (std::uint32_t y = 0; y < kWide.height; ++y)
        for (std::uint32_t x = 0; x < kWide.width; ++x) {
          const auto value =
              static_cast<float>(1 + layer + std::pow(2 * static_cast<double>(i) + 1.5, kFalls - 1));
          film.splat(layer, x, y, {value, 2 * value, value * static_cast<float>(1 + x / 2)},
                     rng::key(i, half, x), sample_counts);
        }
  film.count(sample_counts);
  auto delta = film::Delta::decode(
      film::encode_delta(film, {{Unit::Kind::iterations, half, begin, end}, kWide, kScaleLog2, "j", "b"}),
      kWide);
  EXPECT_TRUE(delta.ok());
  return std::move(*delta);
}

struct Summed {
  film::MergedFilm film{kWide, kScaleLog2};
  MovementSums sums{kWide, kFalls};
  void add(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
    film::SparseSums::TileBuffers buffers(film::kChannels);
    const film::Delta delta = delta_of(half, begin, end);
    ASSERT_TRUE(film.merge(delta).ok());
    sums.add(delta, buffers);
  }
  Movement::Bias bias() const {
    const film::Development as_it_is;
    const BlockMeans blocks = error_interval(halves_of(film, as_it_is)).blocks;
    return sums.movement(film).bias(blocks, kFalls);
  }
};

// Claim: the movement is a function of the merged indices: the same bits in any order, by any units within
// the groups, in parts that are added, and from storage; the bias is found to 10 % after 11 iterations; what
// is damaged or of another job is refused.
TEST(Movement, IsAFunctionOfTheMergedIndices) {
  Summed forward, backward, part;
  for (const std::uint32_t half : {0, 1}) {
    for (const auto& [begin, end] : {std::pair(0, 2), std::pair(2, 4), std::pair(4, 8), std::pair(8, 11)})
      forward.add(half, begin, end);
    for (const auto& [begin, end] : {std::pair(9, 11), std::pair(0, 1), std::pair(5, 8)})
      backward.add(half, begin, end);
    for (const auto& [begin, end] : {std::pair(2, 4), std::pair(1, 2), std::pair(8, 9), std::pair(4, 5)})
      part.add(half, begin, end);
  }
  ASSERT_TRUE(backward.film.merge(part.film).ok());
  backward.sums.add(part.sums);
  EXPECT_EQ(backward.sums.serialise(), forward.sums.serialise());
  const Movement::Bias bias = forward.bias();
  EXPECT_EQ(backward.bias().a, bias.a);
  EXPECT_EQ(backward.bias().b, bias.b);
  ASSERT_EQ(bias.a.size(), 150U * 3 * 3);
  double fallen = 0;
  for (int i = 0; i < 11; ++i) fallen += std::pow(2 * i + 1.5, kFalls - 1) / 11;
  EXPECT_NEAR(bias.a[0] / fallen, 1, 0.1);
  EXPECT_NEAR(bias.b[4] / fallen, 2, 0.2);
  EXPECT_NEAR(bias.a.back() / bias.a[0], 150, 1e-2) << "a cut block is divided by its pixels";

  MovementSums read(kWide, kFalls);
  const std::string bytes = forward.sums.serialise();
  ASSERT_TRUE(read.parse(bytes).ok());
  EXPECT_EQ(read.serialise(), bytes);
  const Result<bool> other_alpha = MovementSums(kWide, 0.7).parse(bytes);
  EXPECT_TRUE(other_alpha.ok() && !*other_alpha);
  for (const std::size_t length : {std::size_t{0}, std::size_t{9}, bytes.size() - 1})
    EXPECT_FALSE(read.parse(bytes.substr(0, length)).ok());
  std::string changed = bytes;
  changed[40] ^= 1;
  EXPECT_FALSE(read.parse(changed).ok());
  EXPECT_EQ(read.serialise(), bytes) << "what is refused changes nothing";
}

// Claim: sums of a film that was merged without them are those of one group; more is added as to others. A
// job whose image does not move has none.
TEST(Movement, AdoptsAFilm) {
  Summed summed;
  for (const std::uint32_t half : {0, 1}) summed.add(half, 0, 2);
  MovementSums adopted(kWide, kFalls);
  EXPECT_FALSE(adopted.fits(summed.film));
  adopted.adopt(summed.film);
  EXPECT_EQ(adopted.serialise(), summed.sums.serialise());
  for (const std::uint32_t half : {0, 1}) summed.add(half, 2, 4);
  EXPECT_FALSE(adopted.fits(summed.film));
  EXPECT_TRUE(adopted.movement(summed.film).bias({}, kFalls).a.empty());
  MovementSums none;
  none.adopt(summed.film);
  EXPECT_FALSE(none.needed());
  EXPECT_TRUE(none.fits(summed.film));
}

// Claim: what merges, and how its bias falls, follows from settings and plan.
TEST(ErrorContext, FollowsSettingsAndPlan) {
  EXPECT_EQ(context_of({{"max_depth", "5"}}, "use  connections: x\n").alpha, 1);
  EXPECT_EQ(
      context_of({{"radius", "0"}, {"alpha", "0.75"}}, "use  connections: x\nskip merging on surfaces: y\n")
          .alpha,
      1);
  const ErrorContext vcm =
      context_of({{"radius", "0"}, {"alpha", "0.8"}}, "use  connections: x\nuse  merging on surfaces: y\n");
  EXPECT_EQ(vcm.alpha, 0.8);
  EXPECT_TRUE(vcm.connects);
  const SettingsMap kept{{"radius", "0"}, {"alpha_f", "0.05"}};
  EXPECT_GT(context_of(kept, "use  connections: x\nuse  merging on surfaces: y\n").expected_bias,
            vcm.expected_bias);
  const ErrorContext ppm = context_of({{"radius", "0"}, {"alpha", "0.5"}}, "use  photons on surfaces: x\n");
  EXPECT_EQ(ppm.alpha, 0.75);
  EXPECT_FALSE(ppm.connects);
  const auto expected_of = [](const char* setting) {
    return context_of({{"radius", "0"}, {setting, "1"}}, "use  photons on surfaces: x\n").expected_bias;
  };
  // More of photons alone; of those less if radii balance bias and noise, more if they stay.
  EXPECT_GT(ppm.expected_bias, vcm.expected_bias);
  EXPECT_LT(expected_of("r_max"), ppm.expected_bias);
  EXPECT_GT(expected_of("alpha_f"), ppm.expected_bias);
  EXPECT_GT(expected_of("alpha_chi"), ppm.expected_bias);
  EXPECT_NEAR(context_of({{"radius", "0"}}, "use  photons on surfaces: x\n").alpha, 5.0 / 6, 1e-12);
}

}  // namespace
}  // namespace candela::stats
