// Measures the value of weights in pictures: the error of direct light by path, and by optimis with every
// heuristic and with optimal weights, after equal numbers of iterations and in equal CPU time.
//
// An iteration is one sample of every technique. Contestants render in turn, a block of iterations each, so
// that a slow moment of the machine hits all of them. Images of 16, 64 and 256 iterations are made of the
// blocks' sums. Squared errors are relative to the squared mean of the picture, against two references of
// path (image_errors.h). "over balance" are ratios to the balance heuristic with the same techniques: equal
// samples, CPU seconds of rendering and reading the image, and both together: squared error in equal time.
// Optimal weights and the balance heuristic of one job share all samples, which takes most of the noise out
// of the ratio of their errors.
//
// Maps: alpha of each technique (green) from all samples, and the gain: variance by the balance heuristic
// over that by crossfit after 64 iterations, each the mean over a pixel and those around it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/mis_job.h"
#include "tests/bench/candela_study/study.h"
#include "tests/statistical/moments.h"

namespace candela::study {
namespace {

using statistical::Moments;

// Techniques of optimis that are combined.
struct TechniqueSet {
  const char* name;
  SettingsMap settings;
};
const TechniqueSet kDefaults = {"defaults", {}};
const TechniqueSet kChoices = {"choices of lights",
                               {{"techniques", "light"}, {"selection", "contribution,power,uniform"}}};
const TechniqueSet kPoints = {"spherical+parallel", {{"techniques", "spherical,parallel"}}};

struct Scene {
  const char* name;
  const char* file;
  std::vector<TechniqueSet> sets;
};
const Scene kScenes[] = {
    {"parallel", "tests/bench/candela_study/scenes/mis-parallel.xml", {kDefaults, kPoints}},
    {"tilted", "tests/bench/candela_study/scenes/mis-tilted.xml", {kDefaults, kPoints}},
    {"near", "tests/bench/candela_study/scenes/mis-near.xml", {kDefaults, kPoints}},
    {"horizon", "tests/bench/candela_study/scenes/mis-horizon.xml", {kDefaults, kPoints}},
    {"hidden", "tests/bench/candela_study/scenes/mis-hidden.xml", {kDefaults, kChoices}},
    {"textured", "tests/bench/candela_study/scenes/mis-textured.xml", {kDefaults, kPoints}},
    {"sky", "tests/statistical/transport/envmap.xml", {kDefaults}},
};

constexpr std::uint64_t kBlock = 16;  // iterations
constexpr std::uint64_t kMapCount = 64;
constexpr std::uint64_t kReferenceSeed = 770001;

// ---- contestants

// Images that are read from one job, in the order of `estimators`.
struct Contestant {
  std::string name;  // of the only image, or of the job
  std::string integrator;
  SettingsMap settings;
  std::string sampler = "independent";
  std::vector<std::string> estimators = {""};
};

std::vector<Contestant> contestants(const TechniqueSet& set) {
  std::vector<Contestant> out;
  const auto optimis = [&](const std::string& weights) {
    SettingsMap settings = set.settings;
    settings["weights"] = weights;
    settings["depth"] = "direct";
    return settings;
  };
  out.push_back({"balance", "optimis", optimis("balance")});
  out.push_back({"optimal", "optimis", optimis("optimal"), "independent", {"crossfit", "direct", "balance"}});
  out.push_back({"auto", "optimis", optimis("auto"), "independent", {"crossfit", "balance"}});
  for (const char* weights : {"power", "cutoff", "maximum"})
    out.push_back({weights, "optimis", optimis(weights)});
  out.push_back({"path", "path", {}});
  if (set.settings.empty()) {  // as users get them
    out.push_back({"path, sobol", "path", {}, "sobol"});
    out.push_back({"optimal, sobol", "optimis", optimis("optimal"), "sobol", {"crossfit"}});
  }
  return out;
}

// Errors of the images of a contestant after so many iterations, one after another.
struct Level {
  std::uint64_t count;
  MisJob::Merged merged;
  std::vector<std::vector<double>> squared;  // [estimator][image]
  double read_seconds = 0;                   // by the first estimator, over all images
};

double squared_error(const Image& image, const Truth& truth) {
  double sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i)
    sum += (static_cast<double>(image[i]) - static_cast<double>(truth.first[i])) *
           (static_cast<double>(image[i]) - static_cast<double>(truth.second[i]));
  return sum / static_cast<double>(image.size()) / (truth.mean * truth.mean);
}

// Variances of the pixels' green over images.
class PixelMoments {
 public:
  void add(const Image& image) {
    pixels_.resize(image.size() / 3);
    for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[i].add(static_cast<double>(image[3 * i + 1]));
  }
  // Means over each pixel and those around it.
  std::vector<double> variances(std::uint32_t side) const {
    std::vector<double> out;
    for (int y = 0; y < static_cast<int>(side); ++y)
      for (int x = 0; x < static_cast<int>(side); ++x) {
        double sum = 0;
        int count = 0;
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, static_cast<int>(side) - 1); ++v)
          for (int u = std::max(x - 1, 0); u <= std::min(x + 1, static_cast<int>(side) - 1); ++u, ++count)
            sum += pixels_[static_cast<std::size_t>(v) * side + static_cast<std::size_t>(u)].variance();
        out.push_back(sum / count);
      }
    return out;
  }

 private:
  std::vector<Moments> pixels_;
};

