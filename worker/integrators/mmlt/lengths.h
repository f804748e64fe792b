// The lengths of mmlt's paths.
#pragma once

#include "worker/mcmc/path_lengths.h"

namespace candela::integrators::mmlt {

using Lengths = mcmc::PathLengths;

}  // namespace candela::integrators::mmlt
