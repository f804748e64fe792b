#include "worker/integrators/pilot/eye_walk.h"

#include "worker/estimators/eye_radiance.h"
#include "worker/integrators/eye_samples.h"

namespace candela::integrators {

std::vector<float> pilot_by_eye_walk(const UnitContext& context, std::uint32_t count,
                                     const estimators::PathOptions& options) {
  return pilot_eye_samples(
      context, count, estimators::EyeRadianceFunction<transport::EdgeContent::media>(context.scene, options));
}

}  // namespace candela::integrators
