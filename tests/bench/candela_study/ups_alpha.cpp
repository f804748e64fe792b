// Error of ppm and vcm against alpha and iterations: Fig. 1 of Hachisuka et al.'s supplement (2012), and the
// rates of variance and bias of Eq. 46.
//
// Part "toy": the pixel whose errors are known (toy.h), exact and simulated. Part "scene": a torus in glass.
// All figures of the scene are relative to the mean of the reference, over all pixels and channels. With
// images I_s of S seeds and two independent references R1, R2 of path:
//   squared error   mean of (I_s - R1)(I_s - R2), so that no noise of a reference is left in it
//   variance        of one image, from the spread over seeds
//   squared bias    mean of (I_s - R1)(I_t - R2) over all pairs of seeds s, t
//   bias            amplitude of (I_s - R1) along the pattern P of the bias of the first radius, over that of
//                   P itself: P is the image at constant radius (alpha = 1) less R2, normalized by a second,
//                   independent image less R1. Its theory is bias_factor().
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tests/bench/candela_bench/estimator.h"
#include "tests/bench/candela_study/study.h"
#include "tests/bench/candela_study/toy.h"
#include "tests/statistical/moments.h"

namespace candela::study {
namespace {

using statistical::Moments;
using statistical::moments_of;

const std::vector<double> kRateAlphas = {0.5, 2.0 / 3, 0.75, 0.9};
const std::vector<double> kAlphas = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2.0 / 3, 0.7, 0.75, 0.8, 0.9};
// Fraction of the scene's bounding radius. Bias and noise of the torus are alike there within some hundred
// iterations.
constexpr const char* kFirstRadius = "0.03";
constexpr std::uint64_t kReferenceSeed = 4242, kPatternSeed = 1000001;

class Rows {
 public:
  explicit Rows(std::string part) : part_(std::move(part)) {}
  void add(const std::string& problem, const std::string& method, double alpha, double n,
           const std::string& quantity, double value, double standard_error = 0) {
    rows_.push_back({part_, problem, method, alpha, n, quantity, value, standard_error});
  }
  void add(const std::string& problem, const std::string& method, double alpha, double n,
           const std::string& quantity, const Moments& seeds) {
    add(problem, method, alpha, n, quantity, seeds.mean(), seeds.count() < 2 ? kNone : seeds.error());
  }
  std::vector<Row> take() { return std::move(rows_); }

 private:
  std::string part_;
  std::vector<Row> rows_;
};

// ---- toy
// -----------------------------------------------------------------------------------------------------

void run_toy(const Request& request, Rows& rows) {
  std::vector<std::uint64_t> counts;
  for (std::uint64_t n = 1; n <= (std::uint64_t{1} << (request.short_form ? 14 : 20)); n *= 4)
    counts.push_back(n);
  counts.push_back(8192);  // the count of the known table
  std::sort(counts.begin(), counts.end());
  for (const ToyField& field : toy_fields())
    for (const double alpha : kAlphas) {
      const auto errors = toy_exact(field, alpha, counts);
      for (std::size_t k = 0; k < counts.size(); ++k) {
        const auto n = static_cast<double>(counts[k]);
        rows.add(field.name, "exact", alpha, n, "bias", errors[k].bias);
        rows.add(field.name, "exact", alpha, n, "variance", errors[k].variance);
        rows.add(field.name, "exact", alpha, n, "squared error", errors[k].mse());
      }
    }
  for (const double alpha : kRateAlphas)
    for (const std::uint64_t count : counts) {
      const auto n = static_cast<double>(count);
      if (n > 1e5) break;  // lgamma's difference loses digits beyond
      rows.add("", "closed form", alpha, n, "variance factor", variance_factor(alpha, n));
      rows.add("", "closed form", alpha, n, "bias factor", bias_factor(alpha, n));
    }

  const std::vector<std::uint64_t> simulated =
      request.short_form ? std::vector<std::uint64_t>{1, 4, 16} : std::vector<std::uint64_t>{1, 16, 256};
  const std::uint64_t pixels = request.short_form ? 500 : 4000;
  for (const ToyField& field : toy_fields())
    for (const double alpha : kRateAlphas) {
      std::vector<std::vector<double>> means(simulated.size());
      for (std::uint64_t seed = 1; seed <= pixels; ++seed) {
        const auto found = toy_simulated(field, alpha, simulated, seed);
        for (std::size_t k = 0; k < simulated.size(); ++k) means[k].push_back(found[k] - field.truth);
      }
      for (std::size_t k = 0; k < simulated.size(); ++k) {
        const auto n = static_cast<double>(simulated[k]);
        const Moments errors = moments_of(means[k]);
        rows.add(field.name, "simulated", alpha, n, "bias", errors);
        std::vector<double> squares;
        for (const double e : means[k]) squares.push_back((e - errors.mean()) * (e - errors.mean()));
        const Moments spread = moments_of(squares);
        rows.add(field.name, "simulated", alpha, n, "variance", errors.variance(), spread.error());
      }
    }
}

// ---- scene
// ---------------------------------------------------------------------------------------------------

using Image = std::vector<float>;

struct Size {
  std::uint32_t width, height;
};

// Images of one render after so many iterations; `counts` ascend.
Result<std::vector<Image>> render(const Request& request, Size size, const std::string& integrator,
                                  const SettingsMap& settings, std::uint64_t seed, const std::string& sampler,
                                  const std::vector<std::uint64_t>& counts) {
  CANDELA_ASSIGN(bench::RunSpec run, bench::make_run(CANDELA_SOURCE_DIR "/tests/bench/torus/torus.xml",
                                                     "torus", integrator, settings, size.width, size.height));
  run.job.seed = seed;
  run.job.sampler = sampler;
  run.threads = request.threads;
  CANDELA_ASSIGN(const auto estimator, bench::make_render_estimator(run));
  std::vector<Image> images;
  for (const std::uint64_t count : counts) {
    CANDELA_TRY(estimator->advance(count));
    CANDELA_ASSIGN(bench::Snapshot snapshot, estimator->snapshot());
    images.push_back(std::move(snapshot.image));
  }
  return images;
}

// Mean over values of (a - b)(c - d).
double product(const Image& a, const Image& b, const Image& c, const Image& d) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += (static_cast<double>(a[i]) - static_cast<double>(b[i])) *
           (static_cast<double>(c[i]) - static_cast<double>(d[i]));
  return sum / static_cast<double>(a.size());
}

