#include "common/description/review.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "common/base/enum_names.h"
#include "common/description/check.h"
#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

// True for children of the scene that act by themselves; the others are there to be referred to.
bool acts(const Object& object) {
  return object.category == "shape" ? object.plugin != "shapegroup"
         : object.category == "emitter"
             // An area emitter glows in the shapes that refer to it.
             ? object.plugin != "area"
             : object.category == "sensor" || object.category == "integrator";
}

bool is_value(const Property& property, std::string_view value) {
  if (value.empty()) return false;
  if (const auto* flag = std::get_if<bool>(&property.value)) return text::to_boolean(value) == *flag;
  if (const auto* integer = std::get_if<std::int64_t>(&property.value))
    return text::to_number(value) == static_cast<double>(*integer);
  if (const auto* number = std::get_if<double>(&property.value)) return text::to_number(value) == *number;
  if (const auto* string = std::get_if<std::string>(&property.value)) return text::lower(*string) == value;
  return false;
}

class Reviewer {
 public:
  explicit Reviewer(const SceneDescription& scene) : scene_(scene) {}

  Review run() {
    for (const Note& note : scene_.notes) add(Finding::Kind::differs, note.where, note.text);
    const Object* sensor = nullptr;
    for (const Child& child : scene_.scene->children) {
      const Object& object = *child.object;
      if (!acts(object)) continue;
      if (object.category == "sensor") {
        if (sensor != nullptr) {
          unused(object, "is one sensor too many: the first is used");
          continue;
        }
        sensor = &object;
      }
      visit(object);
    }
    for (const Child& child : scene_.scene->children) {
      const Object& object = *child.object;
      if (!acts(object) && !seen_.contains(&object)) unused(object, "is used by nothing");
    }
    look_at_passthroughs();
    if (sensor != nullptr && result_.uses.contains("shape") && !result_.uses.contains("emitter"))
      add(Finding::Kind::dark, scene_.scene->where, "the scene has no light: its picture is black");
    std::stable_sort(result_.findings.begin(), result_.findings.end(),
                     [](const Finding& a, const Finding& b) {
                       return std::tie(a.where.file, a.where.line) < std::tie(b.where.file, b.where.line);
                     });
    return std::move(result_);
  }

 private:
  void unused(const Object& object, std::string_view why) {
    if (!seen_.insert(&object).second) return;
    const std::string id = object.id.empty() ? "" : fmt::format(" with the id {}", text::quote(object.id));
    add(Finding::Kind::unused, object.where, fmt::format("{}{} {}", describe(object), id, why));
  }

  // The parser has bounded the nesting.
  void visit(const Object& object) {
    if (!seen_.insert(&object).second) return;
    ++result_.uses[object.category][object.plugin];
    if (const PluginRule* rule = find_plugin(object.category, object.plugin)) look_at(object, *rule);
    for (const Child& child : object.children) visit(*child.object);
  }

  // The meaning of media here, unlike in Mitsuba 3, follows from absent parameters.
  void look_at_media(const Object& object) {
    const auto has = [&](std::string_view category) { return !object.children_of(category).empty(); };
    if (object.category == "shape" && has("medium") && !has("bsdf") && !has("emitter"))
      add(Finding::Kind::differs, object.where,
          fmt::format(
              "{} bounds a medium and has no bsdf: it is not seen, as in 0.6 and as Mitsuba 3 documents, "
              "though Mitsuba 3 makes it diffuse (write <bsdf type=\"null\"/> to have both agree)",
              describe(object)));
    const Child* sigma_t = object.find_child("sigma_t");
    if (object.plugin == "heterogeneous" && (sigma_t == nullptr || sigma_t->object->plugin == "constvolume"))
      add(Finding::Kind::differs, object.where,
          fmt::format(
              "{} has a constant sigma_t: it fills its shape, where Mitsuba 3 ends it at the unit cube",
              describe(object)));
  }

  // Mitsuba's path counts a bounce where its volpath and ours count none. Where there are media, the scene
  // was made for volpath.
  void look_at_passthroughs() {
    const auto used = [&](const char* category, const char* plugin) {
      const auto found = result_.uses.find(category);
      return found != result_.uses.end() && (*plugin == 0 || found->second.contains(plugin));
    };
    if (used("medium", "") || !(used("bsdf", "mask") || used("bsdf", "thindielectric"))) return;
    for (const ObjectPtr& integrator : scene_.scene->children_of("integrator")) {
      if (integrator->plugin != "path" || integrator->get_integer("max_depth", -1) < 0) continue;
      add(Finding::Kind::differs, integrator->where,
          "passing a mask or thin glass straight counts no bounce here, as in Mitsuba's volpath; its path "
          "counts "
          "one, so that with a max_depth less light passes several of them there");
    }
  }

  void look_at(const Object& object, const PluginRule& rule) {
    look_at_media(object);
    if (!rule.differs.empty())
      add(Finding::Kind::differs, object.where, fmt::format("{}: {}", describe(object), rule.differs));
    for (const Property& property : object.properties) {
      const auto found = std::find_if(rule.properties.begin(), rule.properties.end(),
                                      [&](const PropertyRule& other) { return other.name == property.name; });
      if (found == rule.properties.end()) continue;
      const bool differs = !found->differs.empty() && !is_value(property, found->differs_unless);
      if (!differs && !found->ignored) continue;
      const std::string what = fmt::format("parameter '{}' of {}", property.name, describe(object));
      if (differs)
        add(Finding::Kind::differs, property.where, fmt::format("{}: {}", what, found->differs));
      else
        add(Finding::Kind::ignored, property.where, fmt::format("{} is ignored: {}", what, found->doc));
    }
  }

  // The same of a thousand objects is told once.
  void add(Finding::Kind kind, const Location& where, std::string text) {
    const auto [entry, is_new] = told_.try_emplace({kind, text}, result_.findings.size());
    if (is_new)
      result_.findings.push_back({kind, where, std::move(text), 1});
    else
      ++result_.findings[entry->second].count;
  }

  const SceneDescription& scene_;
  Review result_;
  std::set<const Object*> seen_;
  std::map<std::pair<Finding::Kind, std::string>, std::size_t> told_;
};

}  // namespace

std::string_view name(Finding::Kind kind) {
  return name_of_value<Finding::Kind::unused>({"differs", "dark", "missing", "ignored", "unused"}, kind);
}

bool is_warning(Finding::Kind kind) {
  return kind == Finding::Kind::differs || kind == Finding::Kind::dark;
}

Review review(const SceneDescription& scene) {
  return Reviewer(scene).run();
}

}  // namespace candela::description
