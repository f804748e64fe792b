// Mitsuba 0.6 reads few words of a material library: colors, their maps, bump maps, opacity, and by `illum`
// which bsdf it is.
#include "common/description/obj_materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <unordered_map>
#include <unordered_set>

#include "common/description/check.h"
#include "common/description/legacy.h"
#include "common/description/obj_outline.h"
#include "common/description/text.h"
#include "common/description/transform.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr std::size_t max_material_notes = 100'000;

std::vector<std::string_view> views(const std::vector<std::string>& names) {
  constexpr std::size_t most = 8;  // for messages
  std::vector<std::string_view> out(
      names.begin(), names.begin() + static_cast<std::ptrdiff_t>(std::min(most, names.size())));
  if (names.size() > most) out.emplace_back("...");
  return out;
}

// Bsdfs of one material library, as drafts.
class Library {
 public:
  Library(std::vector<Draft>& drafts, SceneFiles& files, std::string key, std::vector<Note>& notes)
      : drafts_(drafts), files_(files), key_(std::move(key)), notes_(notes) {}

  Result<std::size_t> add(const ObjMaterial& material) {
    const Location where{key_, material.line};
    CANDELA_ASSIGN(std::size_t bsdf, surface(material, where));
    if (!material.bump_map.empty()) {
      const std::optional<std::size_t> map = texture(material.bump_map, where, true);
      if (map) {
        const std::size_t bump = make("bsdf", "bumpmap", where);
        link(bump, "", *map, where);
        link(bump, "", bsdf, where);
        CANDELA_TRY(finish(bump));
        bsdf = bump;
      }
    }
    if (!material.opacity_map.empty() || material.opacity) {
      const std::size_t mask = make("bsdf", "mask", where);
      const std::optional<std::size_t> map =
          material.opacity_map.empty() ? std::nullopt : texture(material.opacity_map, where, false);
      if (map)
        link(mask, "opacity", *map, where);
      else
        set(mask, "opacity", PropertyType::number, std::clamp(material.opacity.value_or(0), 0.0, 1.0));
      link(mask, "", bsdf, where);
      CANDELA_TRY(finish(mask));
      bsdf = mask;
    }
    return bsdf;
  }

 private:
  Result<std::size_t> surface(const ObjMaterial& material, const Location& where) {
    const int model = material.illumination;
    const bool black = material.specular_map.empty() && material.specular == std::array<double, 3>{};
    std::size_t bsdf = 0;
    if (model == 2 && !black && material.exponent > 0) {
      bsdf = make("bsdf", "phong", where);
      color(bsdf, "diffuse_reflectance", material.diffuse, material.diffuse_map, where);
      color(bsdf, "specular_reflectance", material.specular, material.specular_map, where);
      set(bsdf, "exponent", PropertyType::number, std::clamp(material.exponent, 0.0, 1e6));
    } else if (model == 4 || model == 6 || model == 7 || model == 9) {
      bsdf = make("bsdf", "dielectric", where);
    } else if (model == 5 || model == 8) {
      bsdf = make("bsdf", "conductor", where);
      set(bsdf, "material", PropertyType::string, std::string("Al"));
    } else {
      bsdf = make("bsdf", "diffuse", where);
      color(bsdf, "reflectance", material.diffuse, material.diffuse_map, where);
    }
    CANDELA_TRY(finish(bsdf));
    return bsdf;
  }

  std::size_t make(std::string_view category, std::string_view plugin, const Location& where) {
    auto object = std::make_shared<Object>();
    object->category = category;
    object->plugin = plugin;
    object->where = where;
    drafts_.push_back({std::move(object), {}});
    drafts_.back().legacy = true;
    return drafts_.size() - 1;
  }

  void set(std::size_t index, std::string_view name, PropertyType type, decltype(Property::value) value) {
    Object& object = *drafts_[index].object;
    object.properties.push_back({std::string(name), type, std::move(value), object.where});
  }

  void link(std::size_t index, std::string_view slot, std::size_t target, const Location& where) {
    drafts_[index].links.push_back({std::string(slot), where, target, false, {}});
  }

