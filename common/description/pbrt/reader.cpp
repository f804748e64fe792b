#include "common/description/pbrt/reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "common/description/check.h"
#include "common/description/pbrt/camera.h"
#include "common/description/pbrt/geometry.h"
#include "common/description/pbrt/lights.h"
#include "common/description/pbrt/materials.h"
#include "common/description/pbrt/media.h"
#include "common/description/pbrt/shapes.h"
#include "common/description/pbrt/textures.h"
#include "common/description/pbrt/words.h"
#include "common/description/text.h"
#include "common/description/transform.h"
#include "common/description/unpacked_files.h"
#include "common/description/vocabulary.h"

namespace candela::description::pbrt {
namespace {

constexpr std::size_t max_includes = 10'000;
constexpr std::size_t max_include_depth = 64;
constexpr std::size_t max_scopes = 100'000;
constexpr std::size_t max_entities = 20'000'000;
constexpr std::size_t max_total_bytes = std::size_t{4} << 30;

// What AttributeBegin keeps and AttributeEnd gives back.
struct State {
  Mat4 world_from_object = transform::identity;
  bool reverse_orientation = false;
  ColorSpace space = ColorSpace::srgb;
  MaterialName material;
  std::string inside, outside;
  ObjectPtr emitter;
  std::map<std::string, ParameterList, std::less<>> shared;  // by the target of Attribute
};

struct Scope {
  std::string_view begin;  // the directive that opened it
  Location where;
  State state;
};

struct Instance {
  std::string name;
  Mat4 to_world{};
  Location where;
};

class Reader {
 public:
  Reader(const FileSource& files, const Reading& reading, const std::string& main_key)
      : context_(files, reading),
        textures_(context_),
        materials_(context_, textures_, {main_key, 1}),
        media_(context_),
        shapes_(context_, textures_, materials_, media_),
        main_file_(main_key) {
    context_.set_main_file(main_key);
    for (Entity* option :
         {&options_.camera, &options_.film, &options_.filter, &options_.sampler, &options_.integrator})
      option->where = {main_key, 1};
  }

  Result<ReadScene> run() {
    CANDELA_TRY(read_file(main_file_));
    if (!scopes_.empty())
      return error_at(scopes_.back().where, fmt::format("{} has no end", scopes_.back().begin));
    if (!in_world_) CANDELA_TRY(begin_world());
    return finish();
  }

 private:
  using Handler = Result<void> (Reader::*)(Tokens&, const Token&);
  struct Directive {
    std::string_view name;
    Handler handler;
  };
  static std::span<const Directive> directives();

  // ---- files ----

  Result<void> read_file(const std::string& key) {
    CANDELA_ASSIGN(const FileSource::Bytes bytes, context_.open(key));
    total_bytes_ += bytes.view.size();
    if (total_bytes_ > max_total_bytes)
      return input_error(fmt::format("the scene has more than {} bytes of text", max_total_bytes)).at(key, 0);
    include_stack_.push_back(key);
    Tokens tokens(key, bytes.view);
    while (true) {
      CANDELA_ASSIGN(const std::optional<Token> word, tokens.next());
      if (!word) break;
      CANDELA_TRY(directive(tokens, *word));
    }
    include_stack_.pop_back();
    return {};
  }

  Result<void> directive(Tokens& tokens, const Token& word) {
    if (word.quoted)
      return error_at(tokens.where(word),
                      fmt::format("a string {} at the place of a directive", text::quote(word.text)));
    const auto all = directives();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const Directive& d) { return d.name == word.text; });
    if (found != all.end()) return (this->*found->handler)(tokens, word);
    std::vector<std::string_view> known;
    for (const Directive& d : all) known.push_back(d.name);
    return Context::unknown(tokens.where(word), "directive", word.text, known);
  }

  Result<void> include(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    CANDELA_ASSIGN(const std::string key, context_.find_file(tokens.where(word), name));
    if (std::find(include_stack_.begin(), include_stack_.end(), key) != include_stack_.end())
      return error_at(tokens.where(word), fmt::format("{} includes itself", text::quote(key)));
    if (include_stack_.size() > max_include_depth)
      return error_at(tokens.where(word),
                      fmt::format("includes are nested deeper than {} levels", max_include_depth));
    if (++include_count_ > max_includes)
      return error_at(tokens.where(word), fmt::format("the scene has more than {} includes", max_includes));
    return read_file(key);
  }

