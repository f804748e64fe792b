// Renderers for tests, of scenes that are text.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include "tests/pilot_state.h"
#include "tests/unit/scene_fixture.h"
#include "worker/render/renderer.h"

namespace candela::test {

// For scene.xml in `files`, which outlives it; one thread. chosen: settings of job.integrator over its
// defaults.
inline std::unique_ptr<render::Renderer> make_renderer(const TextFiles& files, JobSettings job,
                                                       const SettingsMap& chosen) {
  const auto settings = render::complete_integrator_settings(job.integrator, {}, chosen);
  if (!settings.ok()) throw std::runtime_error(settings.error().to_string());
  job.integrator_settings = *settings;
  auto renderer = render::Renderer::create(files, "scene.xml", {}, job, 1);
  if (!renderer.ok()) throw std::runtime_error(renderer.error().to_string());
  return std::move(*renderer);
}

constexpr int kFilmScaleLog2 = 30;

// The film of the first `iterations` of a half, whose sums are in units of 2^-kFilmScaleLog2.
inline std::unique_ptr<film::UnitFilm> render_film(const render::Renderer& renderer,
                                                   std::uint64_t iterations) {
  const NamedState state = state_at(renderer, kFilmScaleLog2);
  auto output = renderer.make_output(state);
  const auto done = renderer.run({Unit::Kind::iterations, 0, 0, iterations}, {state, {}, {}}, output, {1});
  if (!done.ok()) throw std::runtime_error(done.error().to_string());
  return std::move(output.film);
}

}  // namespace candela::test
