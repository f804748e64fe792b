// Tests the reports of a farm on jobs with statistics: show, metrics and layers of adaptive radii, read-outs
// of optimal weights, and the refusal of films that are too large for the master.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <map>
#include <set>
#include <thread>

#include "common/stages/epochs.h"
#include "tests/farm/farm.h"
#include "tests/farm/metrics_page.h"
#include "tests/integrators.h"

namespace candela::farm {
namespace {

// The rest of the line of `candela show` that begins with these words.
std::string shown(const std::string& text, const std::string& words) {
  const std::size_t at = ("\n" + text).find("\n" + words);
  if (at == std::string::npos) {
    ADD_FAILURE() << "no line '" << words << "' in\n" << text;
    return {};
  }
  const std::string line = text.substr(at, text.find('\n', at) - at);
  return line.substr(std::min(line.size(), line.find_first_not_of(' ', words.size())));
}

std::vector<std::string> with_small_epochs(const std::string& integrator) {
  std::vector<std::string> options = {"--integrator", integrator, "--set", "plan=full"};
  for (const auto& [name, value] : test::integrator_row(integrator).small)
    options.insert(options.end(), {"--set", name + "=" + value});
  return options;
}

// Claim: `show` and the metrics tell the epoch, the pixels that shrank, the median radius and the bytes of
// statistics, and the same of each; what came over the network is counted without the film.
TEST(Reports, ShowAndMetricsTellOfRadii) {
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--lease-time", "600", "--http", "127.0.0.1:0"});
  const std::string http = farm.master().wait_for_line("http on ", 10);
  Process& worker = farm.start_worker("a");
  const std::string plain = farm.submit(61, "cornell", {"--integrator", "ppm"});
  farm.wait_for(plain, v1::JOB_STATE_DONE);
  const std::string id = farm.submit(100000, "cornell", with_small_epochs("fppm"));
  farm.wait_for_iterations(id, 61);
  worker.signal(SIGSTOP);
  // Until all that was under way is decided and told.
  v1::JobStatus status, before;
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
    before = status;
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    status = farm.job(id);
    return before.iterations() == status.iterations() && before.epochs().epoch() == status.epochs().epoch();
  }));
  ASSERT_EQ(status.state(), v1::JOB_STATE_RUNNING);
  const CommandResult show = farm.candela({"show", id});
  ASSERT_EQ(show.exit_code, 0) << show.err;
  const v1::EpochStatus& epochs = status.epochs();
  std::map<std::string, double> figures;
  for (const v1::Figure& figure : epochs.figures()) figures[figure.name()] = figure.value();
  const Epochs plan(2, 16);
  // An epoch's state is decided when the epoch before the last is whole.
  EXPECT_GE(epochs.epoch(), plan.of_iteration(status.iterations() / 2));
  EXPECT_LE(plan.begin(epochs.epoch() - 1), status.iterations());
  EXPECT_EQ(epochs.first_iteration(), plan.begin(epochs.epoch()));
  EXPECT_EQ(shown(show.out, "epoch"),
            fmt::format("{}: iterations {} to {}", epochs.epoch(), epochs.first_iteration(),
                        epochs.first_iteration() + epochs.iterations() - 1));
  EXPECT_GT(figures.at("pixels shrunk"), 0);
  EXPECT_LT(figures.at("median radius"), 1);
  for (const char* name : {"pixels shrunk", "median radius", "looks", "rejections"})
    EXPECT_EQ(shown(show.out, std::string("  ") + name), fmt::format("{:.6g}", figures.at(name)));
  // The carry and the sums of open epochs: 13 sums of at least 8 bytes a pixel each, and planes of bytes.
  const std::uint64_t one_set = std::uint64_t{13} * 8 * kWidth * kHeight;
  EXPECT_GE(epochs.statistics_bytes(), one_set);
  EXPECT_LE(epochs.statistics_bytes(), 2 * 4 * one_set);
  EXPECT_EQ(shown(show.out, "statistics"), fmt::format("{:.1f} MB in the master's memory, {:.1f} MB received",
                                                       static_cast<double>(epochs.statistics_bytes()) * 1e-6,
                                                       static_cast<double>(epochs.received_bytes()) * 1e-6));
  EXPECT_GT(epochs.received_bytes(), 0U);
  EXPECT_EQ(farm.candela({"show", plain}).out.find("\nepoch"), std::string::npos);

  const std::string page = http_get(http, "/metrics");
  EXPECT_EQ(metric(page, "candela_job_epoch", id), static_cast<double>(epochs.epoch()));
  EXPECT_EQ(metric(page, "candela_job_statistics_bytes", id), static_cast<double>(epochs.statistics_bytes()));
  for (const auto& [name, value] : figures) {
    bool found = false;
    for (std::size_t at = 0; (at = page.find("\ncandela_job_state{", at + 1)) != std::string::npos;) {
      const std::string line = page.substr(at + 1, page.find('\n', at + 1) - at - 1);
      if (line.find("figure=\"" + name + "\"") == std::string::npos || line.find(id) == std::string::npos)
        continue;
      found = true;
      EXPECT_NEAR(std::stod(line.substr(line.rfind(' '))), value, 1e-5 * value) << line;
    }
    EXPECT_TRUE(found) << name;
  }
  EXPECT_EQ(page.find("candela_job_epoch{job=\"" + plain), std::string::npos);
  EXPECT_NE(page.find("\ncandela_threads_wanted "), std::string::npos);
  EXPECT_NE(page.find("\ncandela_workers_wanted "), std::string::npos);
  // The wire: less than all bytes of deltas, which have films and the other job's too.
  const std::size_t at = page.find("\ncandela_delta_bytes_total ");
  ASSERT_NE(at, std::string::npos);
  EXPECT_LT(static_cast<double>(epochs.received_bytes()), std::stod(page.substr(page.find(' ', at))));
}