  // An included file that changes nothing of the state.
  Result<void> import(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    const std::size_t depth = scopes_.size();
    CANDELA_TRY(push(tokens, word));
    CANDELA_TRY(include(tokens, word));
    if (scopes_.size() != depth + 1)
      return error_at(scopes_.back().where, fmt::format("{} has no end in its file", scopes_.back().begin));
    state_ = std::move(scopes_.back().state);
    scopes_.pop_back();
    return {};
  }

  // ---- words ----

  Result<Entity> entity(Tokens& tokens, const Token& word) {
    Entity result;
    result.where = tokens.where(word);
    CANDELA_ASSIGN(result.type, read_string(tokens, word));
    CANDELA_ASSIGN(result.parameters, ParameterList::read(tokens));
    return result;
  }

  Result<void> expect_world(Tokens& tokens, const Token& word) const {
    if (in_world_) return {};
    return error_at(tokens.where(word), fmt::format("{} stands before WorldBegin", word.text));
  }
  Result<void> expect_options(Tokens& tokens, const Token& word) const {
    if (!in_world_) return {};
    return error_at(tokens.where(word), fmt::format("{} stands behind WorldBegin", word.text));
  }

  void add_shared(std::string_view target, ParameterList& parameters) const {
    if (const auto found = state_.shared.find(target); found != state_.shared.end())
      parameters.add_defaults(found->second);
  }

  // ---- transforms ----

  Result<void> apply(Tokens& tokens, const Token& word, const Mat4& matrix) {
    if (!active_) {
      context_.differs(tokens.where(word),
                       "nothing moves: transforms at the end of the shutter are passed over");
      return {};
    }
    state_.world_from_object = transform::multiply(state_.world_from_object, matrix);
    if (transform::is_finite(state_.world_from_object)) return {};
    return error_at(tokens.where(word), fmt::format("the transform after {} is not finite", word.text));
  }

