// Layers of bidirectional techniques on a farm of real processes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

// A partition of all paths, by their length.
const std::vector<std::string> kByLength = {
    "--layer",    "by.seen=LE", "--layer", "by.direct=L[DGSV]E", "--layer", "by.bounces=L[DGSV][DGSV]+E",
    "--partition"};

// The layers of a file, whose names are in `names` and begin with `prefix`, add up to its image, but for the
// rounding of floats.
void expect_sum(const std::string& file, const std::vector<std::string>& names, std::string_view prefix,
                double tolerance) {
  const image::Image image = *image::read_image(file);
  std::vector<double> sum(image.rgb.size());
  std::size_t parts = 0;
  for (const std::string& name : names) {
    if (!name.starts_with(prefix)) continue;
    const auto layer = image::read_layer(file, name);
    ASSERT_TRUE(layer.ok()) << name;
    ++parts;
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<double>(layer->rgb[i]);
  }
  ASSERT_GT(parts, 1U);
  double mean = 0;
  for (const float v : image.rgb) mean += static_cast<double>(v) / static_cast<double>(image.rgb.size());
  ASSERT_GT(mean, 0);
  for (std::size_t i = 0; i < sum.size(); ++i)
    ASSERT_NEAR(sum[i], static_cast<double>(image.rgb[i]), tolerance * (mean + std::abs(sum[i])))
        << prefix << " value " << i;
}

// Claim: every technique's layer is the same to the last bit on one machine and on a farm whose master and
// worker are killed on the way, with the names of the layers in the job, and the weighted layers add up to
// the image. (Each sum is rounded on its own, by less than 2^-20 of the mean a sample: 1e-4 is far above it.)
// So do layers by light path expressions, whose sums are the image's: only floats are rounded.
TEST(Layers, SurviveDeathsToTheLastBit) {
  constexpr std::uint64_t iterations = 151;
  std::vector<std::string> options = {"--integrator", "bdpt",          "--set", "layers=both",
                                      "--set",        "layer_depth=3", "--set", "max_depth=5"};
  options.insert(options.end(), kByLength.begin(), kByLength.end());
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  Process& victim = farm.start_worker("victim");
  farm.start_worker("heir");
  const std::string id = farm.submit(iterations, "cornell", options);
  std::uint64_t seen = 0;
  for (int deaths = 0; deaths < 3; ++deaths) {
    const v1::JobStatus status = farm.wait_for_iterations(id, seen + 1);
    ASSERT_EQ(status.state(), v1::JOB_STATE_RUNNING) << "the job ended too soon: make it longer";
    const std::vector<std::string> names(status.layers().begin(), status.layers().end());
    ASSERT_GT(names.size(), 4U);
    farm.kill_master();
    if (deaths == 1) victim.kill();
    farm.restart_master();
    const v1::JobStatus after = farm.job(id);
    EXPECT_EQ(std::vector<std::string>(after.layers().begin(), after.layers().end()), names);
    seen = after.iterations();
  }
  const v1::JobStatus done = farm.wait_for(id, v1::JOB_STATE_DONE);
  farm.audit(id, iterations);
  EXPECT_EQ(done.light_paths(), iterations * kWidth * kHeight);

  const std::string fetched = (farm.folder().path() / "fetched.exr").string();
  ASSERT_EQ(farm.candela({"fetch", id, "-o", fetched, "--error-layer"}).exit_code, 0);
  const std::string rendered = (farm.folder().path() / "rendered.exr").string();
  std::vector<std::string> command = {"render", scene_path("cornell"), "-o", rendered, "--quiet"};
  for (const std::string& option : job_options(iterations)) command.push_back(option);
  command.insert(command.end(), options.begin(), options.end());
  const CommandResult render = farm.candela_process(command);
  ASSERT_EQ(render.exit_code, 0) << render.err;

  const image::Image image = *image::read_image(fetched);
  expect_identical(image, *image::read_image(rendered), "the image");
  const std::vector<std::string> names(done.layers().begin(), done.layers().end());
  for (const std::string& name : names) {
    const auto here = image::read_layer(rendered, name);
    const auto there = image::read_layer(fetched, name);
    ASSERT_TRUE(here.ok() && there.ok()) << name;
    expect_identical(*there, *here, name);
    EXPECT_NE(image.metadata.at("candela:layers").find(name), std::string::npos);
  }
  expect_sum(fetched, names, "weighted", 1e-4);
  expect_sum(fetched, names, "by.", 1e-6);
  EXPECT_TRUE(image::read_layer(fetched, "error").ok());
  EXPECT_FALSE(image::read_layer(rendered, "error").ok());
}

