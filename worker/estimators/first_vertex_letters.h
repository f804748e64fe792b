// The path tracer with techniques of its own at the first vertex, and letters for layers by expressions. It
// has a file of its own, like path_letters.cpp.
#pragma once

#include "worker/estimators/path.h"

namespace candela::estimators {

using LetteredFirstVertex = Spectrum (*)(const scene::Scene&, const Techniques&, const Ray&,
                                         samplers::Sampler&, film::SampleCounts&, FirstVertex&,
                                         transport::EyeLetters&);

LetteredFirstVertex first_vertex_with_letters(transport::EdgeContent between);

}  // namespace candela::estimators
