// The command that makes an image again, and lines of a shell.
#include <gtest/gtest.h>

#include "common/base/shell_words.h"
#include "common/job/render_command.h"

namespace candela {
namespace {

// Claim: a shell's line of any words is split into those words; what a shell would not take as it stands, or
// does not end, is refused.
TEST(ShellWords, SplitIsTheInverseOfALine) {
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"a", "b"},
        {"", "my scene's.xml", "'", "''", "\\", "a\\'b", " ", "$HOME;`rm`\"", "tab\there", "--set", "x=-1"},
        {}}) {
    const auto back = split_shell_line(shell_line(words));
    ASSERT_TRUE(back.ok()) << shell_line(words);
    EXPECT_EQ(*back, words);
  }
  for (const char* bad : {"'a", "a b$c", "a;b", "\"a\"", "a\\ b", "a\nb", "`a`"})
    EXPECT_FALSE(split_shell_line(bad).ok()) << bad;
}

RenderCommand example() {
  RenderCommand c;
  c.scene = "scenes/my box's.xml";
  c.parameters = {{"lamp", "0.5, 2"}, {"empty", ""}};
  c.settings.integrator = "vcm";
  c.settings.integrator_settings = {{"max_depth", "-1"}, {"techniques", "a, b=c"}};
  c.settings.width = 40;
  c.settings.height = 24;
  c.settings.filter = "tent";
  c.settings.sampler = "independent";
  c.settings.seed = 18446744073709551615U;
  c.settings.isa = "avx";
  c.settings.aovs = "albedo:albedo,d:depth";
  c.settings.layers = "layer a=L{my 'key'}[DGSV]*E; region b=box:0,0,0,1,1,1; partition";
  c.settings.edits = R"({"edits":[{"name":"a","direction":"light","select":"LX*X","tint":[0.5,0.5,0.5]}]})";
  c.indices = "0-31,40/none";
  return c;
}

void expect_equal(const RenderCommand& a, const RenderCommand& b) {
  EXPECT_EQ(a.scene, b.scene);
  EXPECT_EQ(a.parameters, b.parameters);
  EXPECT_EQ(a.settings.integrator, b.settings.integrator);
  EXPECT_EQ(a.settings.integrator_settings, b.settings.integrator_settings);
  EXPECT_EQ(a.settings.width, b.settings.width);
  EXPECT_EQ(a.settings.height, b.settings.height);
  EXPECT_EQ(a.settings.crop, b.settings.crop);
  EXPECT_EQ(a.settings.filter, b.settings.filter);
  EXPECT_EQ(a.settings.sampler, b.settings.sampler);
  EXPECT_EQ(a.settings.seed, b.settings.seed);
  EXPECT_EQ(a.settings.isa, b.settings.isa);
  EXPECT_EQ(a.settings.aovs, b.settings.aovs);
  EXPECT_EQ(a.settings.layers, b.settings.layers);
  EXPECT_EQ(a.settings.edits, b.settings.edits);
  EXPECT_EQ(a.indices, b.indices);
  EXPECT_EQ(a.half, b.half);
  EXPECT_EQ(a.estimator, b.estimator);
  EXPECT_EQ(a.error_layer, b.error_layer);
  EXPECT_EQ(a.variance_layer, b.variance_layer);
  EXPECT_EQ(a.chain_layers, b.chain_layers);
  EXPECT_EQ(a.state_layers, b.state_layers);
}

// Claim: a command is read back as it was, whatever its values, with and without layers, half and estimator;
// a scene whose name begins as an option does is named as a path.
TEST(RenderCommands, AreReadBack) {
  RenderCommand c = example();
  for (int form = 0; form < 2; ++form) {
    const auto back = parse_render_command(shell_line(words_of(c, "again.exr")));
    ASSERT_TRUE(back.ok()) << back.error().to_string();
    expect_equal(*back, c);
    c.settings.crop = Crop{100, 7, 1280, 720};
    c.settings.aovs.clear();
    c.settings.layers.clear();
    c.settings.edits.clear();
    c.half = "B";
    c.estimator = "plain";
    c.error_layer = c.chain_layers = true;
  }
  c = example();
  c.variance_layer = c.state_layers = true;
  const auto back = parse_render_command(shell_line(words_of(c, "again.exr")));
  ASSERT_TRUE(back.ok());
  expect_equal(*back, c);
  c.scene = "--page.xml";
  EXPECT_EQ(words_of(c, "x.exr")[2], "./--page.xml");
}

// Claim: a line with another command, another option, or an option without a value that can be read is no
// such command: an image from elsewhere makes nobody write files or open ports.
TEST(RenderCommands, OthersAreRefused) {
  const std::string good = shell_line(words_of(example(), "again.exr"));
  ASSERT_TRUE(parse_render_command(good).ok());
  for (const std::string& bad :
       {std::string(), std::string("candela"), "rm -rf " + good, good + " --page localhost:1",
        good + " --png /etc/passwd", good + " --seed", good + " --seed x", good + " --size 0x4",
        good + " --crop 1,2,3", good + " --crop 1,2,3,4,5", good + " --crop 1,2,3,x", good + " extra",
        good + "; true", std::string("candela submit s.xml --size 4x4 --indices 0/0"),
        std::string("candela render s.xml --size 4x4"), std::string("candela render s.xml --indices 0/0")})
    EXPECT_FALSE(parse_render_command(bad).ok()) << bad;
}

}  // namespace
}  // namespace candela
