// Names of scenes, patterns of file names, frames, tables, and words that mean jobs.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "client/commands/job_tables.h"
#include "client/commands/watch_many.h"
#include "client/embedded/commands.h"
#include "client/frames.h"
#include "client/jobs_of_words.h"
#include "client/scene_name.h"
#include "client/submission.h"
#include "client/table.h"
#include "common/base/log.h"
#include "master/master.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

// Claim: a job is named after its scene's file, or after the folder if the file's name says nothing.
TEST(SceneNames, AreThoseThatPeopleUse) {
  EXPECT_EQ(scene_name("/shows/kitchen/scene.xml"), "kitchen");
  EXPECT_EQ(scene_name("/shows/kitchen/Scene_v3.xml"), "kitchen");
  EXPECT_EQ(scene_name("/shows/kitchen/scene.0012.xml"), "kitchen");
  EXPECT_EQ(scene_name("/shows/kitchen/main.pbrt"), "kitchen");
  EXPECT_EQ(scene_name("/shows/kitchen/table.xml"), "table");
  EXPECT_EQ(scene_name("/shows/scenes/scene.xml"), "scene");
  EXPECT_EQ(scene_name("/scene.xml"), "scene");
  EXPECT_EQ(scene_name("/shows/seq010/s0.pbrt"), "s0");
  EXPECT_EQ(scene_name("/shows/" + std::string(300, 'x') + "/scene.xml"), std::string(256, 'x'));
}

// Claim: a name becomes a file of the present folder that is neither hidden nor an option.
TEST(SceneNames, AsFileNames) {
  EXPECT_EQ(file_name_of("seq010/shot"), "seq010_shot");
  EXPECT_EQ(file_name_of("../x"), "_.._x");
  EXPECT_EQ(file_name_of("-o"), "_-o");
  EXPECT_EQ(file_name_of(""), "_");
}

// Claim: patterns have the frame with as many zeros as they ask for, and words by name; other braces stay.
TEST(Patterns, AreFilled) {
  const auto fill = [](std::string_view text, std::optional<std::int64_t> frame) {
    return *fill_pattern(text, {{"name", "box"}, {"id", "j1"}}, frame, "-o");
  };
  EXPECT_EQ(fill("out.{frame}.exr", 7), "out.7.exr");
  EXPECT_EQ(fill("out.{frame:4}.exr", 7), "out.0007.exr");
  EXPECT_EQ(fill("out.{frame:04}.exr", 12345), "out.12345.exr");
  EXPECT_EQ(fill("{name}/{id}.{frame}", std::nullopt), "box/j1.{frame}");
  EXPECT_EQ(fill("{other} {", 3), "{other} {");
  const auto bad = fill_pattern("{frame:x}", {}, 3, "-o");
  ASSERT_FALSE(bad.ok());
  EXPECT_EQ(bad.error().field, "-o");
}

// Claim: ranges of frames have every frame once, in the order given; what is none is an error.
TEST(Frames, Ranges) {
  using Numbers = std::vector<std::int32_t>;
  EXPECT_EQ(*parse_frames("1-4", "--frames"), (Numbers{1, 2, 3, 4}));
  EXPECT_EQ(*parse_frames("1-8x3", "--frames"), (Numbers{1, 4, 7}));
  EXPECT_EQ(*parse_frames("9,1-3,2", "--frames"), (Numbers{9, 1, 2, 3}));
  EXPECT_EQ(parse_frames("1-10000", "--frames")->size(), 10000U);
  for (const char* wrong : {"", "1-", "-3", "3-1", "1-4x0", "4x2", "a", "1,,2", "0-10000", "1-999999999999"})
    EXPECT_FALSE(parse_frames(wrong, "--frames").ok()) << wrong;
}

TEST(Frames, NamesOfGroups) {
  EXPECT_EQ(group_name_of("shot.{frame}"), "shot");
  EXPECT_EQ(group_name_of("seq_{frame:4}_beauty"), "seq.beauty");
  EXPECT_EQ(group_name_of("shot"), "shot");
  EXPECT_EQ(group_name_of("{frame}"), "");
}

// Claim: columns are as wide as their widest cell, in characters, and numbers end below each other.
TEST(Tables, Align) {
  Table table({"ID", ">N", "NAME"});
  table.add({"j1", "7", "é"});
  table.add({"j22", "1234", "x"});
  EXPECT_EQ(table.text(), "ID      N  NAME\nj1      7  é\nj22  1234  x\n");
}

// A farm without workers, in this process.
class JobWords : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    std::ofstream(scene_) << "<scene version='3.0.0'><default name='frame' value='0'/>"
                             "<integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
                             "<integer name='width' value='8'/><integer name='height' value='8'/></film>"
                             "<sampler type='independent'><integer name='seed' value='$frame'/></sampler>"
                             "</sensor><emitter type='constant'/></scene>";
    ASSERT_TRUE(log::initialise("test", "off", "text").ok());
    master::MasterOptions o;
    o.data_dir = folder_.path() / "farm";
    o.listen.clear();
    auto started = master::Master::start(o);
    ASSERT_TRUE(started.ok()) << started.error().to_string();
    master_ = std::move(*started);
    farm_ = FarmClient::over(master_->in_process_channel(), 30);
  }
  Submitted submit(const std::string& name, std::optional<int> frame = {}) {
    SceneOptions options;
    options.scene = scene_.string();
    if (frame) options.defines = {"frame=" + std::to_string(*frame)};
    auto scene = load_scene(options, renderer_facts());
    EXPECT_TRUE(scene.ok()) << scene.error().to_string();
    Submission submission;
    submission.name = name;
    if (frame) {
      submission.frame.emplace();
      submission.frame->set_group_name("shot");
      submission.frame->set_group_token("token");
      submission.frame->set_frame(*frame);
      submission.frame->set_frames(2);
    }
    std::ostringstream err;
    ProgressLine progress(err, ProgressLine::Mode::quiet);
    auto submitted = submit_scene(*farm_, *scene, renderer_facts(), submission, progress);
    EXPECT_TRUE(submitted.ok()) << submitted.error().to_string();
    return *submitted;
  }
  std::string meant(const std::string& word) {
    const auto jobs = jobs_of_words(*farm_, {word});
    return jobs.ok() ? jobs->front().id() : "error: " + jobs.error().to_string();
  }

  const fs::path scene_ = folder_.path() / "scene.xml";
  std::unique_ptr<master::Master> master_;
  std::unique_ptr<FarmClient> farm_;
};

