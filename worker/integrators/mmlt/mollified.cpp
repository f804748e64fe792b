#include "worker/integrators/mmlt/mollified.h"

#include "worker/integrators/mmlt/target.h"

namespace candela::integrators::mmlt {

std::unique_ptr<mcmc::PrimaryTarget> make_mollified_target(const UnitContext& context,
                                                           const estimators::PathOptions& options,
                                                           const estimators::Techniques& techniques,
                                                           const Lengths& lengths, double bandwidth,
                                                           film::Tallies& tallies) {
  return std::make_unique<Target<transport::Between::media, true>>(context, options, techniques, lengths,
                                                                   tallies, bandwidth);
}

}  // namespace candela::integrators::mmlt