class Runner {
 public:
  Runner(Contestant contestant, MisJob job) : contestant_(std::move(contestant)), job_(std::move(job)) {
    // A job without a development has one estimator, its film.
    if (!job_.work().development) contestant_.estimators = {""};
  }
  static Result<Runner> create(Contestant contestant, const Render& base) {
    Render render = base;
    render.integrator = contestant.integrator;
    for (const auto& [name, value] : contestant.settings) render.settings[name] = value;
    render.sampler = contestant.sampler;
    CANDELA_ASSIGN(MisJob job, MisJob::create(render));
    return Runner(std::move(contestant), std::move(job));
  }

  const Contestant& contestant() const { return contestant_; }
  const MisJob& job() const { return job_; }

  void start(std::span<const std::uint64_t> counts) {
    whole_.emplace(job_.empty());
    for (const std::uint64_t count : counts) {
      levels_.push_back(Level{count, job_.empty(), {}, 0});
      levels_.back().squared.resize(contestant_.estimators.size());
    }
    moments_.resize(contestant_.estimators.size());
  }
  // Renders block number `block`, and measures the images that are complete with it.
  Result<void> advance(std::uint64_t block, const Truth& truth) {
    std::vector<MisJob::Merged*> into = {&*whole_};
    for (Level& level : levels_) into.push_back(&level.merged);
    constexpr std::uint64_t kHalf = kBlock / 2;
    CANDELA_ASSIGN(const double seconds, job_.render(block * kHalf, (block + 1) * kHalf, into));
    seconds_.push_back(seconds);
    for (Level& level : levels_) {
      if ((block + 1) * kBlock % level.count != 0) continue;
      for (std::size_t e = 0; e < contestant_.estimators.size(); ++e) {
        CANDELA_ASSIGN(const Image image, job_.image(level.merged, contestant_.estimators[e],
                                                     e == 0 ? &level.read_seconds : nullptr));
        level.squared[e].push_back(squared_error(image, truth));
        if (level.count == kMapCount) moments_[e].add(image);
      }
      level.merged = job_.empty();
    }
    return {};
  }

  const std::vector<Level>& levels() const { return levels_; }
  const std::vector<double>& seconds() const { return seconds_; }  // of each block
  const PixelMoments& moments(std::size_t estimator) const { return moments_[estimator]; }
  std::vector<std::vector<float>> slopes() const { return job_.slopes(*whole_); }

 private:
  Contestant contestant_;
  MisJob job_;
  std::optional<MisJob::Merged> whole_;
  std::vector<Level> levels_;
  std::vector<double> seconds_;
  std::vector<PixelMoments> moments_;
};

// ---- ratios

struct Ratio {
  double value = kNone, error = kNone;
};

