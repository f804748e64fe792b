#include "worker/integrators/chains/effort.h"

#include <algorithm>
#include <string>

namespace candela::integrators::chain_jobs {

SettingsMap settings_of_effort(const Effort& effort, const ChainSettings& defaults) {
  const ChainSettings& most = defaults;  // of a large job
  const auto longest = static_cast<std::uint64_t>(most.mutations),
             most_chains = static_cast<std::uint64_t>(most.chains),
             largest = static_cast<std::uint64_t>(most.bootstrap);
  std::uint64_t mutations = longest;
  if (effort.spp > 0) {
    const std::uint64_t rounds = effort.spp / longest + (effort.spp % longest == 0 ? 0 : 1);
    mutations = effort.spp / rounds + (effort.spp % rounds == 0 ? 0 : 1);
  }
  const auto most_direct = static_cast<std::uint64_t>(most.direct_samples);
  const std::uint64_t direct = (mutations * most_direct + longest - 1) / longest;
  constexpr std::uint64_t kShare = 16, kFewer = 10;
  const std::uint64_t share = effort.samples / kShare;
  const std::uint64_t of_share = std::min(share, largest) * most_chains / largest;
  const std::uint64_t chains = std::clamp(of_share - of_share % 2, most_chains / kFewer, most_chains);
  return {{"mutations", std::to_string(mutations)},
          {"direct_samples", std::to_string(direct)},
          {"chains", std::to_string(chains)},
          {"bootstrap", std::to_string(std::clamp(share, kOfEachChain * chains, largest))}};
}

}  // namespace candela::integrators::chain_jobs
