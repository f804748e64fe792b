#include "worker/integrators/mmlt/mollified.h"

#include "worker/integrators/mmlt/target.h"

namespace candela::integrators::mmlt {

std::unique_ptr<mcmc::PrimaryTarget> make_mollified_target(const UnitContext& context,
                                                           const estimators::PathOptions& options,
                                                           const estimators::Techniques& techniques,
                                                           const Lengths& lengths, double bandwidth,
                                                           film::SampleCounts& sample_counts) {
  return std::make_unique<Target<transport::EdgeContent::media, true>>(context, options, techniques, lengths,
                                                                       sample_counts, bandwidth);
}

}  // namespace candela::integrators::mmlt
