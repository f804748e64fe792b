// Jobs of `candela inspect` on a farm.
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

const std::string kEdit =
    R"({"edits": [{"name": "a", "direction": "light", "select": "LX*X{left}X", "tint": [1, 0.5, 0.25]}]})";

struct Tool {
  std::string name;
  std::vector<std::string> words;
  std::string ending;                  // of the file
  std::vector<std::string> estimates;  // members of the report that are not those of other samples to the bit
  double relative;  // error that they may have; coarse maps have one of their pixels, and other samples
  bool samples_are_pixels = true;  // of the film, which the audit counts
};

std::vector<std::string> command_of(const Tool& tool, const std::string& file,
                                    const std::vector<std::string>& more) {
  std::vector<std::string> words = {"inspect"};
  words.insert(words.end(), tool.words.begin(), tool.words.end());
  words.insert(words.end(), {"--seed", "7", "-o", file, "--json"});
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class InspectOnFarm : public testing::TestWithParam<Tool> {};

// Claim: what a job makes has the same bytes with one worker, and with three of which one is killed together
// with the master; and its sums are those of what one machine makes without a farm.
TEST_P(InspectOnFarm, IsTheSameOfAnyWorkers) {
  Farm farm;
  const Tool& tool = GetParam();
  const auto path = [&](const std::string& name) {
    return (farm.folder().path() / (name + tool.ending)).string();
  };
  const auto bytes = [&](const std::string& name) { return *read_file(path(name), std::uint64_t{1} << 30); };
  farm.start_master({"--unit-time", "0.02", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  Process& victim = farm.start_worker("victim");
  const CommandResult here = farm.candela(command_of(tool, path("here"), {}));
  ASSERT_EQ(here.exit_code, 0) << here.err;
  const std::vector<std::string> remotely = {"--master", farm.address(), "--quiet"};
  const CommandResult one = farm.candela(command_of(tool, path("one"), remotely));
  ASSERT_EQ(one.exit_code, 0) << one.err;

  farm.start_worker("second");
  farm.start_worker("third");
  const auto three = farm.start_candela(command_of(tool, path("three"), remotely), "three");
  const auto job = [&] {
    const std::string said = three->err();
    const std::size_t at = said.find("candela: job ");
    return at == std::string::npos ? std::string() : said.substr(at + 13, said.find('\n', at) - at - 13);
  };
  eventually(kPatienceSeconds,
             [&] { return !three->running() || (!job().empty() && farm.job(job()).iterations() > 0); });
  ASSERT_FALSE(job().empty()) << three->err();
  farm.kill_master();
  victim.kill();
  farm.restart_master();
  ASSERT_EQ(three->wait(kPatienceSeconds).value_or(-1), 0) << three->err();
  EXPECT_EQ(farm.job(job()).iterations(), 60u);
  if (tool.samples_are_pixels) farm.audit(job(), 60);
  EXPECT_EQ(bytes("three"), bytes("one"));

  const auto local = nlohmann::json::parse(here.out), remote = nlohmann::json::parse(one.out);
  for (const std::string& name : tool.estimates)
    for (std::size_t c = 0; c < 3; ++c) {
      const double expected = local.at(name).at(c);
      EXPECT_NEAR(remote.at(name).at(c).get<double>(), expected, tool.relative * expected)
          << name << ' ' << c;
      EXPECT_GT(expected, 0);
    }
  EXPECT_EQ(remote.at("not_finite"), 0);
  if (!remote.contains("clusters")) return;
  const auto &expected = local.at("clusters"), &found = remote.at("clusters");
  ASSERT_EQ(found.size(), expected.size());
  EXPECT_GT(found.size(), 4u);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].at("expression"), expected[i].at("expression"));
    for (const char* name : {"share", "share_error"})
      EXPECT_NEAR(found[i].at(name).get<double>(), expected[i].at(name).get<double>(), tool.relative);
  }
}
INSTANTIATE_TEST_SUITE_P(
    , InspectOnFarm,
    testing::Values(Tool{"sphere",
                         {"sphere", scene_path("cornell"), "--at", "0.2,0.9,0.1", "--radius", "0.1",
                          "--map-size", "48x24", "--spp", "60", "--select", "LX+E"},
                         ".exr",
                         {"fluence"},
                         0.05},
                    // On the surface that a pixel shows, with an edit.
                    Tool{"disc",
                         {"sphere", scene_path("cornell"), "--pixel", "20,26", "--size", "48x32", "--disc",
                          "--map-size", "48x24", "--spp", "60", "--edits", kEdit},
                         ".exr",
                         {"fluence", "irradiance"},
                         0.1},
                    // Light of some pixels of a part of the image.
                    Tool{"volume",
                         {"volume",       scene_path("cornell"),
                          "--box",        "-1,0,-1,1,2,1",
                          "--resolution", "12",
                          "--size",       "48x32",
                          "--crop",       "8,0,32,32",
                          "--pixels",     "8,8,19,19",
                          "--spp",        "60",
                          "--set",        "max_depth=4",
                          "--select",     "LX+E",
                          "--edits",      kEdit},
                         ".vol",
                         {"mean", "crossing"},
                         1e-4,
                         false},
                    Tool{"paths",
                         {"paths",    scene_path("cornell"),
                          "--size",   "48x32",
                          "--crop",   "8,0,32,32",
                          "--pixels", "8,8,23,19",
                          "--spp",    "60",
                          "--set",    "max_depth=4",
                          "--by",     "object",
                          "--select", "LX+E",
                          "--region", "box:-1,-1,-1,0.5,2,1",
                          "--edits",  kEdit},
                         ".json",
                         {"mean"},
                         1e-4,
                         false}),
    [](const auto& one) { return one.param.name; });

