// The normalization b of a job of chains against the bootstrap's first estimate of it.
#pragma once

#include <string>

#include "common/chains/chains.h"

namespace candela::chains {

// Message if b has grown far beyond the error that the bootstrap states: large steps found bright light that
// the bootstrap missed, and b, which scales the whole image, knows of it before the chains do. Else empty.
std::string grown_b_text(const BootstrapSums& bootstrap, const Normalisation& pooled);

}  // namespace candela::chains