  Result<void> identity(Tokens& /*tokens*/, const Token& /*word*/) {
    if (active_) state_.world_from_object = transform::identity;
    return {};
  }
  Result<void> translate(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const auto v, read_numbers<3>(tokens, word));
    return apply(tokens, word, transform::translate(v));
  }
  Result<void> scale(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const auto v, read_numbers<3>(tokens, word));
    return apply(tokens, word, transform::scale(v));
  }
  Result<void> rotate(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const auto v, read_numbers<4>(tokens, word));
    const std::optional<Mat4> turn = transform::rotate({v[1], v[2], v[3]}, v[0]);
    if (!turn) return error_at(tokens.where(word), "the axis of Rotate has no length");
    return apply(tokens, word, *turn);
  }
  Result<void> look_at(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const auto v, read_numbers<9>(tokens, word));
    const std::optional<Mat4> world_from_camera =
        transform::look_at({v[0], v[1], v[2]}, {v[3], v[4], v[5]}, {v[6], v[7], v[8]});
    const std::optional<Mat4> camera_from_world =
        world_from_camera ? inverse(*world_from_camera) : std::nullopt;
    if (!camera_from_world)
      return error_at(tokens.where(word), "LookAt looks at its own place, or along its up vector");
    return apply(tokens, word, *camera_from_world);
  }
  Result<void> concat_transform(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const Mat4 m, read_matrix(tokens, word));
    return apply(tokens, word, m);
  }
  Result<void> set_transform(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const Mat4 m, read_matrix(tokens, word));
    if (active_) state_.world_from_object = transform::identity;
    return apply(tokens, word, m);
  }
  Result<void> coordinate_system(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    coordinate_systems_[name] = state_.world_from_object;
    return {};
  }
  Result<void> use_coordinate_system(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    const auto found = coordinate_systems_.find(name);
    if (found == coordinate_systems_.end()) {
      std::vector<std::string_view> known;
      for (const auto& [other, unused] : coordinate_systems_) known.push_back(other);
      return Context::unknown(tokens.where(word), "coordinate system", name, known);
    }
    if (active_) state_.world_from_object = found->second;
    return {};
  }
  Result<void> active_transform(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const std::optional<Token> which, tokens.next());
    const std::string_view name = which ? which->text : std::string_view();
    constexpr std::array<std::string_view, 3> known = {"StartTime", "EndTime", "All"};
    if (std::find(known.begin(), known.end(), name) == known.end())
      return Context::unknown(tokens.where(word), "ActiveTransform", name, known);
    active_ = name != "EndTime";
    return {};
  }
  Result<void> transform_times(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN([[maybe_unused]] const auto times, read_numbers<2>(tokens, word));
    return {};
  }
  Result<void> reverse_orientation(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    state_.reverse_orientation = !state_.reverse_orientation;
    return {};
  }

  // ---- scopes ----

  Result<void> push(Tokens& tokens, const Token& word) {
    if (scopes_.size() >= max_scopes)
      return error_at(tokens.where(word), fmt::format("scopes are nested deeper than {} levels", max_scopes));
    scopes_.push_back({name_of(word), tokens.where(word), state_});
    return {};
  }
  // The directive's name, which lasts.
  static std::string_view name_of(const Token& word) {
    for (const Directive& d : directives())
      if (d.name == word.text) return d.name;
    return {};
  }
  Result<void> pop(Tokens& tokens, const Token& word, std::string_view begin) {
    if (scopes_.empty() || scopes_.back().begin != begin)
      return error_at(tokens.where(word),
                      scopes_.empty() ? fmt::format("{} ends nothing", word.text)
                                      : fmt::format("{} ends {} of {}:{}", word.text, scopes_.back().begin,
                                                    scopes_.back().where.file, scopes_.back().where.line));
    State outer = std::move(scopes_.back().state);
    scopes_.pop_back();
    if (begin == "TransformBegin")
      state_.world_from_object = outer.world_from_object;
    else
      state_ = std::move(outer);
    return {};
  }
  Result<void> attribute_begin(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    return push(tokens, word);
  }
  Result<void> attribute_end(Tokens& tokens, const Token& word) {
    return pop(tokens, word, "AttributeBegin");
  }
  Result<void> transform_begin(Tokens& tokens, const Token& word) { return push(tokens, word); }
  Result<void> transform_end(Tokens& tokens, const Token& word) {
    return pop(tokens, word, "TransformBegin");
  }

  Result<void> attribute(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const Entity given, entity(tokens, word));
    constexpr std::array<std::string_view, 5> known = {"shape", "light", "material", "medium", "texture"};
    if (std::find(known.begin(), known.end(), given.type) == known.end())
      return Context::unknown(given.where, "target of Attribute", given.type, known);
    state_.shared[given.type].append(given.parameters);
    return {};
  }

  // ---- options ----

  Result<void> option_entity(Tokens& tokens, const Token& word, Entity& option) {
    CANDELA_TRY(expect_options(tokens, word));
    CANDELA_ASSIGN(option, entity(tokens, word));
    return {};
  }
  Result<void> camera(Tokens& tokens, const Token& word) {
    CANDELA_TRY(option_entity(tokens, word, options_.camera));
    options_.camera_from_world = state_.world_from_object;
    options_.camera_medium = state_.outside;
    if (const auto world = inverse(state_.world_from_object)) coordinate_systems_["camera"] = *world;
    return {};
  }
  Result<void> film(Tokens& tokens, const Token& word) { return option_entity(tokens, word, options_.film); }
  Result<void> filter(Tokens& tokens, const Token& word) {
    return option_entity(tokens, word, options_.filter);
  }
  Result<void> sampler(Tokens& tokens, const Token& word) {
    return option_entity(tokens, word, options_.sampler);
  }
  Result<void> integrator(Tokens& tokens, const Token& word) {
    return option_entity(tokens, word, options_.integrator);
  }
  Result<void> accelerator(Tokens& tokens, const Token& word) {
    Entity unused;
    return option_entity(tokens, word, unused);
  }
  Result<void> option(Tokens& tokens, const Token& /*word*/) {
    CANDELA_ASSIGN([[maybe_unused]] const ParameterList unused, ParameterList::read(tokens));
    return {};
  }
  Result<void> color_space_directive(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    const std::optional<ColorSpace> space = color_space(name);
    if (!space) return Context::unknown(tokens.where(word), "color space", name, color_space_names());
    state_.space = *space;
    return {};
  }

  Result<void> begin_world() {
    in_world_ = true;
    CANDELA_ASSIGN(exposure_, exposure(context_, options_));
    if (options_.camera_from_world == Mat4{}) options_.camera_from_world = transform::identity;
    state_.world_from_object = transform::identity;
    active_ = true;
    coordinate_systems_["world"] = transform::identity;
    return {};
  }
  Result<void> world_begin(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_options(tokens, word));
    if (!scopes_.empty())
      return error_at(tokens.where(word),
                      fmt::format("{} has no end before WorldBegin", scopes_.back().begin));
    return begin_world();
  }

  // ---- what the world holds ----

  Result<void> material(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, entity(tokens, word));
    add_shared("material", given.parameters);
    CANDELA_ASSIGN(const std::size_t index,
                   materials_.add(given.type, std::move(given.parameters), state_.space, given.where));
    state_.material = {{}, index, given.where};
    return {};
  }
  Result<void> make_named_material(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, entity(tokens, word));
    add_shared("material", given.parameters);
    return materials_.define(given.type, std::move(given.parameters), state_.space, given.where);
  }
  Result<void> named_material(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    state_.material = {name, 0, tokens.where(word)};
    return {};
  }
  Result<void> texture(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    CANDELA_ASSIGN(const std::string kind, read_string(tokens, word));
    CANDELA_ASSIGN(Entity given, entity(tokens, word));
    add_shared("texture", given.parameters);
    return textures_.define(name, kind, given.type, std::move(given.parameters), state_.space, given.where);
  }
  Result<void> make_named_medium(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(Entity given, entity(tokens, word));
    add_shared("medium", given.parameters);
    return media_.define(given.type, std::move(given.parameters), state_.space, given.where);
  }
  // One name for both sides, or two.
  Result<void> medium_interface(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(state_.inside, read_string(tokens, word));
    state_.outside = state_.inside;
    CANDELA_ASSIGN(const std::optional<Token> second, tokens.next());
    if (!second) return {};
    if (second->quoted)
      state_.outside = std::string(second->text);
    else
      tokens.unget(*second);
    return {};
  }

  Result<void> light_source(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, entity(tokens, word));
    add_shared("light", given.parameters);
    CANDELA_ASSIGN(ObjectPtr medium, media_.medium(state_.outside, given.where));
    LightEntity light{given.type,   std::move(given.parameters), given.where, state_.world_from_object,
                      state_.space, std::move(medium),           exposure_};
    CANDELA_ASSIGN(ObjectPtr emitter, build_light(context_, light));
    if (emitter) emitters_.push_back(std::move(emitter));
    return {};
  }
  Result<void> area_light_source(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, entity(tokens, word));
    add_shared("light", given.parameters);
    LightEntity light{
        given.type, std::move(given.parameters), given.where, state_.world_from_object, state_.space, nullptr,
        exposure_};
    CANDELA_ASSIGN(state_.emitter, build_area_light(context_, textures_, light));
    return {};
  }

  Result<void> shape(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, entity(tokens, word));
    if (++entity_count_ > max_entities)
      return error_at(given.where, fmt::format("the scene has more than {} shapes", max_entities));
    ShapeEntity shape;
    shape.type = std::move(given.type);
    shape.parameters = std::move(given.parameters);
    if (const auto shared = state_.shared.find("shape"); shared != state_.shared.end()) {
      shape.has_shared_values = !shared->second.empty() && !shared->second.is_only({"alpha"});
      shape.parameters.add_defaults(shared->second);
    }
    shape.parameters.forget_long_lists();
    shape.where = given.where;
    shape.offset = word.offset;
    shape.to_world = state_.world_from_object;
    shape.reverse_orientation = state_.reverse_orientation;
    shape.material = state_.material;
    shape.inside = state_.inside;
    shape.outside = state_.outside;
    if (object_ == nullptr) {
      shape.emitter = state_.emitter;
      shape_entities_.push_back(std::move(shape));
      return {};
    }
    if (state_.emitter)
      context_.differs(given.where, "a shape of an object that is instanced does not glow, as in pbrt");
    object_->push_back(std::move(shape));
    return {};
  }

  // ---- instances ----

  Result<void> object_begin(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    if (object_ != nullptr) return error_at(tokens.where(word), "ObjectBegin within an object");
    const auto [entry, added] = objects_.try_emplace(name);
    if (!added)
      return error_at(tokens.where(word), fmt::format("the object {} is defined twice", text::quote(name)));
    object_ = &entry->second;
    return push(tokens, word);
  }
  Result<void> object_end(Tokens& tokens, const Token& word) {
    CANDELA_TRY(pop(tokens, word, "ObjectBegin"));
    object_ = nullptr;
    return {};
  }
  Result<void> object_instance(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    if (object_ != nullptr)
      return error_at(tokens.where(word), "ObjectInstance within an object is not supported");
    if (++entity_count_ > max_entities)
      return error_at(tokens.where(word), fmt::format("the scene has more than {} shapes", max_entities));
    instances_.push_back({name, state_.world_from_object, tokens.where(word)});
    return {};
  }

  // ---- the end ----

  // The shapegroup of an object; null if it has no shapes.
  Result<ObjectPtr> group_of(const Instance& instance) {
    if (const auto known = groups_.find(instance.name); known != groups_.end()) return known->second;
    const auto found = objects_.find(instance.name);
    if (found == objects_.end()) {
      std::vector<std::string_view> names;
      for (const auto& [name, unused] : objects_) names.push_back(name);
      return Context::unknown(instance.where, "object", instance.name, names);
    }
    ObjectPtr& group = groups_[instance.name];
    const std::shared_ptr<Object> shapes = make("shape", "shapegroup", instance.where);
    for (ShapeEntity& entity : found->second) {
      CANDELA_ASSIGN(ObjectPtr shape, shapes_.build(entity));
      if (shape) add(*shapes, "", std::move(shape));
    }
    if (shapes->children.empty()) {
      context_.differs(instance.where,
                       fmt::format("the object {} has no shapes", text::quote(instance.name)));
      return group;
    }
    CANDELA_ASSIGN(group, Context::finish(shapes));
    return group;
  }

  Result<void> add_instances(Object& scene) {
    for (const Instance& instance : instances_) {
      CANDELA_ASSIGN(ObjectPtr group, group_of(instance));
      if (!group) continue;
      const std::shared_ptr<Object> object = make("shape", "instance", instance.where);
      set(*object, "to_world", instance.to_world);
      add(*object, "", std::move(group));
      CANDELA_ASSIGN(ObjectPtr finished, Context::finish(object));
      add(scene, "", std::move(finished));
    }
    return {};
  }

  Result<ReadScene> finish() {
    const std::shared_ptr<Object> scene = make("scene", "", {main_file_, 1});
    CANDELA_ASSIGN(ObjectPtr integrator, build_integrator(context_, options_));
    add(*scene, "", std::move(integrator));
    CANDELA_ASSIGN(ObjectPtr medium, media_.medium(options_.camera_medium, options_.camera.where));
    CANDELA_ASSIGN(ObjectPtr sensor, build_sensor(context_, options_, std::move(medium)));
    add(*scene, "", std::move(sensor));
    for (ObjectPtr& emitter : emitters_) add(*scene, "", std::move(emitter));
    for (ShapeEntity& entity : shape_entities_) {
      CANDELA_ASSIGN(ObjectPtr shape, shapes_.build(entity));
      if (shape) add(*scene, "", std::move(shape));
    }
    CANDELA_TRY(add_instances(*scene));
    CANDELA_ASSIGN(ObjectPtr root, Context::finish(scene));
    std::set<std::string> files = context_.take_files();
    std::vector<Note> passed_over = context_.take_passed_over();
    std::vector<Note> notes = context_.take_notes();
    notes.insert(notes.end(), passed_over.begin(), passed_over.end());
    return ReadScene{{std::move(root), {files.begin(), files.end()}, std::move(notes)},
                     std::move(passed_over)};
  }

  Context context_;
  Textures textures_;
  Materials materials_;
  Media media_;
  Shapes shapes_;

  std::string main_file_;
  std::vector<std::string> include_stack_;
  std::size_t include_count_ = 0, entity_count_ = 0, total_bytes_ = 0;
  bool in_world_ = false;
  bool active_ = true;  // transforms are those at the start of the shutter
  State state_;
  std::vector<Scope> scopes_;
  std::map<std::string, Mat4, std::less<>> coordinate_systems_;
  RenderOptions options_;
  double exposure_ = 1;
  std::vector<ObjectPtr> emitters_;
  std::vector<ShapeEntity> shape_entities_;
  std::map<std::string, std::vector<ShapeEntity>, std::less<>> objects_;
  std::vector<ShapeEntity>* object_ = nullptr;  // being defined
  std::vector<Instance> instances_;
  std::map<std::string, ObjectPtr, std::less<>> groups_;
};

