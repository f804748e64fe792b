// Metals and coatings by Mitsuba's names.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description {

// Real and imaginary part of the index of refraction, in linear Rec.709.
struct ConductorIndex {
  Vec3 eta, k;
};

// By name, which is case sensitive as in Mitsuba ("Au", "Na_palik"); nullopt for an unknown one.
std::optional<ConductorIndex> named_conductor(std::string_view name);

std::vector<std::string> conductor_names();

// The error of a property that names none of them, with the nearest.
Error unknown_conductor(const Property& material);

// Negative indices of a conductor, from integrals over measured tables, become 0; a note for each.
void clamp_indices(Object& object, std::vector<Note>& notes);

// Turns the checked property 'material', if there is one, into eta and k ('none': into nothing). An error
// where eta or k are given too.
Result<void> resolve_material(Object& object);

}  // namespace candela::description
