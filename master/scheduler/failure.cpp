// See failure.h.
#include "master/scheduler/failure.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/rng/stream.h"

namespace candela::master {
namespace {

struct Wait {
  double first = 0, longest = 0;  // seconds
};
struct Waits {
  Wait unit, worker;
};

// By cause. Another worker may do at once what this one's disk or line could not; the unit's own wait is
// short then. What crashed a worker, or what the master lacks, is no better off elsewhere.
constexpr std::array<Waits, kFailureCauses> kWaits = {{
    {{0, 0}, {2, 60}},      // scene
    {{1, 60}, {1, 60}},     // worker
    {{0.5, 8}, {2, 60}},    // place
    {{0.5, 8}, {0.5, 60}},  // network
    {{1, 60}, {1, 60}},     // master
}};

constexpr std::size_t kWitnesses = 3;  // distinct workers, where there are so many

// The wait after the n-th failure, n from 1.
double wait_seconds(const Wait& wait, std::uint32_t n, std::uint64_t seed) {
  const double full = std::min(std::ldexp(wait.first, static_cast<int>(std::min(n, 32U)) - 1), wait.longest);
  const double u = static_cast<double>(rng::key(seed, n) >> 11) * 0x1p-53;
  return full * (0.75 + 0.5 * u);
}

std::uint64_t hash_of(std::string_view text) {
  std::uint64_t h = text.size();
  for (const char c : text) h = rng::key(h, static_cast<unsigned char>(c));
  return h;
}

}  // namespace

Consequence consequence(const FailureHistory& h, const FailurePolicy& policy) {
  const Waits& waits = kWaits[index_of(h.cause)];
  Consequence out;
  out.unit_wait = wait_seconds(waits.unit, h.of_unit, h.unit_id);
  out.worker_wait = wait_seconds(waits.worker, h.at_job, hash_of(h.worker_id));
  if (is_workers_own(h.cause) &&
      (h.own >= policy.max_worker_failures || h.own_jobs >= policy.max_worker_jobs))
    out.set_aside = std::min(
        std::ldexp(policy.first_set_aside_seconds, static_cast<int>(std::min(h.times_set_aside, 32U))),
        policy.set_aside_seconds);
  return out;
}

bool is_poison(const Evidence& unit, const FailurePolicy& policy) {
  const double most = policy.max_unit_failures;
  return (unit.failures >= most && unit.workers >= std::min(unit.able, kWitnesses)) ||
         unit.failures >= 2 * most;
}

}  // namespace candela::master
