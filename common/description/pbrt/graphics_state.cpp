#include "common/description/pbrt/graphics_state.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "common/description/check.h"
#include "common/description/pbrt/geometry.h"
#include "common/description/pbrt/words.h"
#include "common/description/text.h"

namespace candela::description::pbrt {
namespace {

constexpr std::size_t max_scopes = 100'000;
constexpr std::size_t map_entry_bytes = 96;  // beside key and value, with the allocator's blocks

constexpr std::array<std::string_view, 5> targets = {"shape", "light", "material", "medium", "texture"};

}  // namespace

Result<Entity> read_entity(Context& context, Tokens& tokens, const Token& word) {
  Entity result;
  result.where = tokens.where(word);
  CANDELA_ASSIGN(result.type, read_string(tokens, word));
  CANDELA_ASSIGN(result.parameters, ParameterList::read(tokens));
  for (Note& note : result.parameters.take_replaced()) context.warn(note.where, std::move(note.text));
  return result;
}

Result<void> GraphicsState::expect_world(Tokens& tokens, const Token& word) const {
  if (in_world_) return {};
  return error_at(tokens.where(word), fmt::format("{} stands before WorldBegin", word.text));
}

const SharedParameters& GraphicsState::shared(std::string_view target) const {
  const auto* const found = std::find(targets.begin(), targets.end(), target);
  return values_.shared[static_cast<std::size_t>(found - targets.begin())];
}

Result<void> GraphicsState::set_material(MaterialName name) {
  CANDELA_TRY(context_.budget().charge(sizeof name + map_entry_bytes + heap_bytes(name.name), name.where,
                                       "names of materials"));
  values_.material = std::make_shared<const MaterialName>(std::move(name));
  return {};
}

const std::string& GraphicsState::outside() const {
  static const std::string none;
  return values_.outside != nullptr ? *values_.outside : none;
}

Result<std::shared_ptr<const std::string>> GraphicsState::shared_name(std::string name,
                                                                      const Location& where) {
  if (name.empty()) return std::shared_ptr<const std::string>();
  if (const auto known = names_.find(name); known != names_.end()) return known->second;
  CANDELA_TRY(context_.budget().charge(map_entry_bytes + 2 * (sizeof name + heap_bytes(name)), where,
                                       "names of media"));
  auto shared = std::make_shared<const std::string>(name);
  names_.emplace(std::move(name), shared);
  return shared;
}

void GraphicsState::name_camera() {
  if (const auto world = inverse(values_.world_from_object)) coordinate_systems_["camera"] = *world;
}

void GraphicsState::begin_world() {
  in_world_ = true;
  values_.world_from_object = transform::identity;
  active_ = true;
  coordinate_systems_["world"] = transform::identity;
}

Error GraphicsState::unfinished(std::string_view rest) const {
  return error_at(scopes_.back().where, fmt::format("{} {}", scopes_.back().begin, rest));
}

Result<void> GraphicsState::apply(Tokens& tokens, const Token& word, const Mat4& matrix) {
  if (!active_) {
    context_.differs(tokens.where(word),
                     "nothing moves: transforms at the end of the shutter are passed over");
    return {};
  }
  values_.world_from_object = transform::multiply(values_.world_from_object, matrix);
  if (transform::is_finite(values_.world_from_object)) return {};
  return error_at(tokens.where(word), fmt::format("the transform after {} is not finite", word.text));
}

Result<void> GraphicsState::identity(Tokens& /*tokens*/, const Token& /*word*/) {
  if (active_) values_.world_from_object = transform::identity;
  return {};
}

Result<void> GraphicsState::translate(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const auto v, read_numbers<3>(tokens, word));
  return apply(tokens, word, transform::translate(v));
}

Result<void> GraphicsState::scale(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const auto v, read_numbers<3>(tokens, word));
  return apply(tokens, word, transform::scale(v));
}

Result<void> GraphicsState::rotate(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const auto v, read_numbers<4>(tokens, word));
  const std::optional<Mat4> turn = transform::rotate({v[1], v[2], v[3]}, v[0]);
  if (!turn) return error_at(tokens.where(word), "the axis of Rotate has no length");
  return apply(tokens, word, *turn);
}

Result<void> GraphicsState::look_at(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const auto v, read_numbers<9>(tokens, word));
  const std::optional<Mat4> world_from_camera =
      transform::look_at({v[0], v[1], v[2]}, {v[3], v[4], v[5]}, {v[6], v[7], v[8]});
  const std::optional<Mat4> camera_from_world =
      world_from_camera ? inverse(*world_from_camera) : std::nullopt;
  if (!camera_from_world)
    return error_at(tokens.where(word), "LookAt looks at its own place, or along its up vector");
  return apply(tokens, word, *camera_from_world);
}

Result<void> GraphicsState::concat_transform(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const Mat4 m, read_matrix(tokens, word));
  return apply(tokens, word, m);
}

Result<void> GraphicsState::set_transform(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const Mat4 m, read_matrix(tokens, word));
  if (active_) values_.world_from_object = transform::identity;
  return apply(tokens, word, m);
}

Result<void> GraphicsState::coordinate_system(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
  if (!coordinate_systems_.contains(name))
    CANDELA_TRY(context_.budget().charge(map_entry_bytes + sizeof(Mat4) + heap_bytes(name),
                                         tokens.where(word), "coordinate systems"));
  coordinate_systems_[name] = values_.world_from_object;
  return {};
}

