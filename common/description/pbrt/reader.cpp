#include "common/description/pbrt/reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "common/base/work_monitor.h"
#include "common/description/check.h"
#include "common/description/pbrt/camera.h"
#include "common/description/pbrt/geometry.h"
#include "common/description/pbrt/graphics_state.h"
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

constexpr std::size_t max_includes = 1'000'000;
constexpr std::size_t max_include_depth = 64;
constexpr std::size_t max_total_bytes = std::size_t{4} << 30;

struct Instance {
  std::string name;
  Mat4 to_world{};
  Location where;
};

class Reader {
 public:
  Reader(const UnpackedFiles& files, const Reading& reading, const std::string& main_key)
      : context_(files, reading),
        textures_(context_),
        materials_(context_, textures_, {main_key, 1}),
        media_(context_),
        shapes_(context_, textures_, materials_, media_),
        state_(context_),
        main_file_(main_key) {
    context_.set_main_file(main_key);
    for (Entity* option :
         {&options_.camera, &options_.film, &options_.filter, &options_.sampler, &options_.integrator})
      option->where = {main_key, 1};
  }

  Result<ReadScene> run() {
    CANDELA_TRY(read_file(main_file_, nullptr));
    if (state_.depth() > 0) return state_.unfinished("has no end");
    if (!state_.in_world()) {
      const Error error = input_error("the scene has no WorldBegin").at(main_file_, 0);
      CANDELA_TRY(context_.refuse(error, "its world is empty"));
      CANDELA_TRY(begin_world());
    }
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

  // `includer`: where a directive goes on that the file ends within; null for none.
  Result<void> read_file(const std::string& key, Tokens* includer) {
    CANDELA_ASSIGN(const FileSource::Bytes bytes, context_.open(key, max_total_bytes - total_bytes_));
    total_bytes_ += bytes.view.size();
    if (total_bytes_ > max_total_bytes)
      return input_error(fmt::format("the scene has more than {} bytes of text", max_total_bytes)).at(key, 0);
    include_stack_.push_back(key);
    follows_shape_ = false;
    Tokens tokens(key, bytes.view, 0, 1, includer, context_.budget());
    while (!tokens.at_end()) {
      work_step();
      CANDELA_ASSIGN(const std::optional<Token> word, tokens.next());
      if (word) CANDELA_TRY(directive(tokens, *word));
    }
    include_stack_.pop_back();
    return {};
  }

  Result<void> directive(Tokens& tokens, const Token& word) {
    if (word.quoted)
      return error_at(tokens.where(word),
                      fmt::format("a string {} at the place of a directive", text::quote(word.text)));
    const bool is_shape = word.text == "Shape";
    follows_shape_ = follows_shape_ && is_shape;
    CANDELA_TRY(handle(tokens, word));
    follows_shape_ = is_shape;
    return {};
  }

  Result<void> handle(Tokens& tokens, const Token& word) {
    const auto named = [&](const auto& d) { return d.name == word.text; };
    const auto own = directives();
    if (const auto found = std::find_if(own.begin(), own.end(), named); found != own.end())
      return (this->*found->handler)(tokens, word);
    const auto of_state = GraphicsState::directives();
    if (const auto found = std::find_if(of_state.begin(), of_state.end(), named); found != of_state.end())
      return (state_.*found->handler)(tokens, word);
    std::vector<std::string_view> known;
    for (const Directive& d : own) known.push_back(d.name);
    for (const GraphicsState::Directive& d : of_state) known.push_back(d.name);
    return Context::unknown(tokens.where(word), "directive", word.text, known);
  }

  Result<void> include(Tokens& tokens, const Token& word) { return include_in(tokens, word, &tokens); }

  Result<void> include_in(Tokens& tokens, const Token& word, Tokens* includer) {
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    CANDELA_ASSIGN(const std::string key, context_.find_file(tokens.where(word), name));
    if (std::find(include_stack_.begin(), include_stack_.end(), key) != include_stack_.end())
      return error_at(tokens.where(word), fmt::format("{} includes itself", text::quote(key)));
    if (include_stack_.size() > max_include_depth)
      return error_at(tokens.where(word),
                      fmt::format("includes are nested deeper than {} levels", max_include_depth));
    if (++include_count_ > max_includes)
      return error_at(tokens.where(word), fmt::format("the scene has more than {} includes", max_includes));
    return read_file(key, includer);
  }

  // An included file that changes nothing of the state.
  Result<void> import(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    const std::size_t depth = state_.depth();
    CANDELA_TRY(state_.push(tokens, word, "Import"));
    CANDELA_TRY(include_in(tokens, word, nullptr));
    if (state_.depth() != depth + 1) return state_.unfinished("has no end in its file");
    return state_.pop(tokens, word, "Import");
  }

  // ---- words ----

  Result<void> expect_options(Tokens& tokens, const Token& word) const {
    if (!state_.in_world()) return {};
    return error_at(tokens.where(word), fmt::format("{} stands behind WorldBegin", word.text));
  }

  // ---- options ----

  Result<void> option_entity(Tokens& tokens, const Token& word, Entity& option) {
    CANDELA_TRY(expect_options(tokens, word));
    CANDELA_ASSIGN(option, read_entity(context_, tokens, word));
    return {};
  }
  Result<void> camera(Tokens& tokens, const Token& word) {
    CANDELA_TRY(option_entity(tokens, word, options_.camera));
    options_.camera_from_world = state_.values().world_from_object;
    options_.camera_medium = state_.outside();
    state_.name_camera();
    return {};
  }
  Result<void> film(Tokens& tokens, const Token& word) { return option_entity(tokens, word, options_.film); }
  Result<void> filter(Tokens& tokens, const Token& word) {
    options_.has_filter = true;
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
  // A name and a value without a type.
  Result<void> option(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    CANDELA_ASSIGN(const std::optional<Token> value, tokens.next());
    if (!value) return error_at(tokens.here(), fmt::format("the option {} has no value", text::quote(name)));
    return read_option(context_, name, value->text, tokens.where(word));
  }

  Result<void> begin_world() {
    CANDELA_ASSIGN(exposure_, exposure(context_, options_));
    if (options_.camera_from_world == Mat4{}) options_.camera_from_world = transform::identity;
    state_.begin_world();
    return {};
  }
  Result<void> world_begin(Tokens& tokens, const Token& word) {
    CANDELA_TRY(expect_options(tokens, word));
    if (state_.depth() > 0) return state_.unfinished("has no end before WorldBegin");
    return begin_world();
  }

  // ---- what the world holds ----

  Result<void> material(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, read_entity(context_, tokens, word));
    given.parameters.set_defaults(state_.shared("material"));
    CANDELA_ASSIGN(const std::size_t index, materials_.add(given.type, std::move(given.parameters),
                                                           state_.values().space, given.where));
    return state_.set_material({{}, index, given.where});
  }
  Result<void> make_named_material(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, read_entity(context_, tokens, word));
    given.parameters.set_defaults(state_.shared("material"));
    return materials_.define(given.type, std::move(given.parameters), state_.values().space, given.where);
  }
  Result<void> named_material(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    return state_.set_material({name, 0, tokens.where(word)});
  }
  Result<void> texture(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    CANDELA_ASSIGN(const std::string kind, read_string(tokens, word));
    CANDELA_ASSIGN(Entity given, read_entity(context_, tokens, word));
    given.parameters.set_defaults(state_.shared("texture"));
    return textures_.define(name, kind, given.type, std::move(given.parameters), state_.values().space,
                            given.where);
  }
  Result<void> make_named_medium(Tokens& tokens, const Token& word) {
    CANDELA_ASSIGN(Entity given, read_entity(context_, tokens, word));
    MediumEntity medium{given.type,
                        std::move(given.parameters),
                        given.where,
                        word.offset,
                        state_.values().world_from_object,
                        state_.values().space,
                        !state_.shared("medium").empty()};
    medium.parameters.set_defaults(state_.shared("medium"));
    return media_.define(std::move(medium));
  }
  Result<void> light_source(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, read_entity(context_, tokens, word));
    given.parameters.set_defaults(state_.shared("light"));
    CANDELA_ASSIGN(ObjectPtr medium, media_.medium(state_.outside(), given.where));
    LightEntity light{given.type,
                      std::move(given.parameters),
                      given.where,
                      state_.values().world_from_object,
                      state_.values().space,
                      std::move(medium),
                      exposure_};
    CANDELA_ASSIGN(ObjectPtr emitter, build_light(context_, textures_, light));
    if (!emitter) return {};
    CANDELA_TRY(make_room(emitters_, context_.budget(), given.where, "lights"));
    emitters_.push_back(std::move(emitter));
    return {};
  }
  Result<void> area_light_source(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, read_entity(context_, tokens, word));
    given.parameters.set_defaults(state_.shared("light"));
    LightEntity light{given.type,
                      std::move(given.parameters),
                      given.where,
                      state_.values().world_from_object,
                      state_.values().space,
                      nullptr,
                      exposure_};
    CANDELA_ASSIGN(state_.values().emitter, build_area_light(context_, textures_, light));
    return {};
  }

  Result<void> shape(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(Entity given, read_entity(context_, tokens, word));
    ShapeEntity shape;
    shape.type = std::move(given.type);
    shape.parameters = std::move(given.parameters);
    const SharedParameters& shared = state_.shared("shape");
    shape.has_shared_values = shared.size() > (shared.find("alpha") != nullptr ? 1 : 0);
    shape.parameters.set_defaults(shared);
    shape.parameters.forget_long_lists();
    shape.where = given.where;
    shape.offset = word.offset;
    shape.to_world = state_.values().world_from_object;
    shape.reverse_orientation = state_.values().reverse_orientation;
    shape.material = state_.values().material;
    shape.inside = state_.values().inside;
    shape.outside = state_.values().outside;
    std::vector<ShapeEntity>& shapes = object_ == nullptr ? shape_entities_ : *object_;
    if (follows_shape_ && !shapes.empty() && shapes.back().joins(shape)) {
      ++shapes.back().curve_count;
      return {};
    }
    CANDELA_TRY(make_room(shapes, context_.budget(), given.where, "shapes"));
    if (object_ == nullptr) {
      shape.emitter = state_.values().emitter;
      shape_entities_.push_back(std::move(shape));
      return {};
    }
    if (state_.values().emitter)
      context_.differs(given.where, "a shape of an object that is instanced does not glow, as in pbrt");
    object_->push_back(std::move(shape));
    return {};
  }

  // ---- instances ----

  Result<void> object_begin(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    if (object_ != nullptr) return error_at(tokens.where(word), "ObjectBegin within an object");
    constexpr std::size_t entries_bytes = 256;  // in both maps
    CANDELA_TRY(
        context_.budget().charge(entries_bytes + 2 * heap_bytes(name), tokens.where(word), "objects"));
    const auto [entry, added] = objects_.try_emplace(name);
    if (!added)
      return error_at(tokens.where(word), fmt::format("the object {} is defined twice", text::quote(name)));
    object_ = &entry->second;
    return state_.push(tokens, word, "ObjectBegin");
  }
  Result<void> object_end(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.pop(tokens, word, "ObjectBegin"));
    object_ = nullptr;
    return {};
  }
  Result<void> object_instance(Tokens& tokens, const Token& word) {
    CANDELA_TRY(state_.expect_world(tokens, word));
    CANDELA_ASSIGN(const std::string name, read_string(tokens, word));
    if (object_ != nullptr)
      return error_at(tokens.where(word), "ObjectInstance within an object is not supported");
    CANDELA_TRY(make_room(instances_, context_.budget(), tokens.where(word), "instances"));
    CANDELA_TRY(context_.budget().charge(heap_bytes(name), tokens.where(word), "instances"));
    instances_.push_back({name, state_.values().world_from_object, tokens.where(word)});
    return {};
  }

  // ---- the end ----

  // Makes shapes of the entities, and leaves nothing of these.
  Result<void> add_shapes(std::vector<ShapeEntity>& entities, Object& to) {
    for (ShapeEntity& kept : entities) {
      work_step();
      ShapeEntity entity = std::move(kept);
      CANDELA_ASSIGN(ObjectPtr shape, shapes_.build(entity));
      if (shape) CANDELA_TRY(add_counted(to, std::move(shape), context_.budget()));
    }
    context_.budget().give_back(entities.capacity() * sizeof(ShapeEntity));
    std::vector<ShapeEntity>().swap(entities);
    return {};
  }

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
    shapes->id = instance.name;
    CANDELA_TRY(add_shapes(found->second, *shapes));
    if (shapes->children.empty()) {
      context_.differs(instance.where,
                       fmt::format("the object {} has no shapes", text::quote(instance.name)));
      return group;
    }
    CANDELA_ASSIGN(group, context_.finish(shapes));
    return group;
  }

  Result<void> add_instances(Object& scene) {
    for (const Instance& instance : instances_) {
      CANDELA_ASSIGN(ObjectPtr group, group_of(instance));
      if (!group) continue;
      const std::shared_ptr<Object> object = make("shape", "instance", instance.where);
      set(*object, "to_world", instance.to_world);
      add(*object, "", std::move(group));
      CANDELA_ASSIGN(ObjectPtr finished, context_.finish(object));
      CANDELA_TRY(add_counted(scene, std::move(finished), context_.budget()));
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
    for (ObjectPtr& emitter : emitters_)
      CANDELA_TRY(add_counted(*scene, std::move(emitter), context_.budget()));
    CANDELA_TRY(add_shapes(shape_entities_, *scene));
    CANDELA_TRY(add_instances(*scene));
    // Not checked as a scene of XML is, which has one sky at most: pbrt's add up.
    ObjectPtr root = scene;
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
  GraphicsState state_;

  std::string main_file_;
  std::vector<std::string> include_stack_;
  std::size_t include_count_ = 0, total_bytes_ = 0;
  RenderOptions options_;
  double exposure_ = 1;
  bool follows_shape_ = false;  // no other directive stands behind the last shape
  std::vector<ObjectPtr> emitters_;
  std::vector<ShapeEntity> shape_entities_;
  std::map<std::string, std::vector<ShapeEntity>, std::less<>> objects_;
  std::vector<ShapeEntity>* object_ = nullptr;  // being defined
  std::vector<Instance> instances_;
  std::map<std::string, ObjectPtr, std::less<>> groups_;
};

std::span<const Reader::Directive> Reader::directives() {
  static constexpr std::array<Directive, 21> all = {{
      {"Accelerator", &Reader::accelerator},
      {"AreaLightSource", &Reader::area_light_source},
      {"Camera", &Reader::camera},
      {"Film", &Reader::film},
      {"Import", &Reader::import},
      {"Include", &Reader::include},
      {"Integrator", &Reader::integrator},
      {"LightSource", &Reader::light_source},
      {"MakeNamedMaterial", &Reader::make_named_material},
      {"MakeNamedMedium", &Reader::make_named_medium},
      {"Material", &Reader::material},
      {"NamedMaterial", &Reader::named_material},
      {"ObjectBegin", &Reader::object_begin},
      {"ObjectEnd", &Reader::object_end},
      {"ObjectInstance", &Reader::object_instance},
      {"Option", &Reader::option},
      {"PixelFilter", &Reader::filter},
      {"Sampler", &Reader::sampler},
      {"Shape", &Reader::shape},
      {"Texture", &Reader::texture},
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
