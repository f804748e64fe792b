// Films of jobs, for tests of `candela inspect`.
#pragma once

#include "tests/unit/renderer_fixture.h"

namespace candela::test {

// The film of the first `iterations` of a job, of both halves.
inline std::unique_ptr<film::UnitFilm> render_job(const render::Renderer& renderer,
                                                  std::uint64_t iterations) {
  const NamedState state = state_at(renderer, kFilmScaleLog2);
  auto output = renderer.make_output(state);
  for (const std::uint32_t half : {0u, 1u}) {
    const Unit unit{Unit::Kind::iterations, half, 0, (iterations + 1 - half) / 2};
    if (const auto done = renderer.run(unit, {state, {}, {}}, output, {1}); !done.ok())
      throw std::runtime_error(done.error().to_string());
  }
  return std::move(output.film);
}

}  // namespace candela::test
