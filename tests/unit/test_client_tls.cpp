// candela tls: certificates by one command.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "client/embedded/app.h"
#include "common/wire/certificates.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

class ClientTls : public CommandTest {
 protected:
  Outcome tls(std::vector<std::string> words) const {
    words.insert(words.begin(), {"candela", "tls"});
    words.insert(words.end(), {"--folder", files_.string()});
    std::ostringstream out, err;
    const int code = run_program(words, out, err);
    return {code, out.str(), err.str()};
  }
  std::set<std::string> names() const {
    std::set<std::string> found;
    if (fs::exists(files_))
      for (const auto& entry : fs::directory_iterator(files_)) found.insert(entry.path().filename());
    return found;
  }
  wire::Holder holder(const std::string& name) const {
    const auto loaded =
        wire::load_credentials({(files_ / (name + ".pem")).string(), (files_ / (name + ".key")).string(),
                                (files_ / "ca.pem").string()});
    EXPECT_TRUE(loaded.ok()) << loaded.error().to_string();
    return loaded.ok() ? loaded->holder : wire::Holder{};
  }

  fs::path files_ = folder_.path() / "tls";
};

// Claim: `init` makes an authority and the certificates of master, worker and people, with their roles; `add`
// makes more of them.
TEST_F(ClientTls, MakesAFarmsCertificates) {
  const Outcome made = tls({"init", "render.example.org", "10.0.0.5", "::1", "--person", "alice=operate",
                            "--person", "bob=submit,worker"});
  ASSERT_EQ(made.code, 0) << made.err;
  EXPECT_EQ(names(), (std::set<std::string>{"ca.pem", "ca.key", "master.pem", "master.key", "worker.pem",
                                            "worker.key", "alice.pem", "alice.key", "bob.pem", "bob.key"}));
  EXPECT_TRUE(holder("master").roles.empty());
  EXPECT_EQ(holder("worker").roles, wire::Roles({wire::Role::worker}));
  EXPECT_EQ(holder("alice").roles, wire::Roles({wire::Role::operate}));
  EXPECT_EQ(holder("bob").roles, wire::Roles({wire::Role::submit, wire::Role::worker}));
  ASSERT_EQ(tls({"add", "carol", "dave", "--role", "read"}).code, 0);
  EXPECT_EQ(holder("dave").name, "dave");
  EXPECT_EQ(holder("dave").roles, wire::Roles({wire::Role::read}));
}

// Claim: what cannot be done is refused before a file is made: a name twice or with a path in it, a host with
// a port, an unknown role, an option of the other action, an authority that is there or that is not there.
TEST_F(ClientTls, RefusesBeforeItMakes) {
  const std::vector<std::vector<std::string>> bad = {{"init", "host", "--person", "alice"},
                                                     {"init", "host", "--person", "alice=admin"},
                                                     {"init", "host", "--person", "worker=submit"},
                                                     {"init", "host", "--person", "../alice=submit"},
                                                     {"init", "host", "--person", "ca=submit"},
                                                     {"init", "host:7070"},
                                                     {"init", "a host"},
                                                     {"init", "host,IP:1.2.3.4"},
                                                     {"init"},
                                                     {"init", "host", "--role", "submit"},
                                                     {"init", "host", "--days", "0"},
                                                     {"add", "alice", "--role", "submit"},
                                                     {"add", "alice"},
                                                     {"remove", "alice"}};
  for (const auto& words : bad) {
    const Outcome outcome = tls(words);
    EXPECT_EQ(outcome.code, 2) << testing::PrintToString(words) << outcome.err;
    EXPECT_TRUE(names().empty()) << testing::PrintToString(words);
  }
  ASSERT_EQ(tls({"init", "host", "--person", "alice=submit"}).code, 0);
  const std::set<std::string> before = names();
  EXPECT_EQ(tls({"init", "host", "--person", "bob=submit"}).code, 1);
  EXPECT_EQ(tls({"add", "carol", "alice", "--role", "operate"}).code, 1);
  EXPECT_EQ(names(), before);
}

}  // namespace
}  // namespace candela::client