// Claim: false color of a job, named by its id or its name, has the bytes of that of its image, also of the
// layer of its error; errors name the job.
TEST(FalseColorOnFarm, IsThatOfTheImage) {
  Farm farm;
  farm.start_master_here();
  const std::string id = farm.submit(8, "cornell", {"--name", "look"});
  const auto file = [&](const char* name) { return (farm.folder().path() / name).string(); };
  const auto show = [&](const std::string& what, std::vector<std::string> more) {
    std::vector<std::string> words = {"inspect", "falsecolor", what, "-o", file("shown.png")};
    words.insert(words.end(), more.begin(), more.end());
    return farm.candela(words);
  };
  const std::vector<std::string> remotely = {"--master", farm.address()};
  const CommandResult none = show("look", remotely);
  EXPECT_NE(none.exit_code, 0);
  EXPECT_NE(none.err.find(id), std::string::npos) << none.err;
  const CommandResult unknown = show("lock", remotely);
  EXPECT_NE(unknown.err.find("there is no job 'lock'"), std::string::npos) << unknown.err;

  farm.start_worker_here("worker");
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const CommandResult fetched = farm.candela({"fetch", id, "-o", file("image.exr"), "--error-layer"});
  ASSERT_EQ(fetched.exit_code, 0) << fetched.err;
  for (const auto& more : {std::vector<std::string>{}, std::vector<std::string>{"--layer", "error"}}) {
    const auto bytes = [&](const std::string& what, std::vector<std::string> options) {
      options.insert(options.end(), more.begin(), more.end());
      const CommandResult shown = show(what, options);
      EXPECT_EQ(shown.exit_code, 0) << shown.err;
      return *read_file(file("shown.png"), std::uint64_t{1} << 30) + shown.out;
    };
    const std::string of_image = bytes(file("image.exr"), {});
    EXPECT_EQ(bytes(id, remotely), of_image);
    EXPECT_EQ(bytes("look", remotely), of_image);
  }
  const CommandResult layer = show("look", {"--master", farm.address(), "--layer", "depht"});
  EXPECT_NE(layer.err.find("look: the image has no layer 'depht'"), std::string::npos) << layer.err;
}

