// candela doctor: its judgements, and what it says of a machine with and without a farm.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/doctor/checks.h"
#include "client/embedded/app.h"
#include "master/master.h"
#include "tests/farm/certificates.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;
using State = Diagnosis::State;

class Doctor : public CommandTest {
 protected:
  Outcome run(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"doctor"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_candela(arguments);
  }
  // Its checks by name.
  std::map<std::string, nlohmann::json> report(std::vector<std::string> more, int code) const {
    more.push_back("--json");
    const Outcome outcome = run(more);
    EXPECT_EQ(outcome.code, code) << outcome.out << outcome.err;
    const auto json = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(json.at("fit"), code == 0);
    std::map<std::string, nlohmann::json> checks;
    for (const auto& check : json.at("checks")) checks[check.at("name")] = check;
    return checks;
  }
};

// Claim: what is less than it should be is a warning or broken, and says what to do.
TEST(DoctorChecks, Judge) {
  constexpr std::uint64_t gib = 1ULL << 30;
  const std::string meminfo = "MemTotal:       16777216 kB\nMemFree: 1 kB\nMemAvailable:    8388608 kB\n";
  const Memory whole = read_memory(meminfo, std::nullopt, 0);
  EXPECT_EQ(whole.total, 16 * gib);
  EXPECT_EQ(whole.available, 8 * gib);
  const Memory limited = read_memory(meminfo, 4 * gib, 3 * gib + gib / 2);
  EXPECT_EQ(limited.total, 4 * gib);
  EXPECT_EQ(limited.available, gib / 2);
  EXPECT_EQ(check_memory(whole).state, State::ok);
  EXPECT_EQ(check_memory(limited).state, State::warning);
  EXPECT_EQ(check_memory(read_memory("", std::nullopt, 0)).state, State::skipped);

  EXPECT_EQ(check_expiry("certificate", 100, "x").state, State::ok);
  EXPECT_EQ(check_expiry("certificate", 29, "x").state, State::warning);
  EXPECT_EQ(check_expiry("certificate", -0.1, "x").state, State::broken);

  EXPECT_EQ(check_clock(4, 0).state, State::ok);
  EXPECT_EQ(check_clock(-6, 0).state, State::warning);
  EXPECT_EQ(check_clock(-6, 2).state, State::ok) << "it may be the way";
  EXPECT_EQ(check_clock(400, 0).state, State::broken);
  EXPECT_EQ(check_processor({"sse2", "avx"}).state, State::warning);
  EXPECT_NE(check_processor({"sse2", "avx"}).mend.find("--isa avx"), std::string::npos);
}

// Claim: a folder that will be created is judged by its parent; one that cannot be is broken if the user
// named it.
TEST_F(Doctor, Folders) {
  const fs::path absent = folder_.path() / "a" / "b";
  EXPECT_NE(check_folder("data folder", absent, true).state, State::broken);
  EXPECT_NE(check_folder("data folder", absent, true).text.find("it will be created"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder_.path() / "a"));
  const fs::path file = folder_.path() / "config.toml";
  EXPECT_EQ(check_folder("data folder", file, true).state, State::broken);
  EXPECT_EQ(check_folder("data folder", file / "x", false).state, State::warning);
  EXPECT_EQ(report({"--data", file.string()}, 1).at("data folder").at("state"), "broken");
}

// Claim: without a farm everything of this machine is told, and nothing is broken for want of a master; a
// master that is named and does not answer is, and so is a configuration that nobody understands.
TEST_F(Doctor, WithoutAFarm) {
  const auto alone = report({"--cache", (folder_.path() / "cache").string()}, 0);
  for (const char* name :
       {"program", "system", "processor", "memory", "open files", "images", "cache folder", "master"})
    ASSERT_TRUE(alone.contains(name)) << name;
  EXPECT_EQ(alone.at("master").at("state"), "skipped");
  EXPECT_FALSE(alone.contains("data folder"));
  const Outcome text = run({});
  EXPECT_TRUE(text.out.starts_with("ok       program       candela ")) << text.out;

  const auto nobody = report({"--master", "127.0.0.1:1", "--timeout", "300ms"}, 1);
  EXPECT_EQ(nobody.at("master").at("state"), "broken");
  EXPECT_NE(nobody.at("master").at("mend"), "");

  std::ofstream(folder_.path() / "config.toml") << "mastre = 'x:1'\n";
  const auto misspelt = report({}, 1);
  EXPECT_EQ(misspelt.at("configuration").at("state"), "broken");
  EXPECT_NE(misspelt.at("configuration").at("text").get<std::string>().find("did you mean"),
            std::string::npos);
}

// Claim: a master that answers is told with its build, its clock and its workers, by the wire and over TLS;
// certificates that expire soon, and those of another authority, are warned of.
TEST_F(Doctor, WithAFarm) {
  const farm::Certificates certificates(folder_.path());
  if (!certificates.made()) GTEST_SKIP() << "the openssl command cannot make certificates";
  master::MasterOptions options;
  options.data_dir = folder_.path() / "data";
  options.listen = "127.0.0.1:0";
  options.tls_cert = certificates.file("server.pem");
  options.tls_key = certificates.file("server.key");
  options.tls_ca = certificates.file("ca.pem");
  auto master = master::Master::start(options);
  ASSERT_TRUE(master.ok()) << master.error().to_string();
  std::vector<std::string> arguments = {"--master", "127.0.0.1:" + std::to_string((*master)->port()),
                                        "--timeout", "20s"};
  const auto with = [&](const std::string& name) {
    auto all = arguments;
    for (const std::string& word : certificates.options(name)) all.push_back(word);
    return all;
  };
  const auto fit = report(with("client"), 0);
  EXPECT_EQ(fit.at("master").at("state"), "ok");
  EXPECT_EQ(fit.at("clock").at("state"), "ok");
  EXPECT_EQ(fit.at("workers").at("state"), "warning") << "there is none";
  EXPECT_EQ(fit.at("certificate").at("state"), "warning") << "it is good for two days";
  EXPECT_NE(fit.at("certificate").at("text").get<std::string>().find("in 2 days"), std::string::npos);
  EXPECT_EQ(fit.at("authority").at("state"), "warning");
  EXPECT_EQ(fit.at("signature").at("state"), "ok");
  auto strange = with("stranger");
  strange[3] = "300ms";
  const auto refused = report(strange, 1);
  EXPECT_EQ(refused.at("signature").at("state"), "warning");
  EXPECT_EQ(refused.at("master").at("state"), "broken");
}

}  // namespace
}  // namespace candela::client