  // Reflectances above 1 are scaled down, as 0.6 does.
  void color(std::size_t index, std::string_view name, const std::array<double, 3>& srgb,
             const std::string& image, const Location& where) {
    if (!image.empty()) {
      if (const std::optional<std::size_t> map = texture(image, where, false)) {
        link(index, name, *map, where);
        return;
      }
      set(index, name, PropertyType::rgb, Rgb{{0, 0, 0}});
      return;
    }
    Rgb linear;
    for (std::size_t c = 0; c < 3; ++c) linear.value[c] = transform::srgb_to_linear(std::max(0.0, srgb[c]));
    const double largest = *std::max_element(linear.value.begin(), linear.value.end());
    if (largest > 1)
      for (double& component : linear.value) component /= largest;
    set(index, name, PropertyType::rgb, linear);
  }

  // Nothing: the image is not there, which is told.
  std::optional<std::size_t> texture(const std::string& image, const Location& where, bool raw) {
    Result<std::string> key = files_.find_beside(key_, where, image);
    if (!key.ok()) key = files_.find_beside(key_, where, image.substr(image.find_last_of('/') + 1));
    if (!key.ok()) {
      notes_.push_back({where, fmt::format("the image {} of a material is not there: it is black, as in 0.6",
                                           text::quote(image))});
      return std::nullopt;
    }
    const std::size_t index = make("texture", "bitmap", where);
    set(index, "filename", PropertyType::string, *key);
    if (raw) set(index, "raw", PropertyType::boolean, true);
    return index;
  }

  Result<void> finish(std::size_t index) {
    Object& object = *drafts_[index].object;
    const std::size_t links = drafts_[index].links.size();
    CANDELA_TRY(
        files_.budget().charge(memory_of(object) + sizeof(Draft) + links * (sizeof(Link) + sizeof(Child)),
                               object.where, "materials of the library"));
    CANDELA_TRY(legacy::upgrade(object, drafts_[index].slots(), notes_));
    return check_properties(object, *find_plugin(object.category, object.plugin));
  }

  std::vector<Draft>& drafts_;
  SceneFiles& files_;
  std::string key_;
  std::vector<Note>& notes_;
};

class Materials {
 public:
  Materials(std::vector<Draft>& drafts, const std::map<std::string, std::size_t, std::less<>>& ids,
            SceneFiles& files, std::vector<Note>& notes)
      : drafts_(drafts), ids_(ids), files_(files), notes_(notes) {}

  Result<void> look_at(std::size_t index) {
    const Object& object = *drafts_[index].object;
    const bool legacy = drafts_[index].legacy;
    const bool loads = object.get_bool("load_materials", legacy);
    const bool collapse = object.get_bool("collapse", !legacy && !loads);
    if (object.find("collapse") == nullptr && !collapse)
      drafts_[index].object->properties.push_back({"collapse", PropertyType::boolean, false, object.where});
    std::vector<std::string> named;
    bool unnamed = false;
    for (const Link& link : drafts_[index].links) {
      if (!is_bsdf(link)) continue;
      if (link.slot.empty()) {
        unnamed = true;
        named.clear();  // it takes the place of those before it
      } else {
        named.push_back(link.slot);
      }
    }
    if (collapse && !legacy) return tell_passed_over(object, unnamed || !named.empty());
    if (unnamed && named.empty()) return {};
    const Location where = object.where;
    CANDELA_ASSIGN(ObjOutline outline, outline_of(object));
    if (collapse) {
      outline.materials = {outline.last_material};
      keep_bsdf_of(index, outline.last_material);
    }
    const std::unordered_set<std::string_view> of_file(outline.materials.begin(), outline.materials.end());
    const std::unordered_set<std::string_view> of_shape(named.begin(), named.end());
    for (const std::string& name : named)
      if (!of_file.contains(name))
        tell(where,
             fmt::format("no face of the OBJ file has the material {}: the bsdf of this name is passed "
                         "over, as in 0.6",
                         text::quote(name)));
    if (unnamed || !loads) return {};
    std::vector<std::string> missing;
    for (const std::string& material : outline.materials)
      if (!of_shape.contains(material)) missing.push_back(material);
    if (missing.empty()) return {};
    return load(index, outline.library, missing);
  }

 private:
  void tell(const Location& where, std::string text) {
    if (notes_.size() < max_material_notes) notes_.push_back({where, std::move(text)});
  }

  bool is_bsdf(const Link& link) const {
    std::size_t target = link.target;
    if (link.is_reference) {
      const auto known = ids_.find(link.id);
      if (known == ids_.end()) return false;  // an error later
      target = known->second;
    }
    return !drafts_[target].left_out && drafts_[target].object->category == "bsdf";
  }

