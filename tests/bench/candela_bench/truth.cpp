#include "tests/bench/candela_bench/truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <stdexcept>

#include "common/base/files.h"
#include "common/base/version.h"
#include "common/image/image.h"
#include "tests/bench/candela_bench/figures.h"
#include "tests/statistical/block_tests.h"
#include "tests/statistical/moments.h"

namespace candela::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kFileLimitBytes = 1ULL << 36;

using statistical::ImageMoments;

// An error on its way through code that knows no Result.
struct Failure : std::runtime_error {
  explicit Failure(Error e) : std::runtime_error(e.message), error(std::move(e)) {}
  Error error;
};

Error stopped() {
  return refused_error("stopped").with_mend("the same command goes on");
}

std::uint64_t batch_iterations(const TruthOptions& options, double effort) {
  return static_cast<std::uint64_t>(
      std::ceil(static_cast<double>(options.iterations) * effort / static_cast<double>(options.batches)));
}

// One of the two integrators.
class Side {
 public:
  Side(const TruthOptions& options, RunSpec run, const EstimatorFactory& factory,
       const std::atomic<bool>& stop, const std::function<void(const std::string&)>& say)
      : options_(options), run_(std::move(run)), factory_(factory), stop_(stop), say_(say) {}

  const std::string& name() const { return run_.job.integrator; }

  // Region means of a stage's batches. Those of stage 1 are what the reference is made of; stage 2 is asked
  // for where they seem to disagree.
  statistical::Rows rows(const statistical::Regions& regions, std::uint64_t stage, double effort) {
    statistical::Rows rows;
    for (std::uint64_t batch = 0; batch < options_.batches; ++batch) {
      const std::vector<float> image = batch_image(stage, batch, effort);
      if (stage == 1) statistical::add_image(moments_, image);
      rows.push_back(regions.means(std::vector<double>(image.begin(), image.end())));
    }
    return rows;
  }
  const ImageMoments& moments() const { return moments_; }

 private:
  // Stages and batches have seeds of their own.
  std::vector<float> batch_image(std::uint64_t stage, std::uint64_t batch, double effort) {
    if (stop_.load()) throw Failure(stopped());
    RunSpec run = run_;
    run.job.seed = 1'000'003 * stage + batch;
    const std::uint64_t iterations = batch_iterations(options_, effort);
    const fs::path file =
        fs::path(options_.out).replace_extension(".parts") / fmt::format("{}-{}", run.id(), iterations);
    const std::size_t values = std::size_t{run.job.width} * run.job.height * 3;
    if (const auto kept = read_file(file, kFileLimitBytes);
        kept.ok() && kept->size() == values * sizeof(float)) {
      std::vector<float> image(values);
      std::memcpy(image.data(), kept->data(), kept->size());
      return image;
    }
    say_(fmt::format("{}: batch {} of {}{}, {} iterations", name(), batch + 1, options_.batches,
                     stage == 1 ? "" : " to confirm", iterations));
    auto estimator = take(factory_(run));
    // In steps of half a second or so, to hear of a stop.
    for (std::uint64_t done = 0, step = 1; done < iterations;) {
      if (stop_.load()) throw Failure(stopped());
      const auto start = std::chrono::steady_clock::now();
      done = std::min(iterations, done + step);
      take(estimator->advance(done));
      if (std::chrono::steady_clock::now() - start < std::chrono::milliseconds(250)) step *= 2;
    }
    std::vector<float> image = take(estimator->snapshot()).image;
    const auto done = write_file_atomically(
        file, {reinterpret_cast<const char*>(image.data()), image.size() * sizeof(float)});
    if (!done.ok()) throw Failure(done.error());
    return image;
  }
  template <class T>
  static T take(Result<T> result) {
    if (!result.ok()) throw Failure(std::move(result).error());
    return std::move(result).value();
  }

  const TruthOptions& options_;
  RunSpec run_;
  const EstimatorFactory& factory_;
  const std::atomic<bool>& stop_;
  const std::function<void(const std::string&)>& say_;
  ImageMoments moments_;
};