// Claim: `render --layers` and `fetch --layers` give the same layers of the newest state, and with
// layers=merging what merging brings; without the option an image has no layer of a state.
TEST(Reports, LayersOfRadii) {
  std::vector<std::string> options = with_small_epochs("vcmplus");
  options.insert(options.end(), {"--set", "layers=merging"});
  Farm farm;
  farm.start_master_here({"--unit-time", "0.05"});
  for (const char* name : {"a", "b"}) farm.start_worker_here(name);
  const std::string id = farm.submit(31, "cornell", options);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const std::string fetched = (farm.folder() / "fetched.exr").string(),
                    plain = (farm.folder() / "plain.exr").string(),
                    rendered = (farm.folder() / "rendered.exr").string();
  ASSERT_EQ(farm.candela({"fetch", id, "-o", fetched, "--layers"}).exit_code, 0);
  ASSERT_EQ(farm.candela({"fetch", id, "-o", plain}).exit_code, 0);
  std::vector<std::string> command = {"render", scene_path("cornell"), "-o", rendered, "--quiet", "--layers"};
  for (const std::string& option : job_options(31)) command.push_back(option);
  command.insert(command.end(), options.begin(), options.end());
  const CommandResult render = farm.candela_process(command);
  ASSERT_EQ(render.exit_code, 0) << render.err;
  expect_identical(*image::read_image(fetched), *image::read_image(rendered), "the image");
  for (const char* name : {"radius", "tests.looks", "tests.rejections", "merging"}) {
    const auto here = image::read_layer(rendered, name), there = image::read_layer(fetched, name);
    ASSERT_TRUE(here.ok() && there.ok()) << name;
    expect_identical(*there, *here, name);
    EXPECT_EQ(image::read_layer(plain, name).ok(), std::string(name) == "merging") << name;
  }
  const image::Image radius = *image::read_layer(fetched, "radius");
  const auto [smallest, largest] = std::minmax_element(radius.rgb.begin(), radius.rgb.end());
  EXPECT_GT(*smallest, 0);
  EXPECT_LT(*smallest, *largest) << "all radii are the same: nothing is tested";
  EXPECT_LE(*largest, 1);
}

// Claim: one job of optimal weights is read in each way while it runs and when it has ended, whatever the
// number of workers, as the same bytes that a job with this estimator has; a job with one read-out says that
// it has no other, and an unknown estimator is told what there is.
TEST(Reports, OneJobHasSeveralReadOuts) {
  constexpr std::uint64_t kIterations = 151;
  const std::vector<std::string> estimators = {"crossfit", "direct", "balance"};
  const std::vector<std::string> optimal = {"--integrator", "optimis", "--set", "weights=optimal"};
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--lease-time", "600"});
  Process& worker = farm.start_worker("a");
  const std::string first = farm.submit(kIterations, "cornell", optimal);
  const auto fetched = [&](const std::string& id, const std::string& estimator) {
    const std::string file = (farm.folder() / (estimator + ".exr")).string();
    const CommandResult result = farm.candela({"fetch", id, "-o", file, "--estimator", estimator});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return *image::read_image(file);
  };
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
    std::set<std::uint32_t> halves;
    const v1::GetLedgerResponse ledger = farm.ledger(first);
    for (const v1::IterationRange& range : ledger.film()) halves.insert(range.half());
    return halves.size() == 2;
  }));
  worker.signal(SIGSTOP);
  const image::Image early = fetched(first, "crossfit"), early_balance = fetched(first, "balance");
  EXPECT_EQ(farm.job(first).state(), v1::JOB_STATE_RUNNING) << "the job ended too soon: make it longer";
  EXPECT_NE(early.rgb, early_balance.rgb);
  worker.signal(SIGCONT);
  farm.wait_for(first, v1::JOB_STATE_DONE);

  for (const char* name : {"b", "c"}) farm.start_worker(name);
  const std::string second = farm.submit(kIterations, "cornell", optimal);
  farm.wait_for(second, v1::JOB_STATE_DONE);
  std::vector<image::Image> images;
  for (const std::string& estimator : estimators) {
    SCOPED_TRACE(estimator);
    images.push_back(fetched(first, estimator));
    expect_identical(fetched(second, estimator), images.back(), "three workers and one");
    std::vector<std::string> one = optimal;
    one.insert(one.end(), {"--set", "estimator=" + estimator});
    expect_identical(images.back(), farm.render(kIterations, "cornell", one),
                     "`fetch --estimator` and a job of that estimator");
  }
  for (std::size_t i = 0; i < images.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(images[i].rgb, images[j].rgb) << i << ' ' << j;

  const std::string file = (farm.folder() / "none.exr").string();
  const CommandResult unknown = farm.candela({"fetch", first, "-o", file, "--estimator", "best-guess"});
  EXPECT_EQ(unknown.exit_code, 2) << unknown.err;
  for (const std::string& word : estimators)
    EXPECT_NE(unknown.err.find(word), std::string::npos) << unknown.err;
  const std::string plain = farm.submit(3, "cornell", {"--integrator", "path"});
  farm.wait_for(plain, v1::JOB_STATE_DONE);
  const CommandResult none = farm.candela({"fetch", plain, "-o", file, "--estimator", "balance"});
  EXPECT_EQ(none.exit_code, 2) << none.err;
  EXPECT_NE(none.err.find("one read-out"), std::string::npos) << none.err;
  EXPECT_FALSE(std::filesystem::exists(file));
}