std::span<const Reader::Directive> Reader::directives() {
  static constexpr std::array<Directive, 40> all = {{
      {"Accelerator", &Reader::accelerator},
      {"ActiveTransform", &Reader::active_transform},
      {"AreaLightSource", &Reader::area_light_source},
      {"Attribute", &Reader::attribute},
      {"AttributeBegin", &Reader::attribute_begin},
      {"AttributeEnd", &Reader::attribute_end},
      {"Camera", &Reader::camera},
      {"ColorSpace", &Reader::color_space_directive},
      {"ConcatTransform", &Reader::concat_transform},
      {"CoordSysTransform", &Reader::use_coordinate_system},
      {"CoordinateSystem", &Reader::coordinate_system},
      {"Film", &Reader::film},
      {"Identity", &Reader::identity},
      {"Import", &Reader::import},
      {"Include", &Reader::include},
      {"Integrator", &Reader::integrator},
      {"LightSource", &Reader::light_source},
      {"LookAt", &Reader::look_at},
      {"MakeNamedMaterial", &Reader::make_named_material},
      {"MakeNamedMedium", &Reader::make_named_medium},
      {"Material", &Reader::material},
      {"MediumInterface", &Reader::medium_interface},
      {"NamedMaterial", &Reader::named_material},
      {"ObjectBegin", &Reader::object_begin},
      {"ObjectEnd", &Reader::object_end},
      {"ObjectInstance", &Reader::object_instance},
      {"Option", &Reader::option},
      {"PixelFilter", &Reader::filter},
      {"ReverseOrientation", &Reader::reverse_orientation},
      {"Rotate", &Reader::rotate},
      {"Sampler", &Reader::sampler},
      {"Scale", &Reader::scale},
      {"Shape", &Reader::shape},
      {"Texture", &Reader::texture},
      {"Transform", &Reader::set_transform},
      {"TransformBegin", &Reader::transform_begin},
      {"TransformEnd", &Reader::transform_end},
      {"TransformTimes", &Reader::transform_times},
      {"Translate", &Reader::translate},
      {"WorldBegin", &Reader::world_begin},
  }};
  return all;
}

}  // namespace

bool is_pbrt_file(std::string_view key) {
  return key.ends_with(".pbrt") || key.ends_with(".pbrt.gz");
}

Result<ReadScene> read_pbrt_scene(const FileSource& files, const std::string& main_key,
                                  const std::map<std::string, std::string>& parameters,
                                  const Reading& reading) {
  if (!parameters.empty())
    return input_error(
               fmt::format("the scene does not use the parameter {}", text::quote(parameters.begin()->first)))
        .at(main_key, 0)
        .with_mend("a pbrt scene has none");
  const UnpackedFiles unpacked(files);
  return Reader(unpacked, reading, main_key).run();
}

}  // namespace candela::description::pbrt
