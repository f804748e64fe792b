#include "worker/integrators/markov/effort.h"

#include <algorithm>
#include <string>

#include "worker/integrators/markov/settings.h"

namespace candela::integrators::markov {

SettingsMap settings_of_effort(std::uint64_t spp, std::uint64_t pixels) {
  const MarkovSettings most;  // of a large job
  const auto longest = static_cast<std::uint64_t>(most.mutations);
  const std::uint64_t total = std::max<std::uint64_t>(spp, 1);
  const std::uint64_t rounds = (total + longest - 1) / longest;
  const std::string mutations = std::to_string((total + rounds - 1) / rounds);
  constexpr std::uint64_t kShare = 16, kOfEachChain = 4;
  const std::uint64_t least = kOfEachChain * static_cast<std::uint64_t>(most.chains);
  const auto largest = static_cast<std::uint64_t>(most.bootstrap);
  // total * pixels may not fit 64 bits.
  const std::uint64_t share = total > kShare * largest / pixels ? largest : total * pixels / kShare;
  return {{"mutations", mutations},
          {"direct_samples", mutations},
          {"bootstrap", std::to_string(std::clamp(share, least, largest))}};
}

}  // namespace candela::integrators::markov
