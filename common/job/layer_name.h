// Legal names of layers of an image.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace candela {

// The longest layer name, in bytes. With ".R" it is well within what an EXR channel may be called.
inline constexpr std::size_t kMaxLayerNameBytes = 64;

// The names of the layers that carry the error estimate of an image and its square on request; no other layer
// may have them.
inline constexpr std::string_view kErrorLayer = "error";
inline constexpr std::string_view kVarianceLayer = "variance";

// Why the name cannot name a layer; empty if it can: 1 to kMaxLayerNameBytes of letters, digits, '_', '-' and
// '.', a letter first, with no empty part between dots (dots make groups in an EXR: "weighted.s2.t3"), and
// none of the names above.
std::string fault_of_layer_name(std::string_view name);

// The name for a message: it may come from a peer, and be anything.
std::string printable_layer_name(std::string_view name);

}  // namespace candela
