// Error of ppm and vcm against alpha and iterations: Fig. 1 of Hachisuka et al.'s supplement (2012), and the
// rates of variance and bias of Eq. 46.
//
// Part "toy": the pixel whose errors are known (toy.h), exact and simulated. Part "scene": a torus in glass,
// whose errors are those of image_errors.h against two references of path. The pattern of the bias is that of
// constant radii (alpha = 1), so that the theory of the amplitude is bias_factor().
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"
#include "tests/bench/candela_study/toy.h"
#include "tests/statistical/moments.h"

namespace candela::study {
namespace {

using statistical::Moments;
using statistical::moments_of;

const std::vector<double> kRateAlphas = {0.5, 2.0 / 3, 0.75, 0.9};
const std::vector<double> kAlphas = {0.3, 0.5, 0.6, 2.0 / 3, 0.7, 0.75, 0.8, 0.9};
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

// ---- toy ----

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

// ---- scene ----

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
  const std::uint32_t side = request.short_form ? 16 : 48;
  const std::vector<std::uint64_t> counts = request.short_form
                                                ? std::vector<std::uint64_t>{4, 16}
                                                : std::vector<std::uint64_t>{4, 16, 64, 256, 1024};
  const std::vector<double>& alphas = request.short_form ? kRateAlphas : kAlphas;
  const auto render = [&](const std::string& integrator, double alpha, std::uint64_t seed) {
    return Render{.scene = "tests/bench/torus/torus.xml",
                  .width = side,
                  .height = side,
                  .integrator = integrator,
                  .settings = {{"alpha", fmt::format("{:.9g}", alpha)}, {"radius", kFirstRadius}},
                  .seed = seed,
                  .threads = request.threads};
  };

  const std::uint64_t reference_count = request.short_form ? 1024 : 16384;
  std::vector<Image> references;
  for (const std::uint64_t seed : {kReferenceSeed, kReferenceSeed + 1}) {
    Render reference = render("path", 1, seed);
    reference.settings = {};
    reference.sampler = "sobol";
    CANDELA_ASSIGN(auto images, render_images(reference, {reference_count}));
    references.push_back(std::move(images[0]));
    request.say(fmt::format("ups-alpha: reference {} of 2", references.size()));
  }
  const Truth truth(references[0], references[1]);
  rows.add("torus", "path", kNone, static_cast<double>(reference_count), "variance", truth.variance, kNone);

  for (const std::string integrator : {"ppm", "vcm"}) {
    std::vector<Image> constant;
    const std::uint64_t halves = std::max<std::uint64_t>(2, request.seeds);
    for (std::uint64_t seed = 0; seed < halves; ++seed) {
      CANDELA_ASSIGN(auto images, render_images(render(integrator, 1, kPatternSeed + seed), {counts.back()}));
      constant.push_back(std::move(images[0]));
    }
    const Pattern pattern(truth, mean_image(constant, 0, halves / 2),
                          mean_image(constant, halves / 2, halves));
    rows.add("torus", integrator, 1, static_cast<double>(counts.back()), "squared bias", pattern.square,
             kNone);

    for (const double alpha : alphas) {
      std::vector<std::vector<Image>> images(counts.size());  // [count][seed]
      for (std::uint64_t seed = 1; seed <= request.seeds; ++seed) {
        CANDELA_ASSIGN(auto found, render_images(render(integrator, alpha, seed), counts));
        for (std::size_t k = 0; k < counts.size(); ++k) images[k].push_back(std::move(found[k]));
      }
      std::vector<ImageErrors> found;
      for (std::size_t k = 0; k < counts.size(); ++k) {
        const auto n = static_cast<double>(counts[k]);
        found.push_back(errors_of(images[k], truth, pattern));
        rows.add("torus", integrator, alpha, n, "squared error", found[k].squared_error);
        // With two seeds both have the same deviation from their mean: that says nothing of its error.
        if (request.seeds > 1)
          rows.add("torus", integrator, alpha, n, "variance", found[k].variance.mean(),
                   request.seeds > 2 ? found[k].variance.error() : kNone);
        if (request.seeds > 1)
          rows.add("torus", integrator, alpha, n, "squared bias", found[k].squared_bias.mean(),
                   request.seeds > 2 ? found[k].squared_bias.error() : kNone);
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

Result<Results> run_ups_alpha(const Request& request) {
  Rows toy("toy"), scene("scene");
  run_toy(request, toy);
  CANDELA_TRY(run_scene(request, scene));
  Results results{toy.take(), {}};
  for (Row& row : scene.take()) results.rows.push_back(std::move(row));
  return results;
}

}  // namespace candela::study