// Mean of a over mean of b, and its standard error by the jackknife over pairs.
Ratio ratio_of(const std::vector<double>& a, const std::vector<double>& b) {
  const double sum_a = std::accumulate(a.begin(), a.end(), 0.0);
  const double sum_b = std::accumulate(b.begin(), b.end(), 0.0);
  Ratio ratio{sum_a / sum_b, kNone};
  if (a.size() < 3) return ratio;
  std::vector<double> without;
  for (std::size_t k = 0; k < a.size(); ++k) without.push_back((sum_a - a[k]) / (sum_b - b[k]));
  const Moments spread = statistical::moments_of(without);
  const auto n = static_cast<double>(a.size());
  ratio.error = std::sqrt(spread.variance()) * (n - 1) / std::sqrt(n);
  return ratio;
}
Ratio product(const Ratio& a, const Ratio& b) {
  const double value = a.value * b.value;
  return {value, std::abs(value) * std::hypot(a.error / a.value, b.error / b.value)};
}
// The ratio of two means of independent samples.
Ratio ratio_of_independent(const std::vector<double>& a, const std::vector<double>& b) {
  const Moments above = statistical::moments_of(a), below = statistical::moments_of(b);
  const double value = above.mean() / below.mean();
  return {value, a.size() < 2 ? kNone
                              : std::abs(value) *
                                    std::hypot(above.error() / above.mean(), below.error() / below.mean())};
}
// The median ratio of the seconds of blocks that were rendered next to each other. A short load of the
// machine does not move the median.
Ratio ratio_of_seconds(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> ratios;
  for (std::size_t k = 0; k < a.size(); ++k) ratios.push_back(a[k] / b[k]);
  std::sort(ratios.begin(), ratios.end());
  const std::size_t n = ratios.size();
  const double spread = ratios[3 * n / 4] - ratios[n / 4];
  // The error of a median of normal values is 1.25 s / sqrt(n), with s = the quartiles' distance / 1.35.
  return {ratios[n / 2], 1.25 * spread / 1.35 / std::sqrt(static_cast<double>(n))};
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// ---- rows

class Report {
 public:
  Report(std::string set, std::string scene, Results& results)
      : set_(std::move(set)), scene_(std::move(scene)), results_(results) {}
  void add(const std::string& method, double n, const std::string& quantity, const Ratio& value) {
    results_.rows.push_back({set_, scene_, method, kNone, n, quantity, value.value, value.error});
  }
  void map(const std::string& what, std::uint32_t side, std::vector<float> values) {
    results_.maps.push_back({set_ + ", " + scene_ + ", " + what, side, side, std::move(values)});
  }

 private:
  std::string set_, scene_;
  Results& results_;
};

// CPU seconds of rendering an image and reading it by the first estimator of a runner, over those of another.
Ratio ratio_of_times(const Runner& a, const Runner& b, std::size_t level) {
  const auto cost = [&](const Runner& r) {
    const Level& l = r.levels()[level];
    const double read = l.read_seconds / static_cast<double>(l.squared[0].size());
    return read / (median(r.seconds()) * static_cast<double>(l.count) / static_cast<double>(kBlock));
  };
  Ratio ratio = ratio_of_seconds(a.seconds(), b.seconds());
  ratio.value *= (1 + cost(a)) / (1 + cost(b));
  return ratio;
}

void report(const std::vector<Runner>& runners, std::uint32_t side, Report& out) {
  const auto find = [&](std::string_view name) -> const Runner& {
    return *std::find_if(runners.begin(), runners.end(),
                         [&](const Runner& r) { return r.contestant().name == name; });
  };
  const Runner &balance = find("balance"), &path = find("path");
  for (const Runner& r : runners) {
    const std::vector<std::string>& estimators = r.contestant().estimators;
    const bool paired = estimators.back() == "balance";  // of the same samples
    for (std::size_t e = 0; e < estimators.size(); ++e) {
      if (paired && e + 1 == estimators.size()) continue;  // it is the other's, again
      const bool only = estimators.size() == 1;
      const std::string method = only || r.contestant().name == "auto" ? r.contestant().name : estimators[e];
      for (std::size_t l = 0; l < r.levels().size(); ++l) {
        const Level& level = r.levels()[l];
        const auto n = static_cast<double>(level.count);
        const std::vector<double>& squared = level.squared[e];
        const Moments error = statistical::moments_of(squared);
        out.add(method, n, "squared error", {error.mean(), squared.size() < 2 ? kNone : error.error()});
        const Ratio samples = paired ? ratio_of(squared, level.squared.back())
                                     : ratio_of_independent(squared, balance.levels()[l].squared[0]);
        const Ratio time = ratio_of_times(r, balance, l);
        out.add(method, n, "squared error over balance, equal samples", samples);
        out.add(method, n, "seconds over balance", time);
        out.add(method, n, "squared error over balance, equal time", product(samples, time));
        out.add(
            method, n, "squared error over path, equal time",
            product(ratio_of_independent(squared, path.levels()[l].squared[0]), ratio_of_times(r, path, l)));
      }
    }
    const double pixels = static_cast<double>(side) * side * static_cast<double>(kBlock);
    out.add(r.contestant().name, kNone, "microseconds of an iteration",
            {1e6 * median(r.seconds()) / pixels, kNone});
    if (r.contestant().name != "optimal") continue;
    const std::vector<std::vector<float>> slopes = r.slopes();
    for (std::size_t i = 0; i < slopes.size(); ++i) out.map(fmt::format("alpha {}", i + 1), side, slopes[i]);
    const std::vector<double> crossfit = r.moments(0).variances(side),
                              plain = r.moments(estimators.size() - 1).variances(side);
    std::vector<float> gain;
    for (std::size_t i = 0; i < crossfit.size(); ++i)
      gain.push_back(static_cast<float>(crossfit[i] > 0 ? plain[i] / crossfit[i] : 1));
    out.map("gain", side, std::move(gain));
  }
}

}  // namespace

