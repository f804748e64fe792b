// upbp in fog on a farm: every worker runs the pilot by itself, which chooses techniques and numbers of beams
// and counts the hits that weights expect. The image is one all the same.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

class Media : public testing::TestWithParam<std::string> {};

// Claim: the pixels do not depend on how many workers there are, nor on their threads, nor on the death of
// one of them and of the master.
TEST_P(Media, WorkersAndKillsChangeNothing) {
  const std::uint64_t iterations = long_form() ? 401 : 151;
  const std::string scene = "tests/statistical/transport/fog-camera.xml";
  const std::vector<std::string> options = {"--integrator", "upbp", "--set", "techniques=" + GetParam()};
  Farm farm;
  farm.start_master({"--unit-time", "0.1", "--checkpoint-interval", "0.1", "--lease-time", "1"});
  Process& victim = farm.start_worker("victim");
  farm.start_worker("other", 2);
  const std::string id = farm.submit(iterations, scene, options);
  farm.wait_for_iterations(id, 1);
  victim.kill();
  farm.start_worker("heir");
  farm.kill_master();
  farm.restart_master();
  ASSERT_EQ(farm.job(id).state(), v1::JOB_STATE_RUNNING) << "the job ended too soon: make it longer";
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(iterations, scene, options), "farm and `candela render`");
  farm.audit(id, iterations);
}

// One that chooses all; in the long form one that chooses beams, and one that has nothing to choose.
std::vector<std::string> choices() {
  return long_form() ? std::vector<std::string>{"auto", "all", "pp3d,pb2d"}
                     : std::vector<std::string>{"auto"};
}
INSTANTIATE_TEST_SUITE_P(, Media, testing::ValuesIn(choices()), [](const auto& one) {
  std::string name = one.param;
  std::replace(name.begin(), name.end(), ',', '_');
  return name;
});

}  // namespace
}  // namespace candela::farm