// Claim: false color of a scene as a job has the bytes of that made here, of the image and of the light of an
// expression, also if a worker dies; a job that has a layer of the expression shows it.
TEST(FalseColorOnFarm, RendersScenes) {
  Farm farm;
  farm.start_master({"--unit-time", "0.02", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  Process& victim = farm.start_worker("victim");
  farm.start_worker("heir");
  const auto file = [&](const std::string& name) {
    return (farm.folder().path() / (name + ".png")).string();
  };
  const std::vector<std::string> of_job = {"--size", "48x32", "--spp", "301", "--seed", "7"};
  const auto words_of = [&](const std::string& name, std::vector<std::string> more) {
    std::vector<std::string> words = {
        "inspect", "falsecolor", scene_path("cornell"), "-o", file(name), "--log", "--json", "--quiet"};
    words.insert(words.end(), of_job.begin(), of_job.end());
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  const std::vector<std::string> select = {"--select", "LX{red}X*E"};
  const CommandResult here = farm.candela(words_of("here", select));
  ASSERT_EQ(here.exit_code, 0) << here.err;
  std::vector<std::string> remotely = select;
  remotely.insert(remotely.end(), {"--master", farm.address()});
  const auto there = farm.start_candela(words_of("there", remotely), "there");
  const auto job = [&] {
    const std::string said = there->err();
    const std::size_t at = said.find("candela: job ");
    return at == std::string::npos ? std::string() : said.substr(at + 13, said.find('\n', at) - at - 13);
  };
  eventually(kPatienceSeconds,
             [&] { return !there->running() || (!job().empty() && farm.job(job()).iterations() > 0); });
  ASSERT_FALSE(job().empty()) << there->err();
  victim.kill();
  ASSERT_EQ(there->wait(kPatienceSeconds).value_or(-1), 0) << there->err();
  farm.audit(job(), 301);
  const auto bytes = [&](const std::string& name) { return *read_file(file(name), std::uint64_t{1} << 30); };
  EXPECT_EQ(bytes("there"), bytes("here"));
  EXPECT_EQ(there->out(), here.out);

  std::vector<std::string> layers = {"--layer", "from_red=L X{red} [DGS]* E"};
  const std::string id = farm.submit(301, "cornell", layers);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const auto show = [&](const std::string& expression) {
    return farm.candela({"inspect", "falsecolor", id, "-o", file("job"), "--log", "--json", "--master",
                         farm.address(), "--select", expression});
  };
  const CommandResult of_layer = show("LX{red}X*E");
  ASSERT_EQ(of_layer.exit_code, 0) << of_layer.err;
  EXPECT_EQ(bytes("job"), bytes("here"));
  EXPECT_EQ(of_layer.out, here.out);
  const CommandResult none = show("LX{red}E");
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_NE(none.err.find(id + ": --select: the image has no layer of the expression 'LX{red}E' (there is "
                               "from_red="),
            std::string::npos)
      << none.err;
}

// Claim: if this machine's own samples find no light, the job still runs, and the report has its sums.
TEST(PathsOnFarm, RunIfNoneIsFoundHere) {
  Farm farm;
  farm.start_master_here();
  farm.start_worker_here("worker");
  for (const char* select : {"", "LD+E"}) {
    std::vector<std::string> words = {"inspect", "paths",    scene_path("cornell"), "--size",
                                      "16x16",   "--region", "sphere:40,40,40,0.5", "--spp",
                                      "40",      "--json"};
    words.insert(words.end(), {"--master", farm.address(), "--quiet"});
    if (*select != '\0') words.insert(words.end(), {"--select", select});
    const CommandResult result = farm.candela(words);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const std::string prefix = "candela: job ";
    ASSERT_TRUE(result.err.starts_with(prefix)) << result.err;
    const std::string id = result.err.substr(prefix.size(), result.err.find('\n') - prefix.size());
    EXPECT_EQ(farm.job(id).iterations(), 40u);
    const auto report = nlohmann::json::parse(result.out);
    EXPECT_EQ(report.at("spp"), 40);
    EXPECT_EQ(report.at("luminance"), 0);
    EXPECT_TRUE(report.at("clusters").empty());
    EXPECT_TRUE(report.at("other").at("share").is_null());
  }
}

}  // namespace
}  // namespace candela::farm
