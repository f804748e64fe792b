// pbrt's graphics state, and the directives that change it: transforms, scopes, orientation, color space,
// media and shared parameters.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/description/pbrt/camera.h"
#include "common/description/pbrt/materials.h"
#include "common/description/pbrt/spectra.h"
#include "common/description/pbrt/tokens.h"
#include "common/description/transform.h"

namespace candela::description::pbrt {

// The type and the parameters behind a directive.
Result<Entity> read_entity(Context& context, Tokens& tokens, const Token& word);

class GraphicsState {
 public:
  // State that AttributeBegin and TransformBegin keep, and AttributeEnd and TransformEnd give back.
  struct Values {
    Mat4 world_from_object = transform::identity;
    bool reverse_orientation = false;
    ColorSpace space = ColorSpace::srgb;
    std::shared_ptr<const MaterialName> material;        // null: none is named
    std::shared_ptr<const std::string> inside, outside;  // media; null: none
    ObjectPtr emitter;
    std::array<SharedParameters, 5> shared;  // by the target of Attribute
  };
  using Handler = Result<void> (GraphicsState::*)(Tokens&, const Token&);
  struct Directive {
    std::string_view name;
    Handler handler;
  };

  explicit GraphicsState(Context& context) : context_(context) {}

  static std::span<const Directive> directives();

  Values& values() { return values_; }
  const Values& values() const { return values_; }
  bool in_world() const { return in_world_; }
  Result<void> expect_world(Tokens& tokens, const Token& word) const;

  Result<void> set_material(MaterialName name);
  const std::string& outside() const;

  // Attributes that Attribute directives give a target: "shape", "light", "material", "medium" or "texture".
  const SharedParameters& shared(std::string_view target) const;

  // The camera has the current transform.
  void name_camera();
  void begin_world();

  // Opens a scope. `name`: the directive's, which must last; AttributeBegin for TransformBegin too.
  Result<void> push(Tokens& tokens, const Token& word, std::string_view name);
  // Closes the scope that the directive `begin` opened.
  Result<void> pop(Tokens& tokens, const Token& word, std::string_view begin);
  std::size_t depth() const { return scopes_.size(); }
  // The error of the innermost scope. `rest`: "has no end".
  Error unfinished(std::string_view rest) const;

 private:
  struct Scope {
    std::string_view begin;  // the directive that opened it
    Location where;
    Values values;
  };

  // A name that others share: each is kept once.
  Result<std::shared_ptr<const std::string>> shared_name(std::string name, const Location& where);
  Result<void> apply(Tokens& tokens, const Token& word, const Mat4& matrix);
  Result<void> identity(Tokens& tokens, const Token& word);
  Result<void> translate(Tokens& tokens, const Token& word);
  Result<void> scale(Tokens& tokens, const Token& word);
  Result<void> rotate(Tokens& tokens, const Token& word);
  Result<void> look_at(Tokens& tokens, const Token& word);
  Result<void> concat_transform(Tokens& tokens, const Token& word);
  Result<void> set_transform(Tokens& tokens, const Token& word);
  Result<void> coordinate_system(Tokens& tokens, const Token& word);
  Result<void> use_coordinate_system(Tokens& tokens, const Token& word);
  Result<void> active_transform(Tokens& tokens, const Token& word);
  Result<void> transform_times(Tokens& tokens, const Token& word);
  Result<void> reverse_orientation(Tokens& tokens, const Token& word);
  Result<void> attribute_begin(Tokens& tokens, const Token& word);
  Result<void> attribute_end(Tokens& tokens, const Token& word);
  Result<void> attribute(Tokens& tokens, const Token& word);
  Result<void> color_space_directive(Tokens& tokens, const Token& word);
  Result<void> medium_interface(Tokens& tokens, const Token& word);

  Context& context_;
  bool in_world_ = false;
  bool active_ = true;  // transforms are those at the start of the shutter
  Values values_;
  std::vector<Scope> scopes_;
  std::map<std::string, Mat4, std::less<>> coordinate_systems_;
  std::map<std::string, std::shared_ptr<const std::string>, std::less<>> names_;
};

}  // namespace candela::description::pbrt
