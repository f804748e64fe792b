// Why a unit of work failed. Whoever sees the failure names its cause once, where it arises; the cause alone
// decides what follows (master/scheduler/failure.h, docs/failures.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace candela {

enum class FailureCause : std::uint8_t {
  scene,    // the input itself cannot be rendered, here or anywhere: the unit fails the same way each time
  worker,   // the worker's program or memory: a crash, an exception, a bug
  place,    // the worker's disk, cache or permissions
  network,  // the transport: calls that break, bytes that changed on the way
  master,   // the master's own files: it lacks what the unit needs, and no worker can help it
};
inline constexpr std::size_t kFailureCauses = 5;
inline constexpr std::array<FailureCause, kFailureCauses> kAllFailureCauses = {
    FailureCause::scene, FailureCause::worker, FailureCause::place, FailureCause::network,
    FailureCause::master};

// Number of failures by cause; index: the cause.
using FailureCounts = std::array<std::uint64_t, kFailureCauses>;

constexpr std::size_t index_of(FailureCause cause) {
  return static_cast<std::size_t>(cause);
}

// "scene", "worker", "place", "network", "master".
constexpr std::string_view name(FailureCause cause) {
  constexpr std::array<std::string_view, kFailureCauses> kNames = {"scene", "worker", "place", "network",
                                                                   "master"};
  return kNames[index_of(cause)];
}

}  // namespace candela
