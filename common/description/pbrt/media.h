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

// A MakeNamedMedium directive with the state it was met in.
struct MediumEntity {
  std::string name;
  ParameterList parameters;
  Location where;
  std::size_t offset = 0;  // of the directive in its file
  Mat4 to_world{};
  ColorSpace space = ColorSpace::srgb;
  bool has_shared_values = false;  // parameters of an Attribute directive are among them
};

class Media {
 public:
  explicit Media(Context& context) : context_(context) {}

  // MakeNamedMedium.
  Result<void> define(MediumEntity entity);
  // The medium; null for the empty name.
  Result<ObjectPtr> medium(const std::string& name, const Location& where) const;

 private:
  Result<ObjectPtr> read(MediumEntity& entity, const std::string& type);
  Result<ObjectPtr> uniform_grid(MediumEntity& entity);
  Result<ObjectPtr> rgb_grid(MediumEntity& entity);
  Result<ObjectPtr> cloud(MediumEntity& entity);
  Result<ObjectPtr> nano_vdb(MediumEntity& entity);
  // `wrap`: beyond the outermost centers of cells.
  Result<std::shared_ptr<Object>> grid_in_box(MediumEntity& entity, std::string_view wrap,
                                              std::initializer_list<std::string_view> read_by_loader);
  Result<std::shared_ptr<Object>> grid_medium(MediumEntity& entity, const std::shared_ptr<Object>& grid);
  Result<ObjectPtr> finish_grid(MediumEntity& entity, std::shared_ptr<Object> medium);

  Context& context_;
  std::map<std::string, ObjectPtr, std::less<>> media_;
};

}  // namespace candela::description::pbrt
