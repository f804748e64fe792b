// The light paths of photon mapping with a radius for each pixel, which are the same for all of its
// integrators: they are compiled once.
#pragma once

#include "worker/integrators/adaptive/scales.h"
#include "worker/integrators/merging/light_pass.h"

namespace candela::integrators::merging {

#define CANDELA_LIGHT_PASS(between)                                                            \
  template Result<void> run_light_pass<transport::EdgeContent::between, transport::Unweighted, \
                                       transport::EtaOf<transport::ScaleMap>>(                 \
      const UnitContext&, const estimators::PathOptions&, const estimators::Techniques&,       \
      const estimators::PathCounts&, const estimators::LightKeeping&,                          \
      const transport::EtaOf<transport::ScaleMap>&, std::uint32_t, std::uint64_t,              \
      LightChunks<transport::Unweighted::Block>&, film::UnitFilm&, const RunContext&, ProgressSpan)
extern CANDELA_LIGHT_PASS(nothing);
extern CANDELA_LIGHT_PASS(surfaces);
extern CANDELA_LIGHT_PASS(media);

}  // namespace candela::integrators::merging