// Claim: the AOVs of a job of chains, whose eye samples are counted pixel by pixel, are the same to the last
// bit from `candela render` and from a farm of two workers whose master is killed on the way; so is the
// variance, which is the square of the error. So are layers by light path expressions, which share the
// image's b and add up to it. A job without AOVs and layers has the same image.
TEST(Layers, AovsOfChainsAreTheSameEverywhere) {
  constexpr std::uint64_t iterations = 14;
  const std::vector<std::string> plain = {"--integrator", "pssmlt", "--set",
                                          "chains=8",     "--set",  "mutations=4"};
  std::vector<std::string> options = plain;
  options.insert(options.end(), {"--aov", "albedo,normal,depth"});
  options.insert(options.end(), kByLength.begin(), kByLength.end());
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  farm.start_worker("one");
  farm.start_worker("two");
  const std::string id = farm.submit(iterations, "cornell", options);
  farm.wait_for_iterations(id, 1);
  farm.kill_master();
  farm.restart_master();
  farm.wait_for(id, v1::JOB_STATE_DONE);
  farm.audit(id, iterations);
  const std::string fetched = (farm.folder().path() / "fetched.exr").string();
  ASSERT_EQ(farm.candela({"fetch", id, "-o", fetched, "--error-layer", "--variance-layer"}).exit_code, 0);
  const auto render = [&](const std::string& name, const std::vector<std::string>& with) {
    const std::string path = (farm.folder().path() / name).string();
    std::vector<std::string> command = {"render", scene_path("cornell"), "-o", path, "--quiet"};
    for (const std::string& option : job_options(iterations)) command.push_back(option);
    command.insert(command.end(), with.begin(), with.end());
    const CommandResult done = farm.candela_process(command);
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return path;
  };
  const std::string rendered = render("rendered.exr", options);
  expect_identical(*image::read_image(fetched), *image::read_image(rendered), "the image");
  for (const char* name : {"albedo", "normal", "depth"}) {
    const auto here = image::read_layer(rendered, name), there = image::read_layer(fetched, name);
    ASSERT_TRUE(here.ok() && there.ok()) << name;
    expect_identical(*there, *here, name);
  }
  const auto normal = image::read_layer(fetched, "normal");
  EXPECT_LT(*std::min_element(normal->rgb.begin(), normal->rgb.end()), -0.5F) << "signs are kept";
  const auto error = image::read_layer(fetched, "error"), variance = image::read_layer(fetched, "variance");
  ASSERT_TRUE(error.ok() && variance.ok());
  for (std::size_t i = 0; i < error->rgb.size(); ++i)
    ASSERT_NEAR(variance->rgb[i], error->rgb[i] * error->rgb[i], 1e-6F * variance->rgb[i]);
  const v1::JobStatus done = farm.job(id);
  const std::vector<std::string> names(done.layers().begin(), done.layers().end());
  EXPECT_EQ(names.size(), 3U);
  for (const std::string& name : names) {
    const auto here = image::read_layer(rendered, name), there = image::read_layer(fetched, name);
    ASSERT_TRUE(here.ok() && there.ok()) << name;
    expect_identical(*there, *here, name);
  }
  expect_sum(fetched, names, "by.", 1e-6);
  expect_identical(*image::read_image(render("plain.exr", plain)), *image::read_image(rendered),
                   "without AOVs and layers");
}

}  // namespace
}  // namespace candela::farm
