// Maps of `candela inspect sphere` made by jobs on a farm.
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

std::vector<std::string> sphere_of(const std::string& file, const std::vector<std::string>& more) {
  std::vector<std::string> words = {"inspect", "sphere",      scene_path("cornell"),
                                    "--at",    "0.2,0.9,0.1", "--radius",
                                    "0.1",     "--map-size",  "48x24",
                                    "--spp",   "60",          "--seed",
                                    "7",       "-o",          file,
                                    "--json"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class InspectOnFarm : public testing::TestWithParam<std::vector<std::string>> {};

// Claim: the map of a job has the same bytes with one worker, and with three of which one is killed together
// with the master; and its integral is that of the map that one machine makes without a farm.
TEST_P(InspectOnFarm, MapsAreTheSameOfAnyWorkers) {
  Farm farm;
  const auto path = [&](const std::string& name) { return (farm.folder().path() / name).string(); };
  const auto bytes = [&](const std::string& name) { return *read_file(path(name), std::uint64_t{1} << 30); };
  farm.start_master({"--unit-time", "0.02", "--checkpoint-interval", "0.05", "--lease-time", "2"});
  Process& victim = farm.start_worker("victim");
  std::vector<std::string> more = GetParam();
  const CommandResult here = farm.candela(sphere_of(path("here.exr"), more));
  ASSERT_EQ(here.exit_code, 0) << here.err;
  more.insert(more.end(), {"--master", farm.address(), "--quiet"});
  const CommandResult one = farm.candela(sphere_of(path("one.exr"), more));
  ASSERT_EQ(one.exit_code, 0) << one.err;

  farm.start_worker("second");
  farm.start_worker("third");
  const auto three = farm.start_candela(sphere_of(path("three.exr"), more), "three");
  const auto job = [&] {
    const std::string said = three->err();
    const std::size_t at = said.find("candela: job ");
    return at == std::string::npos ? std::string() : said.substr(at + 13, said.find('\n', at) - at - 13);
  };
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
    return !job().empty() && farm.job(job()).iterations() > 0;
  })) << three->err();
  farm.kill_master();
  victim.kill();
  farm.restart_master();
  ASSERT_EQ(three->wait(kPatienceSeconds).value_or(-1), 0) << three->err();
  farm.audit(job(), 60);
  EXPECT_EQ(bytes("three.exr"), bytes("one.exr"));

  const auto local = nlohmann::json::parse(here.out), remote = nlohmann::json::parse(one.out);
  for (const char* integral : {"fluence", "irradiance"}) {
    ASSERT_EQ(local[integral].is_null(), remote[integral].is_null());
    if (local[integral].is_null()) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      const double expected = local[integral][c];
      EXPECT_NEAR(remote[integral][c].get<double>(), expected, 0.05 * expected) << integral << ' ' << c;
      EXPECT_GT(expected, 0);
    }
  }
  EXPECT_EQ(remote["not_finite"], 0);
}
INSTANTIATE_TEST_SUITE_P(, InspectOnFarm,
                         testing::Values(std::vector<std::string>{},
                                         std::vector<std::string>{"--select", "LX+E"}),
                         [](const auto& one) { return one.param.empty() ? "all" : "selected"; });

// Claim: a disk on the surface that a pixel shows, with edits, has on a farm the irradiance that it has
// without.
TEST(InspectFarm, DisksHaveTheirIrradiance) {
  Farm farm;
  farm.start_master_here();
  farm.start_worker_here("one", 2);
  std::vector<std::string> words = {
      "inspect",
      "sphere",
      scene_path("cornell"),
      "--pixel",
      "20,26",
      "--size",
      "48x32",
      "--disc",
      "--map-size",
      "64x32",
      "--spp",
      "64",
      "-o",
      (farm.folder().path() / "d.exr").string(),
      "--json",
      "--edits",
      R"({"edits": [{"name": "a", "direction": "light", "select": "LX*X", "tint": [1, 0.5, 0.25]}]})"};
  const CommandResult here = farm.candela(words);
  ASSERT_EQ(here.exit_code, 0) << here.err;
  words.insert(words.end(), {"--master", farm.address(), "--quiet"});
  const CommandResult there = farm.candela(words);
  ASSERT_EQ(there.exit_code, 0) << there.err;
  const auto local = nlohmann::json::parse(here.out), remote = nlohmann::json::parse(there.out);
  for (std::size_t c = 0; c < 3; ++c) {
    const double expected = local["irradiance"][c];
    EXPECT_NEAR(remote["irradiance"][c].get<double>(), expected, 0.05 * expected) << c;
    EXPECT_GT(expected, 0);
  }
}

}  // namespace
}  // namespace candela::farm
