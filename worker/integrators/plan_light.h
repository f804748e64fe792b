// Warnings of the plan about light that an integrator finds by luck, or never.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/job/job.h"
#include "worker/integrators/plan.h"
#include "worker/scene/features.h"

namespace candela::integrators {

// Ways in which an integrator finds light behind mirrors and glass.
enum class Finds : std::uint8_t {
  eye_paths,    // by eye paths that happen to hit an emitter
  connections,  // by light paths too, but for what meets the eye over glass again
};
// Mollification of light that an integrator cannot sample (regularise.h).
enum class Mollifies : std::uint8_t {
  never,  // it has no such setting
  if_asked,
  always,  // it was asked
};
// Missing light, and the ways out: another integrator, or regularise=on. Empty: none is known.
std::string missing_light(const scene::SceneFeatures& features, std::uint32_t max_depth, Finds finds,
                          Mollifies mollifies);
// The same of an integrator with these settings, which are complete.
std::string missing_light(const scene::SceneFeatures& features, std::string_view integrator,
                          const SettingsMap& settings);
// Notes light that the integrator finds by luck alone, or never, with one that finds it. Such light is in no
// variance before it is found, so the note stands beside the error's figure (common/job/plan_words.h).
void note_lucky_light(const scene::SceneFeatures& features, std::uint32_t max_depth, Finds finds,
                      Mollifies mollifies, Plan& plan);

}  // namespace candela::integrators
