#include "common/stages/prefixes.h"

#include <algorithm>

namespace candela {
namespace {

constexpr std::uint64_t kPart = 20;  // of a prefix, by which the next one is longer
constexpr std::uint64_t kMinStep = 16, kMinStepOfChains = 2;

}  // namespace

std::uint64_t prefix_after(std::uint64_t prefix, bool chains) {
  return prefix + std::max(chains ? kMinStepOfChains : kMinStep, prefix / kPart);
}

std::uint64_t prefix_of(std::uint64_t rounds, bool chains) {
  std::uint64_t prefix = kFirstPrefix;
  while (prefix < rounds) prefix = prefix_after(prefix, chains);
  return prefix;
}

// One lucky estimate does not end a job.
bool ends_at(const std::vector<DecidedPrefix>& decided, std::uint64_t prefix, double relmse) {
  constexpr std::uint64_t kGrowth = 10;  // in tenths: the last prefix has 11 for each 10 of the first
  for (auto it = decided.rbegin(); it != decided.rend(); ++it) {
    if (it->rounds > prefix) continue;
    if (!(it->relmse_upper <= relmse)) return false;  // NaN too
    if ((kGrowth + 1) * it->rounds <= kGrowth * prefix) return true;
  }
  return false;
}

}  // namespace candela