Result<std::string> combine(const TruthOptions& options, const Side& a, const Side& b,
                            const statistical::Verdict& verdict) {
  const double va = statistical::relative_variance(a.moments()),
               vb = statistical::relative_variance(b.moments());
  // For an image without any variance (nothing to be seen) both are as good.
  const double weight = va + vb > 0 ? vb / (va + vb) : 0.5;
  std::vector<float> rgb(a.moments().size()), deviation(rgb.size());
  for (std::size_t i = 0; i < rgb.size(); ++i) {
    rgb[i] = static_cast<float>(weight * a.moments()[i].mean() + (1 - weight) * b.moments()[i].mean());
    deviation[i] =
        static_cast<float>(std::sqrt(weight * weight * a.moments()[i].variance_of_mean() +
                                     (1 - weight) * (1 - weight) * b.moments()[i].variance_of_mean()));
  }
  const Reference reference(options.width, options.height, rgb, deviation, false);
  const std::string text = fmt::format(
      "{} ({:.0f} %) and {} ({:.0f} %), {} iterations each in {} batches: relMSE of its own {:.2e}\n{}",
      a.name(), 100 * weight, b.name(), 100 * (1 - weight), options.batches * batch_iterations(options, 1),
      options.batches, reference.own_error()->relmse, verdict.report);
  const std::map<std::string, std::string> metadata = {{"candela:reference", text},
                                                       {"candela:build", std::string(build_id())}};
  CANDELA_ASSIGN(const std::string deviations,
                 image::encode_exr(options.width, options.height, deviation, metadata));
  CANDELA_ASSIGN(const std::string pixels, image::encode_exr(options.width, options.height, rgb, metadata));
  // The image last: where it is, its error is.
  CANDELA_TRY(write_file_atomically(fs::path(options.out).replace_extension(".stderr.exr"), deviations));
  CANDELA_TRY(write_file_atomically(options.out, pixels));
  return text;
}

}  // namespace

Result<std::string> make_truth(const TruthOptions& options, const EstimatorFactory& factory,
                               const std::atomic<bool>& stop,
                               const std::function<void(const std::string&)>& say) {
  if (options.integrators.size() != 2 || options.integrators[0] == options.integrators[1])
    return usage_error("a reference takes two different integrators").with_field("--integrators");
  if (fs::path(options.out).extension() != ".exr")
    return usage_error("a reference is an .exr file").with_field("--out");
  if (options.batches < 4 || options.batches > options.iterations)
    return usage_error("at least 4 batches of one iteration").with_field("--iterations");
  if (options.iterations > Limits::max_iterations)
    return usage_error(fmt::format("must be at most {}", Limits::max_iterations)).with_field("--iterations");
  if (options.block < 1 || options.block > Limits::max_extent)
    return usage_error(fmt::format("must be between 1 and {}", Limits::max_extent)).with_field("--block");
  if (options.threads < 1 || options.threads > 1024)
    return usage_error("must be between 1 and 1024").with_field("--threads");
  std::vector<Side> sides;
  for (const std::string& integrator : options.integrators) {
    CANDELA_ASSIGN(const SettingsMap given, settings_for(integrator, options.integrators, options.sets));
    CANDELA_ASSIGN(RunSpec run, make_run(options.scene_file, scene_name_of(options.scene_file), integrator,
                                         given, options.width, options.height));
    run.threads = options.threads;
    sides.emplace_back(options, std::move(run), factory, stop, say);
  }
  CANDELA_TRY(make_directories(fs::path(options.out).replace_extension(".parts")));
  const statistical::Regions regions(options.width, options.height, options.block);
  std::array<statistical::Estimator, 2> estimators;
  for (std::size_t i = 0; i < 2; ++i)
    estimators[i] = statistical::cached({sides[i].name(), [&, i](std::uint64_t stage, double effort) {
                                           return sides[i].rows(regions, stage, effort);
                                         }});
  try {
    const statistical::Verdict verdict =
        statistical::compare(estimators[0], estimators[1], regions, statistical::BlockTest{});
    if (!verdict.agree)
      return refused_error(fmt::format("{} and {} disagree, so there is no reference: {}", sides[0].name(),
                                       sides[1].name(), verdict.report))
          .with_mend("one of them is wrong, or biased, or has not found all the light");
    if (2 * verdict.decided < verdict.values)
      say(fmt::format(
          "warning: a difference of 5 % would have been found in {} of {} values: more iterations make "
          "a reference to rely on",
          verdict.decided, verdict.values));
    return combine(options, sides[0], sides[1], verdict);
  } catch (const Failure& failure) {
    return failure.error;
  }
}

}  // namespace candela::bench
