// Who may do what, as users of one machine and people of a farm meet it.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "tests/farm/farm.h"
#include "tests/paths.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

// A client or worker of another user has this: no token, and no way to the master's.
std::map<std::string, std::string> environment_of(const Farm& farm, const fs::path& home) {
  auto all = farm.environment();
  all.erase("CANDELA_TOKEN_FILE");
  all["HOME"] = home.string();
  return all;
}

class Users : public testing::Test {
 protected:
  // `candela` or `candela-worker` with these words; its exit code. What it says goes to `said_`.
  int run(const std::string& program, std::vector<std::string> words, const fs::path& home) {
    words.insert(words.begin(), test::program_path(program));
    Process process(words, farm_.folder() / fmt::format("user-{}", ++serial_), environment_of(farm_, home));
    const int code = process.wait(kPatienceSeconds).value_or(-1);
    said_ = process.err() + process.out();
    return code;
  }
  void expect_said(const std::string& text) const {
    EXPECT_NE(said_.find(text), std::string::npos) << text << "\n" << said_;
  }

  Farm farm_;
  std::string said_;
  int serial_ = 0;
};

// Claim: programs of the master's user find its token without being told. Those of another user, who has no
// token, or a wrong one, get one error that names role, file and mend: they neither see jobs nor submit nor
// cancel nor work. With a copy of the token they do.
TEST_F(Users, NeedTheToken) {
  farm_.start_master();
  const std::string id = farm_.submit(4);
  const fs::path own = farm_.folder().path(), other = own / "other-user";
  fs::create_directories(other);
  EXPECT_EQ(run("candela", {"show", id}, own), 0) << said_;
  expect_said("submitter     ");
  expect_said("@");
  farm_.start_worker("own");
  farm_.wait_for(id, v1::JOB_STATE_DONE);

  const std::string cache = (other / "cache").string();
  const std::vector<std::pair<std::string, std::vector<std::string>>> attempts = {
      {"candela", {"list"}},
      {"candela", {"fetch", id, "-o", (other / "stolen.exr").string()}},
      {"candela", {"cancel", id}},
      {"candela", {"submit", scene_path("cornell"), "--iterations", "4"}},
      {"candela-worker", {"--cache", cache, "--name", "stranger"}}};
  std::ofstream(other / "wrong") << std::string(64, 'a');
  ASSERT_EQ(::chmod((other / "wrong").c_str(), 0600), 0);
  for (const bool wrong : {false, true})
    for (auto [program, words] : attempts) {
      if (wrong) words.insert(words.end(), {"--token-file", (other / "wrong").string()});
      EXPECT_EQ(run(program, words, other), 1) << said_;
      expect_said("' is missing: the call carries ");
      expect_said(wrong ? "a token that is not this master's" : "no token of this master");
      expect_said(farm_.token_file());
    }
  EXPECT_FALSE(fs::exists(other / "stolen.exr"));
  EXPECT_TRUE(farm_.worker("stranger").id().empty());

  fs::copy_file(farm_.token_file(), other / "copy");
  ASSERT_EQ(::chmod((other / "copy").c_str(), 0600), 0);
  EXPECT_EQ(run("candela", {"list", "--token-file", (other / "copy").string()}, other), 0) << said_;
  ASSERT_EQ(::chmod((other / "copy").c_str(), 0644), 0);
  EXPECT_EQ(run("candela", {"list", "--token-file", (other / "copy").string()}, other), 2) << said_;
  expect_said("every user of this machine can read or write the token");
}

// Claim: certificates that one command makes run a farm: the worker's works, a person's submits and cancels,
// another's does neither to that job, and a job tells its submitter in lists, by itself, and as JSON.
TEST(Certificates, OfOneCommandRunAFarm) {
  Farm farm;
  const fs::path tls = farm.folder().path() / "tls";
  const auto made =
      farm.candela({"tls", "init", "127.0.0.1", "localhost", "--folder", tls.string(), "--person",
                    "alice=submit", "--person", "bob=submit", "--person", "olga=operate"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto files = [&](const std::string& name) -> std::vector<std::string> {
    return {"--tls-cert", (tls / (name + ".pem")).string(), "--tls-key", (tls / (name + ".key")).string(),
            "--tls-ca",   (tls / "ca.pem").string()};
  };
  const auto as = [&](const std::string& name, std::vector<std::string> words) {
    for (const std::string& word : files(name)) words.push_back(word);
    return farm.candela(std::move(words));
  };
  farm.start_master(files("master"));
  const auto submitted = as("alice", {"submit", scene_path("cornell"), "--size", "48x32", "--spp", "100000"});
  ASSERT_EQ(submitted.exit_code, 0) << submitted.err;
  const std::string id = submitted.out.substr(0, submitted.out.size() - 1);
  farm.start_worker("node", 1, files("worker"));
  Process& person = farm.start_worker("person", 1, files("alice"));
  EXPECT_EQ(person.wait(kPatienceSeconds).value_or(-1), 1);
  EXPECT_NE(person.err().find("role 'worker' is missing"), std::string::npos) << person.err();

  EXPECT_NE(as("bob", {"list"}).out.find(" alice "), std::string::npos);
  EXPECT_NE(as("bob", {"show", id}).out.find("submitter     alice\n"), std::string::npos);
  EXPECT_NE(as("bob", {"show", id, "--json"}).out.find("\"submitter\": \"alice\""), std::string::npos);
  const auto refused = as("bob", {"cancel", id});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.err.find("role 'operate' is missing"), std::string::npos) << refused.err;
  EXPECT_EQ(as("worker", {"list"}).exit_code, 1);
  EXPECT_EQ(as("worker", {"workers"}).exit_code, 0);
  EXPECT_EQ(as("olga", {"priority", id, "3"}).exit_code, 0);
  EXPECT_TRUE(eventually(kPatienceSeconds, [&] {
    return as("bob", {"show", id, "--json"}).out.find("\"state\": \"running\"") != std::string::npos;
  }));
  EXPECT_EQ(as("alice", {"cancel", id}).exit_code, 0);
}

}  // namespace
}  // namespace candela::farm