Result<void> GraphicsState::use_coordinate_system(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
  const auto found = coordinate_systems_.find(name);
  if (found == coordinate_systems_.end()) {
    std::vector<std::string_view> known;
    for (const auto& [other, unused] : coordinate_systems_) known.push_back(other);
    return Context::unknown(tokens.where(word), "coordinate system", name, known);
  }
  if (active_) values_.world_from_object = found->second;
  return {};
}

Result<void> GraphicsState::active_transform(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const std::optional<Token> which, tokens.next());
  const std::string_view name = which ? which->text : std::string_view();
  constexpr std::array<std::string_view, 3> known = {"StartTime", "EndTime", "All"};
  if (std::find(known.begin(), known.end(), name) == known.end())
    return Context::unknown(tokens.where(word), "ActiveTransform", name, known);
  active_ = name != "EndTime";
  return {};
}

Result<void> GraphicsState::transform_times(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN([[maybe_unused]] const auto times, read_numbers<2>(tokens, word));
  return {};
}

Result<void> GraphicsState::reverse_orientation(Tokens& tokens, const Token& word) {
  CANDELA_TRY(expect_world(tokens, word));
  values_.reverse_orientation = !values_.reverse_orientation;
  return {};
}

Result<void> GraphicsState::push(Tokens& tokens, const Token& word, std::string_view name) {
  if (scopes_.size() >= max_scopes)
    return error_at(tokens.where(word), fmt::format("scopes are nested deeper than {} levels", max_scopes));
  CANDELA_TRY(make_room(scopes_, context_.budget(), tokens.where(word), "scopes"));
  scopes_.push_back({name, tokens.where(word), values_});
  return {};
}

Result<void> GraphicsState::pop(Tokens& tokens, const Token& word, std::string_view begin) {
  if (scopes_.empty() || scopes_.back().begin != begin)
    return error_at(tokens.where(word),
                    scopes_.empty() ? fmt::format("{} ends nothing", word.text)
                                    : fmt::format("{} ends {} of {}:{}", word.text, scopes_.back().begin,
                                                  scopes_.back().where.file, scopes_.back().where.line));
  values_ = std::move(scopes_.back().values);
  scopes_.pop_back();
  return {};
}

Result<void> GraphicsState::attribute_begin(Tokens& tokens, const Token& word) {
  CANDELA_TRY(expect_world(tokens, word));
  return push(tokens, word, "AttributeBegin");
}

Result<void> GraphicsState::attribute_end(Tokens& tokens, const Token& word) {
  return pop(tokens, word, "AttributeBegin");
}

Result<void> GraphicsState::attribute(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const Entity given, read_entity(context_, tokens, word));
  const auto* const target = std::find(targets.begin(), targets.end(), given.type);
  if (target == targets.end())
    return Context::unknown(given.where, "target of Attribute", given.type, targets);
  return given.parameters.add_to(values_.shared[static_cast<std::size_t>(target - targets.begin())],
                                 context_.budget());
}

Result<void> GraphicsState::color_space_directive(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
  const std::optional<ColorSpace> space = color_space(name);
  if (!space) return Context::unknown(tokens.where(word), "color space", name, color_space_names());
  values_.space = *space;
  return {};
}

// One name for both sides, or two.
Result<void> GraphicsState::medium_interface(Tokens& tokens, const Token& word) {
  CANDELA_ASSIGN(std::string name, read_string(tokens, word));
  CANDELA_ASSIGN(values_.inside, shared_name(std::move(name), tokens.where(word)));
  values_.outside = values_.inside;
  CANDELA_ASSIGN(const std::optional<Token> second, tokens.next());
  if (!second) return {};
  if (second->quoted) {
    CANDELA_ASSIGN(values_.outside, shared_name(std::string(second->text), tokens.where(word)));
  } else {
    tokens.unget(*second);
  }
  return {};
}

std::span<const GraphicsState::Directive> GraphicsState::directives() {
  static constexpr std::array<Directive, 19> all = {{
      {"ActiveTransform", &GraphicsState::active_transform},
      {"Attribute", &GraphicsState::attribute},
      {"AttributeBegin", &GraphicsState::attribute_begin},
      {"AttributeEnd", &GraphicsState::attribute_end},
      {"ColorSpace", &GraphicsState::color_space_directive},
      {"ConcatTransform", &GraphicsState::concat_transform},
      {"CoordSysTransform", &GraphicsState::use_coordinate_system},
      {"CoordinateSystem", &GraphicsState::coordinate_system},
      {"Identity", &GraphicsState::identity},
      {"LookAt", &GraphicsState::look_at},
      {"MediumInterface", &GraphicsState::medium_interface},
      {"ReverseOrientation", &GraphicsState::reverse_orientation},
      {"Rotate", &GraphicsState::rotate},
      {"Scale", &GraphicsState::scale},
      {"Transform", &GraphicsState::set_transform},
      {"TransformBegin", &GraphicsState::attribute_begin},
      {"TransformEnd", &GraphicsState::attribute_end},
      {"TransformTimes", &GraphicsState::transform_times},
      {"Translate", &GraphicsState::translate},
  }};
  return all;
}

}  // namespace candela::description::pbrt