Image mean_image(const std::vector<Image>& images, std::size_t begin, std::size_t end) {
  std::vector<double> sum(images[begin].size());
  for (std::size_t k = begin; k < end; ++k)
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<double>(images[k][i]);
  Image mean;
  for (const double value : sum) mean.push_back(static_cast<float>(value / static_cast<double>(end - begin)));
  return mean;
}

// Independent references, and their mean.
struct Truth {
  Image first, second;
  double mean = 0;
};

// The bias of the first radius: a picture, and the product that an amplitude of 1 has.
struct Pattern {
  Image at_first_radius;  // less the second reference it is the pattern
  double square = 0;
};

// What the seeds' images after one count of iterations say.
struct Found {
  Moments squared_error, variance, squared_bias, amplitude;
};

Found compare(const std::vector<Image>& images, const Truth& truth, const Pattern& pattern) {
  const double unit = truth.mean * truth.mean;
  const auto seeds = static_cast<double>(images.size());
  const Image mean = mean_image(images, 0, images.size());
  Found found;
  for (const Image& image : images) {
    const double squared_error = product(image, truth.first, image, truth.second);
    found.squared_error.add(squared_error / unit);
    found.amplitude.add(product(image, truth.first, pattern.at_first_radius, truth.second) / pattern.square);
    if (seeds < 2) continue;
    found.variance.add(product(image, mean, image, mean) / unit * seeds / (seeds - 1));
    // Of this image with all others: seeds * (mean - R2) is the sum of all.
    const double with_all = seeds * product(image, truth.first, mean, truth.second);
    found.squared_bias.add((with_all - squared_error) / (seeds - 1) / unit);
  }
  return found;
}

// The slope of log(value) over log(n) between two counts, and its standard error as of independent values.
void add_slope(Rows& rows, const std::string& integrator, double alpha, const std::string& quantity,
               const Moments& first, const Moments& last, double from, double to) {
  if (!(first.mean() > 0) || !(last.mean() > 0)) return;
  const double doublings = std::log(to / from);
  const double error = std::hypot(first.error() / first.mean(), last.error() / last.mean()) / doublings;
  rows.add("torus", integrator, alpha, to, "slope of " + quantity,
           std::log(last.mean() / first.mean()) / doublings, error);
}

