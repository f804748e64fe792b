// The letter of a vertex, its side and its regions, before an automaton makes a class of them
// (path_letters.h).
#pragma once

#include <array>
#include <cstdint>

#include "common/letters/letter.h"
#include "common/letters/request.h"
#include "worker/scene/emitters/lights.h"
#include "worker/transport/letters/path_letters.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

struct ChannelLetters {
  std::array<letters::Letter, kColors> of{};
};

// Diffuse or glossy, of a surface that scatters between wo and wi by lobes that are not delta. mode: as the
// closure is evaluated along wo; key: of the draw between lobes.
ChannelLetters letters_of_lobes(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                                TransportMode mode, float glossy_below, std::uint64_t key);
// The emitters of light from outside that is seen looking along d: of several environments, whose light
// arrives together, one is drawn for each channel by its share.
std::array<std::uint32_t, kColors> emitters_outside(const scene::Lights& lights, Vec3 d, std::uint64_t key);
// p: in the coordinates of the scene's file.
bool is_inside(const letters::Region& region, Vec3d p);

}  // namespace candela::transport
