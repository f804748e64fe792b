// Labels of whole paths for layers by light path expressions.
#pragma once

#include "worker/transport/letters/path_letters.h"
#include "worker/transport/path/full_path.h"

namespace candela::mcmc {

// The labels follow from the path alone: a chain that begins again at a state has the same ones.
transport::ChannelLabels labels_of(const transport::PathLetters& letters, const scene::Scene& scene,
                                   const transport::path::FullPath& path);

}  // namespace candela::mcmc