// Claim: a job is meant by its id, by a beginning that no other has, and by a name that no other has; a word
// that may be several is an error that lists them, and so is one that is none.
TEST_F(JobWords, IdsPrefixesAndNames) {
  const std::string a = submit("kitchen").job_id, b = submit("kitchen").job_id, c = submit("bath").job_id;
  EXPECT_EQ(meant(a), a);
  const auto status = farm_->get_job(b);
  ASSERT_TRUE(status.ok());
  EXPECT_LT(status->short_id().size(), b.size());
  EXPECT_EQ(meant(status->short_id()), b);
  EXPECT_EQ(meant("bath"), c);
  const std::string several = meant("kitchen");
  EXPECT_NE(several.find("'kitchen' may be 2 jobs"), std::string::npos) << several;
  EXPECT_NE(several.find(status->short_id()), std::string::npos) << several;
  EXPECT_NE(several.find(a.substr(0, 5)), std::string::npos) << several;
  EXPECT_NE(meant("j").find("there is no job 'j'"), std::string::npos);
  EXPECT_NE(meant("attic").find("there is no job 'attic'"), std::string::npos);
  const auto twice = jobs_of_words(*farm_, {"bath", c, status->short_id()});
  ASSERT_TRUE(twice.ok());
  EXPECT_EQ(twice->size(), 2U) << "each job once";
}

// Claim: frames of one token are one group, whose name and id mean it; the list shows one row, and its frames
// where asked; all frames are steered by one call.
TEST_F(JobWords, Groups) {
  submit("lone");
  const Submitted first = submit("shot.1", 1), second = submit("shot.2", 2);
  EXPECT_EQ(first.group_id, second.group_id);
  EXPECT_EQ(second.uploaded_bytes, 0U) << "the frames share their scene";
  EXPECT_EQ(meant("shot"), first.group_id);
  EXPECT_EQ(meant("shot.2"), second.job_id);
  EXPECT_FALSE(job_of_word(*farm_, "shot").ok());
  const auto folded = farm_->list_jobs({.fold = true});
  ASSERT_TRUE(folded.ok());
  EXPECT_EQ(folded->total(), 2U);
  ASSERT_EQ(folded->groups_size(), 1);
  EXPECT_EQ(folded->groups(0).frames(), 2U);
  const std::string table = job_table(*folded);
  EXPECT_NE(table.find("shot: frames 1 to 2, 2 queued"), std::string::npos) << table;
  EXPECT_EQ(table.find("shot.1"), std::string::npos) << table;
  const auto frames = farm_->list_jobs({.group_id = first.group_id});
  ASSERT_TRUE(frames.ok());
  EXPECT_EQ(frames->jobs_size(), 2);
  v1::SteerGroupRequest cancel;
  cancel.set_group_id(first.group_id);
  cancel.set_action(v1::SteerGroupRequest::ACTION_CANCEL);
  const auto cancelled = farm_->steer_group(cancel);
  ASSERT_TRUE(cancelled.ok()) << cancelled.error().to_string();
  EXPECT_EQ(cancelled->state(), v1::JOB_STATE_CANCELLED);
  for (const Submitted& frame : {first, second})
    EXPECT_EQ(farm_->get_job(frame.job_id)->state(), v1::JOB_STATE_CANCELLED);
  std::ostringstream out, err;
  Context context{out, err, renderer_facts(), {}, {}};
  v1::JobName group;
  group.set_id(first.group_id);
  group.set_group(true);
  std::vector<EndedJob> ended;
  const auto waited = wait_for_jobs(context, *farm_, {group}, true, false, ended);
  ASSERT_TRUE(waited.ok());
  EXPECT_EQ(*waited, 1) << "no frame is done";
  ASSERT_EQ(ended.size(), 1U);
}

// Claim: images of several jobs are asked for only if each has a file of its own.
TEST_F(JobWords, SeveralImagesNeedSeveralNames) {
  submit("shot.1", 1);
  submit("shot.2", 2);
  std::ostringstream out, err;
  Context context{out, err, renderer_facts(), {}, {}};
  const auto jobs = jobs_of_words(*farm_, {"shot"});
  ASSERT_TRUE(jobs.ok());
  const std::string folder = folder_.path().string();
  const auto one = fetch_jobs(context, *farm_, *jobs, {folder + "/x.exr", {}, {}});
  ASSERT_FALSE(one.ok());
  EXPECT_NE(one.error().to_string().find("several jobs would be written to"), std::string::npos);
  // Nothing is merged yet, which each of them says.
  const auto each = fetch_jobs(context, *farm_, *jobs, {folder + "/x.{frame:3}.exr", {}, {}});
  ASSERT_TRUE(each.ok()) << each.error().to_string();
  EXPECT_NE(*each, 0);
  EXPECT_NE(err.str().find("wrote the images of 0 of 2 jobs"), std::string::npos) << err.str();
}

}  // namespace
}  // namespace candela::client
