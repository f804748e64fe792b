// The path tracer's forms with letters.
#include "worker/estimators/path_dispatch.h"
#include "worker/mcmc/primary_state.h"

namespace candela::estimators {

template <class SamplerT>
RadianceFunction<SamplerT> path_radiance_with_letters(transport::EdgeContent between) {
  return path_radiance_between<SamplerT, true>(between);
}
template RadianceFunction<samplers::Sampler> path_radiance_with_letters(transport::EdgeContent);
template RadianceFunction<mcmc::PrimarySampler> path_radiance_with_letters(transport::EdgeContent);

}  // namespace candela::estimators
