// The state that a job's units start from, with a film scale of the test's.
#pragma once

#include <stdexcept>

#include "worker/render/renderer.h"

namespace candela::test {

// As the pilot decides it, but for the film's scale.
inline NamedState state_at(const render::Renderer& renderer, int film_scale_log2) {
  auto pilot = renderer.pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  pilot->state.film_scale_log2 = film_scale_log2;
  return std::move(pilot->state);
}

}  // namespace candela::test