  // One mesh has one bsdf: the last that fits.
  void keep_bsdf_of(std::size_t index, const std::string& material) {
    std::vector<Link>& links = drafts_[index].links;
    const Link* last = nullptr;
    for (const Link& link : links)
      if (is_bsdf(link) && (link.slot.empty() || link.slot == material)) last = &link;
    const std::size_t kept = last == nullptr ? links.size() : static_cast<std::size_t>(last - links.data());
    std::vector<Link> rest;
    for (std::size_t i = 0; i < links.size(); ++i)
      if (i == kept || !is_bsdf(links[i])) rest.push_back(std::move(links[i]));
    links = std::move(rest);
  }

  // Each file is looked at once.
  Result<ObjOutline> outline_of(const Object& object) {
    const std::string key = object.get_string("filename", "");
    if (const auto known = outlines_.find(key); known != outlines_.end()) return known->second;
    CANDELA_ASSIGN(const FileSource::Bytes bytes, files_.mesh(key));
    return outlines_.emplace(key, outline_of_obj(bytes.view)).first->second;
  }

  Result<void> tell_passed_over(const Object& object, bool has_bsdf) {
    CANDELA_ASSIGN(const ObjOutline outline, outline_of(object));
    if (outline.materials.empty() || (has_bsdf && outline.materials.size() == 1)) return {};
    tell(object.where,
         fmt::format("the OBJ file has the materials {} (usemtl): they are passed over, as in Mitsuba 3, and "
                     "all faces have the shape's bsdf{} (collapse=false gives them bsdfs by their names, "
                     "load_materials=true those of the file's library)",
                     text::quoted_list(views(outline.materials)), has_bsdf ? "" : ", diffuse of 0.5"));
    return {};
  }

  Result<void> load(std::size_t index, const std::string& name, const std::vector<std::string>& wanted) {
    const Location where = drafts_[index].object->where;
    const std::string mesh = drafts_[index].object->get_string("filename", "");
    const auto gray = [&](const std::string& why, const std::vector<std::string>& materials) {
      tell(where, fmt::format("{}: faces of {} are diffuse of 0.5, as in 0.6", why,
                              text::quoted_list(views(materials))));
    };
    if (name.empty()) {
      gray("the OBJ file names no material library", wanted);
      return {};
    }
    const Result<std::string> key = files_.find_beside(mesh, where, name);
    if (!key.ok()) {
      gray(fmt::format("the material library {} is not there", text::quote(name)), wanted);
      return {};
    }
    CANDELA_ASSIGN(const FileSource::Bytes bytes, files_.small_file(*key, where, "a material library"));
    const std::vector<ObjMaterial> known = read_obj_materials(bytes.view);
    std::unordered_map<std::string_view, const ObjMaterial*> by_name;
    for (const ObjMaterial& material : known) by_name.emplace(material.name, &material);
    std::vector<Link> links;
    std::vector<std::string> missing;
    for (const std::string& material : wanted) {
      const auto found = by_name.find(material);
      if (found == by_name.end()) {
        missing.push_back(material);
        continue;
      }
      const auto [entry, is_new] = bsdfs_.try_emplace({*key, material}, 0);
      if (is_new) {
        CANDELA_ASSIGN(entry->second, Library(drafts_, files_, *key, notes_).add(*found->second));
      }
      links.push_back({material, where, entry->second, false, {}});
    }
    if (!missing.empty()) gray(fmt::format("the material library {} lacks them", text::quote(name)), missing);
    std::vector<Link>& own = drafts_[index].links;
    own.insert(own.begin(), links.begin(), links.end());
    return {};
  }

  std::vector<Draft>& drafts_;
  const std::map<std::string, std::size_t, std::less<>>& ids_;
  SceneFiles& files_;
  std::vector<Note>& notes_;
  std::map<std::string, ObjOutline> outlines_;
  std::map<std::pair<std::string, std::string>, std::size_t> bsdfs_;  // by library and name
};

}  // namespace

Result<void> add_obj_materials(std::vector<Draft>& drafts,
                               const std::map<std::string, std::size_t, std::less<>>& ids, SceneFiles& files,
                               std::vector<Note>& notes) {
  Materials materials(drafts, ids, files, notes);
  const std::size_t count = drafts.size();  // others are added
  for (std::size_t i = 0; i < count; ++i)
    if (!drafts[i].left_out && drafts[i].object->category == "shape" && drafts[i].object->plugin == "obj" &&
        drafts[i].object->find("filename") != nullptr)
      CANDELA_TRY(materials.look_at(i));
  return {};
}

}  // namespace candela::description
