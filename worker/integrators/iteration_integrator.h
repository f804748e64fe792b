// The base of integrators of iterations: the options of their paths, the plan, and a pilot by the eye's walk.
#pragma once

#include <utility>

#include "worker/integrators/pilot/eye_walk.h"
#include "worker/integrators/planned.h"

namespace candela::integrators {

class IterationIntegrator : public Integrator {
 public:
  IterationIntegrator(const estimators::PathOptions& options, Planned planned)
      : options_(options), planned_(std::move(planned)) {}

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return pilot_by_eye_walk(context, count, options_);
  }
  Result<Decision> decide(const UnitContext& /*context*/, const RunContext& /*run*/) const override {
    return Decision{{}, plan()};
  }

 protected:
  const Plan& plan() const { return planned_.plan; }

  const estimators::PathOptions options_;
  const Planned planned_;
};

}  // namespace candela::integrators