// Claim: `fetch --half` gives each half of a job's iterations, which says what it is; the two differ, and
// their mean is the image.
TEST(Reports, HalvesAreFetched) {
  Farm farm;
  farm.start_master_here();
  farm.start_worker_here("a");
  const std::string id = farm.submit(4, "cornell", {"--integrator", "path"});
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const auto half = [&](const std::string& name) {
    const std::string file = (farm.folder() / (name + ".exr")).string();
    const CommandResult result = farm.candela({"fetch", id, "-o", file, "--half", name});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return *image::read_image(file);
  };
  const image::Image a = half("A"), b = half("B"), whole = farm.fetch(id);
  EXPECT_EQ(a.metadata.at("candela:half"), "A");
  EXPECT_EQ(b.metadata.at("candela:half"), "B");
  EXPECT_EQ(whole.metadata.count("candela:half"), 0U);
  EXPECT_NE(a.rgb, b.rgb);
  ASSERT_EQ(a.rgb.size(), whole.rgb.size());
  ASSERT_EQ(b.rgb.size(), whole.rgb.size());
  for (std::size_t i = 0; i < whole.rgb.size(); ++i)
    ASSERT_NEAR((a.rgb[i] + b.rgb[i]) / 2, whole.rgb[i], 1e-6 + 1e-5 * static_cast<double>(whole.rgb[i]))
        << i;
}

// Claim: a job whose statistics the master has no memory for is refused when it is submitted, before a byte
// is uploaded, with the film, the bytes and the setting; a scene that needs fewer sums than its settings may
// ask for is loaded to know, and accepted.
TEST(Reports, FilmsTooLargeForStatisticsAreRefused) {
  Farm farm;
  farm.start_master_here({"--statistics-memory", "50M"});
  const auto submit = [&](const std::string& integrator, const std::string& size) {
    return farm.candela(
        {"submit", scene_path("cornell"), "--integrator", integrator, "--size", size, "--iterations", "4"});
  };
  // 39 sums of 8 bytes, for the scene has color, for three epochs, and a byte of memo; sums of the bias by
  // blocks take the last 2 MB. The option counts in MiB.
  const CommandResult refused = submit("fppm", "640x360");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(refused.out.empty());
  for (const char* word : {"'fppm'", "640 x 360", "218 MB", "53 MB", "--statistics-memory", "smaller image"})
    EXPECT_NE(refused.err.find(word), std::string::npos) << word << " in " << refused.err;
  EXPECT_TRUE(farm.candela({"list", "--json"}).out.find("\"id\"") == std::string::npos);
  std::size_t files = 0;
  for (const auto& e : std::filesystem::recursive_directory_iterator(farm.folder() / "data" / "blobs"))
    files += e.is_regular_file() ? 1 : 0;
  EXPECT_EQ(files, 0U) << "something was uploaded";
  EXPECT_EQ(submit("fppm", "230x230").exit_code, 0);  // 49.6 MB
  EXPECT_EQ(submit("ppm", "640x360").exit_code, 0);
  // One lamp: two techniques in place of three, 9 sums in place of 15 for two halves. Matt walls: nothing
  // merges.
  EXPECT_EQ(submit("optimis", "640x360").exit_code, 0);
  EXPECT_EQ(submit("vcmplus", "640x360").exit_code, 0);
}

}  // namespace
}  // namespace candela::farm
