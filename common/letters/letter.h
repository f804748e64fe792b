// Letters of light path expressions [Kaplanyan 2017, 9.1.1]: one for each vertex of a path.
#pragma once

#include <cstdint>

namespace candela::letters {

// L E D G S V
enum class Letter : std::uint8_t { lamp, eye, diffuse, glossy, specular, volume };
// Side of scattering at a surface, by the geometric sides of both directions. none: L, E, V.
enum class Side : std::uint8_t { none, reflected, transmitted };

}  // namespace candela::letters
