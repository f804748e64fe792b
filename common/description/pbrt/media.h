// pbrt's media.
#pragma once

#include <map>
#include <string>

#include "common/description/pbrt/context.h"
#include "common/description/pbrt/spectra.h"

namespace candela::description::pbrt {

// sigma_a, sigma_s, scale, g or a preset, whose name is the parameter `preset`, as a homogeneous medium.
Result<ObjectPtr> scattering_medium(Context& context, ParameterList& parameters, std::string_view preset,
                                    ColorSpace space, const Location& where);

class Media {
 public:
  explicit Media(Context& context) : context_(context) {}

  // MakeNamedMedium.
  Result<void> define(const std::string& name, ParameterList parameters, ColorSpace space,
                      const Location& where);
  // The medium; null for the empty name.
  Result<ObjectPtr> medium(const std::string& name, const Location& where) const;

 private:
  Context& context_;
  std::map<std::string, ObjectPtr, std::less<>> media_;
};

}  // namespace candela::description::pbrt
