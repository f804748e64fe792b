// Media by name: coefficients that Jensen et al. and Narasimhan et al. measured, as Mitsuba 0.6's `material`
// names them.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "common/description/object.h"

namespace candela::description {

// Per millimeter, in linear Rec.709. The scattering is the reduced one, for an isotropic phase function.
struct MediumPreset {
  Vec3 sigma_s, sigma_a;
};

// In any case of letters, with spaces or without; nullopt for an unknown name.
std::optional<MediumPreset> named_medium(std::string_view name);
std::vector<std::string_view> medium_names();

}  // namespace candela::description
