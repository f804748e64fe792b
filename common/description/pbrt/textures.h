// pbrt's named textures, and parameters that may be one.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "common/description/pbrt/context.h"
#include "common/description/pbrt/spectra.h"

namespace candela::description::pbrt {

// A value of a surface: a constant, or a texture in its place.
struct Value {
  Vec3 constant{};
  ObjectPtr texture;  // null: the constant
  Location where;
  bool negated = false;  // times -1, of a texture; only displacements may be

  bool is_constant() const { return texture == nullptr; }
  double number() const { return constant[0]; }
};

class Textures {
 public:
  explicit Textures(Context& context) : context_(context) {}

  // A Texture directive; it is read when something uses it. kind: "float" or "spectrum".
  Result<void> define(const std::string& name, std::string_view kind, const std::string& type,
                      ParameterList parameters, ColorSpace space, const Location& where);

  // A parameter of a material, a light or another texture, with pbrt's default.
  Result<Value> color(ParameterList& parameters, std::string_view name, const Vec3& otherwise,
                      ColorSpace space, SpectrumUse use = SpectrumUse::reflectance);
  Result<Value> number(ParameterList& parameters, std::string_view name, double otherwise);
  // Nothing if the parameter is absent.
  Result<std::optional<Value>> optional_color(ParameterList& parameters, std::string_view name,
                                              ColorSpace space, SpectrumUse use = SpectrumUse::reflectance);
  Result<std::optional<Value>> optional_number(ParameterList& parameters, std::string_view name);

  // A reflectance or a transmittance: values above 1 become 1, as in pbrt.
  Result<Value> reflectance(ParameterList& parameters, std::string_view name, const Vec3& otherwise,
                            ColorSpace space);
  Result<Value> at_most_one(const Value& value) const;
  // May be negated.
  Result<std::optional<Value>> displacement(ParameterList& parameters, std::string_view name);

  // The value times a factor.
  Result<Value> scaled(const Value& value, const Vec3& factor) const;
  Result<Value> mean(const Value& a, const Value& b) const;
  // The square root of a value, for roughness.
  Result<Value> root(const Value& value) const;

  // The picture of a light, as it lies in its file; its pixels are not blurred.
  Result<ObjectPtr> projected_picture(const Location& where, std::string_view file);
  // A picture in a file, its v upwards as in pbrt.
  Result<ObjectPtr> picture(const Location& where, std::string_view file, bool raw);

 private:
  struct Definition {
    std::string type;
    ParameterList parameters;
    ColorSpace space;
    Location where;
    bool is_float = false;
    bool open = false;  // being read: a texture that holds itself
    std::optional<Value> value;
  };

  Result<Value> named(const Parameter& parameter, bool is_float);
  Result<Value> read(Definition& definition);
  Result<Value> read_image(Definition& definition);
  Result<Value> read_checkerboard(Definition& definition);
  Result<Value> read_scale(Definition& definition);
  Result<Value> read_mix(Definition& definition);
  Result<Value> read_mean(Definition& definition);
  Result<Value> part(Definition& definition, std::string_view name, double otherwise);
  // Number of textures that a lookup in this one looks up.
  std::uint64_t unfolded(const ObjectPtr& texture);
  Result<Mat4> mapping(Definition& definition);

  Context& context_;
  std::map<std::string, Definition, std::less<>> floats_, spectra_;
  std::map<ObjectPtr, std::uint64_t> unfolded_;
  int depth_ = 0;  // of textures being read
};

// Gives the object the value under a name: a parameter or a texture.
void set_color(Object& object, std::string_view name, const Value& value);
void set_number(Object& object, std::string_view name, const Value& value);

}  // namespace candela::description::pbrt