Result<void> run_scene(const Request& request, Rows& rows) {
  const Size size = request.short_form ? Size{16, 16} : Size{48, 48};
  const std::vector<std::uint64_t> counts = request.short_form
                                                ? std::vector<std::uint64_t>{4, 16}
                                                : std::vector<std::uint64_t>{4, 16, 64, 256, 1024};
  const std::vector<double>& alphas = request.short_form ? kRateAlphas : kAlphas;
  const std::vector<std::uint64_t> reference_count = {request.short_form ? std::uint64_t{1024} : 65536};

  Truth truth;
  for (Image* reference : {&truth.first, &truth.second}) {
    const std::uint64_t seed = kReferenceSeed + (reference == &truth.second ? 1 : 0);
    CANDELA_ASSIGN(auto images, render(request, size, "path", {}, seed, "sobol", reference_count));
    *reference = std::move(images[0]);
    request.say(fmt::format("ups-alpha: reference {} of 2", reference == &truth.first ? 1 : 2));
  }
  for (const Image* reference : {&truth.first, &truth.second})
    for (const float value : *reference)
      truth.mean += static_cast<double>(value) / (2 * static_cast<double>(reference->size()));
  const double unit = truth.mean * truth.mean;
  rows.add("torus", "path", kNone, static_cast<double>(reference_count[0]), "variance",
           product(truth.first, truth.second, truth.first, truth.second) / 2 / unit, kNone);

  for (const std::string integrator : {"ppm", "vcm"}) {
    const auto settings = [](double alpha) {
      return SettingsMap{{"alpha", fmt::format("{:.9g}", alpha)}, {"radius", kFirstRadius}};
    };
    std::vector<Image> constant;
    const std::uint64_t halves = std::max<std::uint64_t>(2, request.seeds);
    for (std::uint64_t seed = 0; seed < halves; ++seed) {
      CANDELA_ASSIGN(auto images, render(request, size, integrator, settings(1), kPatternSeed + seed,
                                         "independent", {counts.back()}));
      constant.push_back(std::move(images[0]));
    }
    Pattern pattern{mean_image(constant, 0, halves / 2), 0};
    const Image other = mean_image(constant, halves / 2, halves);
    pattern.square = product(other, truth.first, pattern.at_first_radius, truth.second);
    rows.add("torus", integrator, 1, static_cast<double>(counts.back()), "squared bias",
             pattern.square / unit, kNone);

    for (const double alpha : alphas) {
      std::vector<std::vector<Image>> images(counts.size());  // [count][seed]
      for (std::uint64_t seed = 1; seed <= request.seeds; ++seed) {
        CANDELA_ASSIGN(auto found,
                       render(request, size, integrator, settings(alpha), seed, "independent", counts));
        for (std::size_t k = 0; k < counts.size(); ++k) images[k].push_back(std::move(found[k]));
      }
      std::vector<Found> found;
      for (std::size_t k = 0; k < counts.size(); ++k) {
        const auto n = static_cast<double>(counts[k]);
        found.push_back(compare(images[k], truth, pattern));
        rows.add("torus", integrator, alpha, n, "squared error", found[k].squared_error);
        // Of two seeds both have the same deviation from their mean: that says nothing of its error.
        if (request.seeds > 1)
          rows.add("torus", integrator, alpha, n, "variance", found[k].variance.mean(),
                   request.seeds > 2 ? found[k].variance.error() : kNone);
        if (request.seeds > 1) rows.add("torus", integrator, alpha, n, "squared bias", found[k].squared_bias);
        rows.add("torus", integrator, alpha, n, "bias", found[k].amplitude);
        if (integrator == "ppm") rows.add("torus", "theory", alpha, n, "bias", bias_factor(alpha, n));
      }
      // Slopes over the last two quadruplings, and what the exact sums have there.
      const std::size_t last = counts.size() - 1, first = last >= 2 ? last - 2 : 0;
      const auto from = static_cast<double>(counts[first]), to = static_cast<double>(counts[last]);
      add_slope(rows, integrator, alpha, "variance", found[first].variance, found[last].variance, from, to);
      add_slope(rows, integrator, alpha, "bias", found[first].amplitude, found[last].amplitude, from, to);
      request.say(fmt::format("ups-alpha: {} alpha {:.3f}", integrator, alpha));
      if (integrator != "ppm") continue;
      const double doublings = std::log(to / from);
      rows.add("torus", "theory", alpha, to, "slope of variance",
               std::log(variance_factor(alpha, to) / variance_factor(alpha, from)) / doublings);
      rows.add("torus", "theory", alpha, to, "slope of bias",
               std::log(bias_factor(alpha, to) / bias_factor(alpha, from)) / doublings);
    }
  }
  return {};
}

}  // namespace

Result<std::vector<Row>> run_ups_alpha(const Request& request) {
  Rows toy("toy"), scene("scene");
  run_toy(request, toy);
  CANDELA_TRY(run_scene(request, scene));
  std::vector<Row> rows = toy.take();
  for (Row& row : scene.take()) rows.push_back(std::move(row));
  return rows;
}

}  // namespace candela::study
