// Groups of frames by the command, on a farm of real processes.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

// Claim: the frames of a scene are one group that survives its master's death: one row of `list`, fetched by
// one command, and each frame is the picture that `candela render` makes with the frame's definitions. A job
// that depends on the group is done after it, by its name too.
TEST(Frames, AreOneGroupAndTheirOwnPictures) {
  constexpr int kFrames = 3;
  Farm farm;
  farm.start_master({"--unit-time", "0.1", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  const std::string scene = (farm.folder().path() / "turn.xml").string();
  std::ofstream(scene) << R"(<scene version="3.0.0"><default name="frame" value="0"/><integrator type="path"/>
    <sensor type="perspective"><transform name="to_world"><translate z="-4"/></transform></sensor>
    <shape type="sphere"><transform name="to_world"><translate x="0.$frame"/></transform></shape>
    <emitter type="constant"/></scene>)";
  const std::vector<std::string> settings = {"--iterations", "64", "--size", "32x24"};
  std::vector<std::string> submit = {"submit", scene,           "--frames", "1-3",
                                     "-D",     "frame={frame}", "--name",   "turn.{frame}"};
  submit.insert(submit.end(), settings.begin(), settings.end());
  const CommandResult submitted = farm.candela(submit);
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  std::string group = submitted.out;
  while (!group.empty() && group.back() == '\n') group.pop_back();
  ASSERT_EQ(group[0], 'g') << submitted.out;

  std::vector<std::string> after = {"submit", scene, "--depends", group, "--name", "after"};
  after.insert(after.end(), settings.begin(), settings.end());
  const CommandResult waits = farm.candela(after);
  ASSERT_EQ(waits.exit_code, 0) << waits.err;

  const auto list = [&](const std::vector<std::string>& more) {
    std::vector<std::string> command = {"list", "--json"};
    command.insert(command.end(), more.begin(), more.end());
    return nlohmann::json::parse(farm.candela(command).out);
  };
  EXPECT_EQ(list({}).at("groups").size(), 1U);
  EXPECT_EQ(list({}).at("jobs").size(), 1U);
  EXPECT_EQ(list({group}).at("jobs").size(), static_cast<std::size_t>(kFrames));

  farm.start_worker("one");
  ASSERT_TRUE(eventually(60, [&] {
    const nlohmann::json listed = list({group});
    for (const auto& job : listed.at("jobs"))
      if (job.at("state") == "done") return true;
    return false;
  }));
  farm.kill_master();
  farm.restart_master();
  const std::string folder = farm.folder().path().string();
  const std::string told = folder + "/told";
  const std::string tell = "echo $CANDELA_JOB_ID $CANDELA_JOB_NAME $CANDELA_JOB_STATE >>" + told;
  EXPECT_EQ(farm.candela({"watch", group, "--quiet", "--on-end", tell}).exit_code, 0);
  EXPECT_EQ(farm.candela({"watch", "after", "--quiet", "--on-end", tell + "; exit 7"}).exit_code, 1);
  std::ifstream lines(told);
  std::string first, second;
  std::getline(lines, first);
  std::getline(lines, second);
  EXPECT_EQ(first, group + " turn done");
  EXPECT_TRUE(second.ends_with(" after done")) << second;

  const CommandResult fetched = farm.candela({"fetch", group, "-o", folder + "/turn.{frame:4}.exr"});
  ASSERT_EQ(fetched.exit_code, 0) << fetched.err;
  std::vector<image::Image> pictures;
  for (int frame = 1; frame <= kFrames; ++frame) {
    const std::string rendered = folder + "/alone.exr";
    std::vector<std::string> render = {
        "render", scene, "-o", rendered, "--quiet", "-D", "frame=" + std::to_string(frame)};
    render.insert(render.end(), settings.begin(), settings.end());
    const CommandResult alone = farm.candela_process(render);
    ASSERT_EQ(alone.exit_code, 0) << alone.err;
    const auto there = image::read_image(folder + "/turn.000" + std::to_string(frame) + ".exr");
    ASSERT_TRUE(there.ok()) << there.error().to_string();
    expect_identical(*there, *image::read_image(rendered), "frame " + std::to_string(frame));
    pictures.push_back(*there);
  }
  EXPECT_NE(pictures[0].rgb, pictures[2].rgb) << "the frames are one picture, which proves nothing";
}

}  // namespace
}  // namespace candela::farm
