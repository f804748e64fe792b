#include "common/description/resolve.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/base/work_monitor.h"
#include "common/description/all_errors.h"
#include "common/description/check.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description {
namespace {

constexpr int max_height = 128;
constexpr std::uint64_t max_unfolded = 20'000'000;
constexpr std::size_t max_replaced = 256;
constexpr std::size_t max_resolved_notes = 100'000;

class Resolver {
 public:
  Resolver(std::vector<Draft>& drafts, const std::map<std::string, std::size_t, std::less<>>& ids,
           const Joining& joining)
      : drafts_(drafts),
        ids_(ids),
        lenient_(joining.lenient),
        passed_over_(joining.passed_over),
        errors_(joining.errors),
        nodes_(drafts.size()) {}

  // `depth` bounds this recursion; `from` is where the draft is used.
  Result<void> visit(std::size_t index, int depth, const Location& from) {
    Node& node = nodes_[index];
    if (node.state == State::done) return {};
    Draft& draft = drafts_[index];
    if (node.state == State::open)
      return error_at(from, fmt::format("{} contains itself by this reference", describe(*draft.object)));
    if (depth > max_height)
      return error_at(from, fmt::format("objects are nested deeper than {} levels", max_height));
    node.state = State::open;
    std::vector<Location> where;
    // An object that Mitsuba has and Candela lacks (another integrator) is kept; its rules are not known.
    const PluginRule* rule = find_plugin(draft.object->category, draft.object->plugin);
    const bool unfolds = draft.object->category != "scene" && draft.object->category != "shape";
    std::size_t replaced = 0;
    for (const Link& link : draft.links) {
      work_step();
      std::size_t target = link.target;
      if (link.is_reference) {
        const auto found = ids_.find(link.id);
        if (found == ids_.end()) {
          CANDELA_TRY(fail(draft, unknown_id(link)));
          continue;
        }
        target = found->second;
      }
      if (Result<void> visited = visit(target, depth + 1, link.where); !visited.ok()) {
        CANDELA_TRY(fail(draft, std::move(visited).error()));
        continue;
      }
      node.height = std::max(node.height, nodes_[target].height + 1);
      if (unfolds) node.unfolded = std::min(max_unfolded + 1, node.unfolded + nodes_[target].unfolded);
      if (drafts_[target].left_out) continue;
      const Child child{link.slot, drafts_[target].object};
      if (draft.object->category == "shape" && child.object->plugin == "irradiancemeter" &&
          child.object->category == "sensor") {
        if (Result<void> laid = lay_meter_on(draft.object, *drafts_[target].object, child, link.where);
            !laid.ok())
          CANDELA_TRY(fail(draft, std::move(laid).error()));
        continue;
      }
      if (lenient_ && drafts_[target].stands_in && child.object->category == "sensor" &&
          draft.object->category == "shape") {
        move_sensor_out(*draft.object, *drafts_[target].object, child, link.where);
        continue;
      }
      if (lenient_ && draft.object->category == "shape" && child.object->category == "emitter" &&
          child.object->plugin != "area") {
        move_emitter_out(*draft.object, *child.object, link.where);
        continue;
      }
      if (draft.object->plugin == "blendphase" && child.object->category == "volume" &&
          take_weight(*draft.object, child, link.where))
        continue;
      if (lenient_ && rule != nullptr && draft.stands_in && !fits(*draft.object, *rule, child)) {
        tell(error_at(link.where, fmt::format("{} cannot be inside {}", describe(*child.object),
                                              describe(*draft.object))));
        continue;
      }
      if (lenient_ && rule != nullptr && is_for_unknown_parameter(*draft.object, *rule, child)) {
        tell(unknown_parameter(*draft.object, *rule, link.where, link.slot));
        continue;
      }
      if (rule != nullptr && is_value(*rule, child)) {
        if (link.before_property && draft.object->find(link.slot) != nullptr) {
          tell_twice(*draft.object, link.slot, draft.object->find(link.slot)->where, link.where);
          continue;
        }
        // Each replacement looks at all children: a bound keeps hostile input cheap.
        if (++replaced > max_replaced)
          return error_at(link.where, fmt::format("{} has more than {} textures and volumes as parameters",
                                                  describe(*draft.object), max_replaced));
        replace_value(*draft.object, link, where);
      }
      if (lenient_ && rule != nullptr && is_unfit_texture(*draft.object, *rule, child)) {
        tell(error_at(link.where, fmt::format("a texture as parameter {} of {} is not supported",
                                              text::quote(link.slot), describe(*draft.object))));
        continue;
      }
      draft.object->children.push_back(child);
      where.push_back(link.where);
    }
    if (lenient_) unnest_maps(*draft.object, where);
    if (node.height > max_height)
      return error_at(from, fmt::format("objects are nested deeper than {} levels", max_height));
    if (node.unfolded > max_unfolded)
      return error_at(draft.object->where, fmt::format("{} unfolds into more than {} objects",
                                                       describe(*draft.object), max_unfolded));
    if (draft.object->category == "scene")
      for (const auto& [moved, place] : moved_) {
        draft.object->children.push_back(moved);
        where.push_back(place);
      }
    if (draft.object->category == "texture" && node.unfolded > max_texture_unfolded)
      return error_at(draft.object->where, fmt::format("{} unfolds into more than {} textures",
                                                       describe(*draft.object), max_texture_unfolded));
    if (rule != nullptr && !draft.broken)
      if (Result<void> fits = check_children(*draft.object, *rule, where); !fits.ok())
        CANDELA_TRY(fail(draft, std::move(fits).error()));
    if (draft.legacy && draft.object->category == "scene") finish_old_scene(*draft.object);
    if (draft.legacy && draft.object->category == "shape") bound_media_unseen(*draft.object);
    if (draft.legacy && draft.object->category == "sensor") begin_media_at_camera(*draft.object);
    if (draft.object->category == "sensor" && draft.object->plugin == "distant") filter_by_box(*draft.object);
    node.state = State::done;
    return {};
  }