Result<Results> run_mis_scenes(const Request& request) {
  const std::uint32_t side = request.short_form ? 12 : 64;
  const std::uint64_t reference_count = request.short_form ? 128 : 4096;
  std::vector<std::uint64_t> counts = {16, kMapCount};
  if (!request.short_form) counts.push_back(256);
  // Independent images with the largest count: sequences of iterations of one job are independent.
  const std::uint64_t samples = request.seeds * counts.back();
  std::vector<std::string> scene_names;
  for (const Scene& scene : kScenes) scene_names.emplace_back(scene.name);
  CANDELA_TRY(check_scenes(request, scene_names));
  Results results;
  for (const Scene& scene : kScenes) {
    if (!request.wants(scene.name)) continue;
    const Render base{.scene = scene.file,
                      .width = side,
                      .height = side,
                      .integrator = "path",
                      .settings = {{"max_depth", "2"}}};
    std::vector<Image> references;
    for (const std::uint64_t seed : {kReferenceSeed, kReferenceSeed + 1}) {
      Render reference = base;
      reference.seed = seed;
      reference.sampler = "sobol";
      CANDELA_ASSIGN(auto images, render_images(reference, {reference_count}));
      references.push_back(std::move(images[0]));
    }
    const Truth truth(references[0], references[1]);
    for (const TechniqueSet& set : scene.sets) {
      Report out(set.name, scene.name, results);
      out.add("reference", static_cast<double>(reference_count), "squared error", {truth.variance, kNone});
      std::vector<Runner> runners;
      for (Contestant& contestant : contestants(set)) {
        CANDELA_ASSIGN(Runner runner, Runner::create(std::move(contestant), base));
        runners.push_back(std::move(runner));
      }
      for (Runner& runner : runners) runner.start(counts);
      for (std::uint64_t block = 0; block < samples / kBlock; ++block)
        for (Runner& runner : runners) CANDELA_TRY(runner.advance(block, truth));
      report(runners, side, out);
      request.say(fmt::format("mis-scenes: {}, {}", scene.name, set.name));
    }
  }
  return results;
}

}  // namespace candela::study
