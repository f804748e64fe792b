#include "common/chains/growth.h"

#include <fmt/format.h>

namespace candela::chains {

std::string grown_b_text(const BootstrapSums& bootstrap, const Normalisation& pooled) {
  constexpr double kGrown = 1.25, kErrors = 5;
  const Normalisation first = pool(bootstrap, {});
  if (!(first.b > 0) || !(pooled.b > kGrown * first.b) ||
      !(pooled.b - first.b > kErrors * first.standard_error))
    return {};
  return fmt::format(
      "b has grown from {:.3g} +- {:.2g} in the bootstrap to {:.3g} +- {:.2g}: large steps met bright light "
      "that the bootstrap missed; until the chains follow it, other parts of the image may be too bright; "
      "more "
      "bootstrap samples find it earlier",
      first.b, first.standard_error, pooled.b, pooled.standard_error);
}

}  // namespace candela::chains