 private:
  // The reading goes on, if all errors are wanted.
  Result<void> fail(Draft& draft, Error error) {
    draft.broken = true;
    if (!collect(errors_, error)) return error;
    return {};
  }

  // A texture, or a medium's volume, in the place of a parameter's value.
  static bool is_value(const PluginRule& rule, const Child& child) {
    const std::string& category = child.object->category;
    if (child.slot.empty() || (category != "texture" && category != "volume")) return false;
    const PropertyRule* slot = find_rule(rule, child.slot);
    return slot != nullptr && (category == "volume" ? rule.category == "medium" : slot->textured);
  }

  void tell_twice(const Object& object, std::string_view slot, const Location& counts,
                  const Location& other) {
    tell(error_at(other, fmt::format("parameter '{}' of {} is given twice", slot, describe(object))),
         fmt::format("that of line {} counts", counts.line));
  }

  // Takes away what is given for the link's slot before the link.
  void replace_value(Object& object, const Link& link, std::vector<Location>& where) {
    if (link.after_property) {
      std::erase_if(object.properties, [&](const Property& property) {
        if (property.name != link.slot) return false;
        tell_twice(object, link.slot, link.where, property.where);
        return true;
      });
    }
    for (std::size_t i = object.children.size(); i-- > 0;) {
      const Child& child = object.children[i];
      if (child.slot != link.slot ||
          (child.object->category != "texture" && child.object->category != "volume"))
        continue;
      tell_twice(object, link.slot, link.where, where[i]);
      object.children.erase(object.children.begin() + static_cast<std::ptrdiff_t>(i));
      where.erase(where.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

  // 0.6 takes the last of several sensors, and lights a scene that has no light.
  void finish_old_scene(Object& scene) {
    const auto is_sensor = [](const Child& child) { return child.object->category == "sensor"; };
    const auto first = std::find_if(scene.children.begin(), scene.children.end(), is_sensor);
    const auto last = std::find_if(scene.children.rbegin(), scene.children.rend(), is_sensor);
    if (first == scene.children.end()) return;
    std::rotate(first, last.base() - 1, last.base());
    const auto is = [](std::string_view category) {
      return [category](const Draft& draft) { return draft.object->category == category; };
    };
    if (std::any_of(drafts_.begin(), drafts_.end(), is("emitter")) ||
        std::none_of(drafts_.begin(), drafts_.end(), is("shape")))
      return;
    auto sky = std::make_shared<Object>();
    sky->category = "emitter";
    sky->plugin = "sunsky";
    sky->where = scene.where;
    const Mat4 turned = *transform::rotate({0, 1, 0}, -120);
    sky->properties = {{"to_world", PropertyType::transform, turned, scene.where},
                       {"sky_scale", PropertyType::number, 2.0, scene.where},
                       {"sun_scale", PropertyType::number, 2.0, scene.where},
                       {"sun_radius_scale", PropertyType::number, 15.0, scene.where}};
    scene.children.push_back({{}, std::move(sky)});
    tell(error_at(scene.where, "the scene has no light"),
         "a sun and a sky are added, as in 0.6, but dark below the horizon");
  }

  enum class State { untouched, open, done };
  struct Node {
    State state = State::untouched;
    int height = 1;
    std::uint64_t unfolded = 1;
  };

  // These films have no border, so their filter is a box.
  static void filter_by_box(Object& sensor) {
    auto film = std::make_shared<Object>();
    film->category = "film";
    film->plugin = "hdrfilm";
    film->where = sensor.where;
    if (const auto films = sensor.children_of("film"); !films.empty()) *film = *films[0];
    std::erase_if(film->children, [](const Child& c) { return c.object->category == "rfilter"; });
    auto box = std::make_shared<Object>();
    box->category = "rfilter";
    box->plugin = "box";
    box->where = film->where;
    film->children.push_back({{}, box});
    std::erase_if(sensor.children, [](const Child& c) { return c.object->category == "film"; });
    sensor.children.push_back({{}, film});
  }

  // An irradiance meter goes out of its shape, and the shape into the meter.
  Result<void> lay_meter_on(const ObjectPtr& shape, Object& meter, const Child& child,
                            const Location& where) {
    if (!meter.children_of("shape").empty())
      return error_at(where, fmt::format("{} is in two shapes", describe(meter)));
    filter_by_box(meter);
    meter.children.push_back({{}, shape});
    moved_.emplace_back(Child{{}, child.object}, where);
    return {};
  }

  // A sensor that lies on a shape, for one that Candela lacks: it goes beside the shape, with its place.
  void move_sensor_out(const Object& shape, Object& sensor, const Child& child, const Location& where) {
    std::erase_if(sensor.properties, [](const Property& property) { return property.name == "to_world"; });
    sensor.properties.push_back(
        {"to_world", PropertyType::transform, shape.get_transform("to_world"), sensor.where});
    moved_.emplace_back(Child{{}, child.object}, where);
  }

  // An emitter inside of a shape that is not its surface: a copy goes beside the shape, in the shape's frame.
  void move_emitter_out(const Object& shape, const Object& emitter, const Location& where) {
    tell(error_at(where, fmt::format("{} cannot be inside {}", describe(emitter), describe(shape)))
             .with_mend("it is put beside the shape, in its frame"));
    auto moved = std::make_shared<Object>(emitter);
    Mat4 place = emitter.get_transform("to_world");
    if (emitter.find("position") != nullptr) place = transform::translate(emitter.get_vec3("position", {}));
    std::erase_if(moved->properties, [](const Property& property) {
      return property.name == "to_world" || property.name == "position";
    });
    Mat4 to_world = transform::multiply(shape.get_transform("to_world"), place);
    if (is_rigid_light(emitter) && !transform::is_similarity(to_world))
      to_world = transform::without_shear(to_world).value_or(place);
    if (emitter.find("direction") == nullptr)
      moved->properties.push_back({"to_world", PropertyType::transform, to_world, emitter.where});
    moved_.emplace_back(Child{{}, std::move(moved)}, where);
  }

  static bool is_map(const Object& object) {
    return object.plugin == "bumpmap" || object.plugin == "normalmap";
  }

  // If a bump or normal map stands directly inside another one, the outer map counts.
  void unnest_maps(Object& object, const std::vector<Location>& where) {
    if (!is_map(object)) return;
    for (std::size_t i = 0; i < object.children.size(); ++i) {
      Child& child = object.children[i];
      while (is_map(*child.object) && !child.object->children_of("bsdf").empty()) {
        tell(error_at(where[i],
                      fmt::format("{} inside {} is not supported", describe(*child.object), describe(object)))
                 .with_mend("the outer one counts"));
        child.object = child.object->children_of("bsdf").front();
      }
    }
  }

  // In 0.6 a shape with a medium and nothing else is not seen. Later versions differ: see review.h.
  static void bound_media_unseen(Object& shape) {
    const auto has = [&](std::string_view category) { return !shape.children_of(category).empty(); };
    if (!has("medium") || has("bsdf") || has("emitter")) return;
    auto null = std::make_shared<Object>();
    null->category = "bsdf";
    null->plugin = "null";
    null->where = shape.where;
    shape.children.push_back({{}, std::move(null)});
  }

  // 0.6 counts the way through a medium from the camera, not from the near plane. A near plane so close is at
  // the camera; it differs where a surface is nearer than the scene's near plane.
  static void begin_media_at_camera(Object& sensor) {
    if (sensor.children_of("medium").empty()) return;
    constexpr double at_camera = 1e-6;
    for (Property& property : sensor.properties)
      if (property.name == "near_clip") {
        property.type = PropertyType::number;
        property.value = at_camera;
        return;
      }
    sensor.properties.push_back({"near_clip", PropertyType::number, at_camera, sensor.where});
  }

  // A weight that is a constant volume is a number. Under the lenient reading half takes the place of another
  // volume. False: it stays a child, which is an error.
  bool take_weight(Object& blend, const Child& child, const Location& where) {
    if (child.slot != "weight" || blend.find("weight") != nullptr) return false;
    double weight = 0.5;
    if (child.object->plugin == "constvolume") {
      const Vec3 value = child.object->get_rgb("value").value_or(Rgb{{1, 1, 1}}).value;
      if (value[0] != value[1] || value[1] != value[2] || value[0] > 1) return false;
      weight = value[0];
    } else if (!lenient_) {
      return false;
    } else {
      tell(error_at(where, "the 'weight' of phase 'blendphase' cannot vary").with_mend("it is 0.5"));
    }
    blend.properties.push_back({"weight", PropertyType::number, weight, where});
    return true;
  }

  void tell(const Error& error) {
    if (passed_over_.size() < max_resolved_notes) passed_over_.push_back(passed_over_note(error));
  }
  void tell(const Error& error, std::string_view instead) {
    if (passed_over_.size() < max_resolved_notes)
      passed_over_.push_back({{error.file, error.line}, fmt::format("{}: {}", error.message, instead)});
  }

  // True if an object that stands in for another can take the child beside those it has.
  static bool fits(const Object& object, const PluginRule& rule, const Child& child) {
    const auto& categories = rule.child_categories;
    if (child.object->category == "texture" &&
        std::find(categories.begin(), categories.end(), "texture") == categories.end()) {
      const auto any = [](const PropertyRule& property) { return property.any_slot; };
      if (std::any_of(rule.properties.begin(), rule.properties.end(), any))
        return object.children_of("texture").empty();
      const PropertyRule* slot = find_rule(rule, child.slot);
      return slot != nullptr && slot->textured && object.find(child.slot) == nullptr &&
             object.find_child(child.slot) == nullptr;
    }
    if (std::find(categories.begin(), categories.end(), child.object->category) == categories.end())
      return false;
    const bool several = object.category == "bsdf" || object.category == "shape" ||
                         child.object->category == "volume" || child.object->category == "medium";
    return several || object.children_of(child.object->category).empty();
  }

  Error unknown_id(const Link& link) const {
    std::vector<std::string_view> known;
    for (const auto& [id, target] : ids_) known.push_back(id);
    return error_at(link.where, fmt::format("no object has the id {}", text::quote(link.id)))
        .with_mend(text::did_you_mean(nearest_name(link.id, known)));
  }

  std::vector<Draft>& drafts_;
  const std::map<std::string, std::size_t, std::less<>>& ids_;
  const bool lenient_;
  std::vector<Note>& passed_over_;
  std::vector<Error>* errors_;
  std::vector<std::pair<Child, Location>> moved_;  // out of shapes, beside them
  std::vector<Node> nodes_;
};

}  // namespace

Result<ObjectPtr> resolve(std::vector<Draft>& drafts, std::size_t root,
                          const std::map<std::string, std::size_t, std::less<>>& ids,
                          const Joining& joining) {
  Resolver resolver(drafts, ids, joining);
  Result<void> result = resolver.visit(root, 1, drafts[root].object->where);
  if (result.ok() && (joining.errors == nullptr || joining.errors->empty()))
    return ObjectPtr(drafts[root].object);
  // A graph with a cycle would keep itself alive.
  for (Draft& draft : drafts) draft.object->children.clear();
  if (!result.ok()) return std::move(result).error();
  return joining.errors->front();
}

bool collect(std::vector<Error>* errors, const Error& error) {
  if (errors == nullptr || errors->size() >= kMaxErrors) return false;
  errors->push_back(error);
  return true;
}

Note passed_over_note(const Error& error) {
  const std::string mend = error.mend.empty() ? std::string() : fmt::format(" ({})", error.mend);
  return {{error.file, error.line}, fmt::format("{}: it is passed over{}", error.message, mend)};
}

}  // namespace candela::description
