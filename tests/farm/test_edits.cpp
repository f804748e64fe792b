// Jobs with edits of light transport: on a farm whose master and worker die, after an extension, resumed, and
// made again from what the picture says.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

// One edit of light by the path, one of the eye, and one by the vertex alone.
const std::string kEdits =
    R"({"regions":{"low":{"sphere":[0,0,0,1]}},"edits":[
      {"name":"second","direction":"light","select":"LXX","rotate":{"axis":[0,1,0],"degrees":30},"scale":0.5},
      {"name":"seen","direction":"eye","select":"XXE","tint":[1,0.5,0.25]},
      {"name":"low","direction":"light","select":"LX*X","source":"low","move":{"to":[0.2,0.1,0]}}]})";

std::vector<std::string> options_for(const std::string& integrator, const std::string& edits = kEdits) {
  std::vector<std::string> options = {"--integrator", integrator, "--set", "max_depth=4", "--edits", edits};
  if (integrator == "mmlt") options.insert(options.end(), {"--set", "chains=8"});
  return options;
}

bool differ(const image::Image& a, const image::Image& b) {
  return a.rgb != b.rgb;
}

class EditsOnFarm : public testing::TestWithParam<std::string> {};

// Claim: a job with edits has one picture to the last bit on one machine and on a farm whose master and
// worker are killed on the way; an extension of it is that of more iterations; and the picture is made again
// from what it says of itself.
TEST_P(EditsOnFarm, SurviveDeathsToTheLastBit) {
  const bool chains = GetParam() == "mmlt";
  const std::uint64_t iterations = chains ? 4 : 20, more = chains ? 4 : 10;
  const std::vector<std::string> options = options_for(GetParam());
  Farm farm;
  farm.start_master({"--unit-time", "0.05", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  Process& victim = farm.start_worker("victim");
  farm.start_worker("heir");
  const std::string id = farm.submit(iterations, "cornell", options);
  farm.wait_for_iterations(id, 1);
  farm.kill_master();
  victim.kill();
  farm.restart_master();
  farm.wait_for(id, v1::JOB_STATE_DONE);
  farm.audit(id, iterations);
  expect_identical(farm.fetch(id), farm.render(iterations, "cornell", options), "with deaths");

  farm.extend(id, more);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const image::Image extended = farm.fetch(id);
  // An extended job of chains keeps the settings that its first limit gave; `reproduce` knows them.
  if (!chains) expect_identical(extended, farm.render(iterations + more, "cornell", options), "extended");
  EXPECT_TRUE(differ(extended, farm.render(iterations + more, "cornell", options_for(GetParam(), "none"))));

  const std::string file = (farm.folder().path() / "picture.exr").string();
  ASSERT_EQ(farm.candela({"fetch", id, "-o", file}).exit_code, 0);
  EXPECT_NE(image::read_image(file)->metadata.at("candela:edits").find("LXX"), std::string::npos);
  const CommandResult again = farm.candela({"reproduce", file, "--run", "--quiet"});
  EXPECT_EQ(again.exit_code, 0) << again.out << again.err;
}
// Iterations and segments of chains; with CANDELA_LONG=1 subpaths with edits from both ends, too.
std::vector<std::string> integrators_with_edits() {
  if (long_form()) return {"path", "mmlt", "bdpt"};
  return {"path", "mmlt"};
}
INSTANTIATE_TEST_SUITE_P(, EditsOnFarm, testing::ValuesIn(integrators_with_edits()),
                         [](const auto& one) { return one.param; });

// Claim: a render with edits that is killed goes on with --resume to the picture of one that was not; the
// edits of the scene's element are those of the option, and an integrator that cannot render them says why.
TEST(EditedRenders, ResumeAndStandInTheScene) {
  Farm farm;
  std::ifstream in(scene_path("cornell"));
  std::stringstream text;
  text << in.rdbuf();
  std::string scene = text.str();
  const std::size_t begin = scene.find("<integrator"), end = scene.find("</integrator>") + 13;
  ASSERT_LT(begin, end);
  scene = scene.substr(0, begin) + "<integrator type=\"edits\"><string name=\"edits\" value='" + kEdits +
          "'/>" + scene.substr(begin, end - begin) + "</integrator>" + scene.substr(end);
  const std::string path = (farm.folder().path() / "edited.xml").string();
  std::ofstream(path) << scene;

  constexpr std::uint64_t iterations = 81;
  const std::string out = (farm.folder().path() / "r.exr").string();
  std::vector<std::string> command = {"render", path,           "-o",   out,     "--threads",
                                      "1",      "--integrator", "path", "--set", "max_depth=4"};
  for (const std::string& word : job_options(iterations)) command.push_back(word);
  const auto process = farm.start_candela(command, "render");
  ASSERT_TRUE(eventually(kPatienceSeconds,
                         [&] { return !process->running() || newest_checkpoint(out + ".candela") > 0; }));
  ASSERT_TRUE(process->running()) << process->err();
  process->signal(SIGKILL);
  EXPECT_EQ(process->wait(60).value_or(-1), 128 + SIGKILL);
  command.push_back("--resume");
  const CommandResult resumed = farm.candela_process(command);
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  expect_identical(*image::read_image(out), farm.render(iterations, "cornell", options_for("path")),
                   "resumed");

  for (const char* integrator : {"upbp", "optimis", "appm"}) {
    const CommandResult refused =
        farm.candela({"render", path, "-o", out, "--integrator", integrator, "--size", "8x8"});
    EXPECT_NE(refused.exit_code, 0) << integrator;
    EXPECT_NE(refused.err.find(integrator), std::string::npos) << refused.err;
    EXPECT_NE(refused.err.find("edit"), std::string::npos) << refused.err;
  }
}

}  // namespace
}  // namespace candela::farm
