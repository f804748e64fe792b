// One normalisation for the whole job, however many workers estimate it: images of Markov chains on farms of
// 1, 4 and 16 workers, beside bdpt's.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <map>
#include <string_view>

#include "tests/farm/farm.h"
#include "tests/integrators.h"

namespace candela::farm {
namespace {

// Jobs of each integrator: on the farm that means are taken from, in the long form, and on the others, which
// give the same.
constexpr int kMany = 16, kFew = 1;
std::vector<std::string> chains_compared() {
  std::vector<std::string> names = test::chain_integrators();
  if (!long_form())
    std::erase_if(names, [](const std::string& name) { return !test::integrator_row(name).stands_for_kind; });
  return names;
}
// Adds what the chains are compared with.
std::vector<std::string> compared() {
  std::vector<std::string> names = chains_compared();
  if (long_form()) names.insert(names.begin(), "bdpt");
  return names;
}

double mean_luminance(const image::Image& image) {
  double sum = 0;
  for (std::size_t i = 0; i < image.rgb.size(); i += 3)
    sum += 0.2126 * static_cast<double>(image.rgb[i]) + 0.7152 * static_cast<double>(image.rgb[i + 1]) +
           0.0722 * static_cast<double>(image.rgb[i + 2]);
  return 3 * sum / static_cast<double>(image.rgb.size());
}

struct Estimate {
  double mean = 0, standard_error = 0;
};
Estimate estimate(const std::vector<image::Image>& images) {
  const auto n = static_cast<double>(images.size());
  Estimate out;
  double squares = 0;
  for (const auto& one : images) out.mean += mean_luminance(one) / n;
  for (const auto& one : images) squares += std::pow(mean_luminance(one) - out.mean, 2);
  out.standard_error = std::sqrt(squares / (n - 1) / n);
  return out;
}

// All jobs of one farm, which renders them beside each other: images by integrator, one a seed.
std::map<std::string, std::vector<image::Image>> render_all(int workers, int seeds) {
  Farm farm;
  farm.start_master({"--unit-time", "0.05"});
  for (int i = 0; i < workers; ++i) farm.start_worker("w" + std::to_string(i));
  EXPECT_TRUE(eventually(kPatienceSeconds, [&] { return farm.workers().size() == std::size_t(workers); }));
  std::map<std::string, std::vector<std::string>> jobs;
  for (const std::string& integrator : compared())
    for (int seed = 1; seed <= seeds; ++seed) {
      std::vector<std::string> options = {"--integrator", integrator};
      if (integrator != "bdpt")
        options.insert(options.end(), {"--set", "mutations=4", "--set", "chains=200"});
      jobs[integrator].push_back(
          farm.submit(integrator == "bdpt" ? 20 : 6, "cornell", options, static_cast<std::uint64_t>(seed)));
    }
  std::map<std::string, std::vector<image::Image>> images;
  for (const auto& [integrator, ids] : jobs)
    for (const std::string& id : ids) {
      farm.wait_for(id, v1::JOB_STATE_DONE);
      images[integrator].push_back(farm.fetch(id));
    }
  std::size_t active = 0;
  for (const auto& worker : farm.workers()) active += worker.units_merged() > 0 ? 1 : 0;
  EXPECT_GT(2 * active, static_cast<std::size_t>(workers)) << "most had nothing to do";
  return images;
}

// Claim: 1, 4 or 16 workers give one image to the last bit, job by job, and its mean luminance is bdpt's
// (with CANDELA_LONG=1, of all chains; tests/statistical has the same of single processes). Means over 16
// jobs of seeds of their own, Welch's t at 7: with as few as 15 degrees of freedom one of two such
// comparisons raises a false alarm with probability 9e-6. A normalisation of each worker's own, or one that
// knows the number of workers, is wrong by a factor; what is found with probability 0.9 is printed.
TEST(Consistency, MeanLuminanceIsBdptsForAnyNumberOfWorkers) {
  const auto four = render_all(4, long_form() ? kMany : kFew);
  for (const int workers : {1, 16}) {
    const auto others = render_all(workers, kFew);
    for (const auto& [integrator, images] : others)
      for (std::size_t i = 0; i < images.size(); ++i)
        expect_identical(images[i], four.at(integrator)[i],
                         fmt::format("{}, {} workers and 4, seed {}", integrator, workers, i + 1));
  }
  if (!long_form()) return;
  constexpr double kBound = 7;
  const Estimate truth = estimate(four.at("bdpt"));
  EXPECT_GT(truth.mean, 0);
  for (const std::string& integrator : chains_compared()) {
    const Estimate found = estimate(four.at(integrator));
    const double error = std::hypot(found.standard_error, truth.standard_error);
    std::printf("%s: mean luminance %.5f +- %.5f, bdpt %.5f +- %.5f, t = %.2f; finds %.1f %%\n",
                integrator.c_str(), found.mean, found.standard_error, truth.mean, truth.standard_error,
                (found.mean - truth.mean) / error, 100 * (kBound + 1.4) * error / truth.mean);
    EXPECT_LT(std::abs(found.mean - truth.mean), kBound * error);
    EXPECT_LT((kBound + 1.4) * error, 0.1 * truth.mean) << "or the line above proves little";
  }
}

// The share of a job's merged segments that one worker made.
double share_of(const v1::GetLedgerResponse& ledger, const std::string& worker_id) {
  double own = 0, all = 0;
  for (const v1::LedgerRow& row : ledger.merged()) {
    if (row.unit().kind() != v1::Unit::KIND_SEGMENTS) continue;
    const auto segments = static_cast<double>(row.unit().end() - row.unit().begin());
    all += segments;
    if (row.worker_id() == worker_id) own += segments;
  }
  return all > 0 ? own / all : 0;
}

// Claim: where one worker does nine tenths of the work or more, the image is that of an even split, to the
// last bit. The other is put to sleep whenever it has done 1 %; on a busy machine it may be noticed too late,
// so that the share is an even one after all: then with another job.
TEST(Consistency, OneWorkerDoesNearlyAll) {
  constexpr int kMaxJobs = 6;
  Farm farm;
  farm.start_master({"--unit-time", "0.02"});
  Process& lazy = farm.start_worker("lazy");
  farm.start_worker("eager");
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return farm.workers().size() == 2; }));
  const std::string lazy_id = farm.worker("lazy").id();
  for (const std::string& integrator : chains_compared()) {
    SCOPED_TRACE(integrator);
    const std::uint64_t rounds = integrator == "mmlt" ? 100 : long_form() ? 30 : 12;
    const std::vector<std::string> options = {"--integrator", integrator, "--set", "chains=200"};
    const auto alone = farm.render(rounds, "cornell", options);
    double share = 0;
    for (int job = 0; job < kMaxJobs && !(share > 0 && share <= 0.1); ++job) {
      const std::string id = farm.submit(rounds, "cornell", options);
      // Units that the sleeper holds are waited for when the other has nothing else to do.
      EXPECT_TRUE(eventually(kPatienceSeconds, [&] {
        const bool sleeps =
            share_of(farm.ledger(id), lazy_id) > 0.01 && farm.worker("eager").state() == "busy";
        lazy.signal(sleeps ? SIGSTOP : SIGCONT);
        return farm.job(id).state() == v1::JOB_STATE_DONE;
      }));
      lazy.signal(SIGCONT);
      share = share_of(farm.ledger(id), lazy_id);
      std::printf("%s: one of two workers made %.1f %% of the segments\n", integrator.c_str(), 100 * share);
      farm.audit(id, rounds);
      expect_identical(farm.fetch(id), alone, "uneven shares");
    }
    EXPECT_GT(share, 0);
    EXPECT_LE(share, 0.1) << "of " << kMaxJobs << " jobs";
  }
}

}  // namespace
}  // namespace candela::farm
