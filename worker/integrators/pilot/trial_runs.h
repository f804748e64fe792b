// Trials of an integrator: variants render the same few iterations of a small film of the job's scene.
#pragma once

#include <cstdint>
#include <functional>

#include "common/base/result.h"
#include "common/job/job.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/pilot/trials.h"
#include "worker/integrators/run_context.h"
#include "worker/integrators/unit_data.h"

namespace candela::integrators::pilot {

// A quarter of the film's pixels, but within these bounds.
struct SmallFilm {
  double min_pixels, max_pixels;
  std::uint64_t seed;
};

class TrialRuns {
 public:
  // Renders a unit of one iteration of a variant.
  using Render = std::function<Result<void>(const UnitContext& context, const Unit& unit, UnitOutput& output,
                                            const RunContext& run)>;

  // integrator: its pilot_luminances give the film's scale. layers: of the film, with the image.
  TrialRuns(const Integrator& integrator, const UnitContext& context, const RunContext& run,
            const SmallFilm& film, std::uint32_t layers);

  // The context of the small film: a pure function of the scene, the settings and the film's size.
  const UnitContext& context() const { return small_; }
  // The images of all replicates. Leaves the cost to the caller.
  Result<Trial> run(const Render& render) const;

 private:
  UnitContext small_;
  RunContext quiet_;
  film::Layout layout_;
  int scale_;
};

}  // namespace candela::integrators::pilot
