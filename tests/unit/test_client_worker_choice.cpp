// Claim: a worker is found by its id, or by its name while one worker alone has it; an ambiguous name is one
// clear error.
#include <gtest/gtest.h>

#include "client/worker_choice.h"

namespace candela::client {
namespace {

v1::ListWorkersResponse fleet(std::initializer_list<std::array<const char*, 3>> rows) {
  v1::ListWorkersResponse response;
  for (const auto& [id, name, state] : rows) {
    auto& worker = *response.add_workers();
    worker.set_id(id);
    worker.set_name(name);
    worker.set_state(state);
  }
  return response;
}

TEST(WorkerChoice, ByIdOrName) {
  const auto workers = fleet({{"w1", "left", "busy"}, {"w2", "right", "idle"}, {"w3", "w1", "idle"}});
  EXPECT_EQ(*choose_worker(workers, "w2"), "w2");
  EXPECT_EQ(*choose_worker(workers, "right"), "w2");
  EXPECT_EQ(*choose_worker(workers, "w1"), "w1");  // an id goes before a name
  EXPECT_EQ(*choose_worker(workers, "nobody"), "nobody");
}

TEST(WorkerChoice, WorkersThatLeftHaveNoName) {
  const auto workers = fleet({{"w1", "pod", "lost"}, {"w2", "pod", "drained"}, {"w3", "pod", "busy"}});
  EXPECT_EQ(*choose_worker(workers, "pod"), "w3");
}

TEST(WorkerChoice, AnAmbiguousNameIsRefused) {
  const auto chosen = choose_worker(fleet({{"w1", "pod", "busy"}, {"w3", "pod", "idle"}}), "pod");
  ASSERT_FALSE(chosen);
  EXPECT_NE(chosen.error().to_string().find("w1, w3"), std::string::npos) << chosen.error().to_string();
}

}  // namespace
}  // namespace candela::client
