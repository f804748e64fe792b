// parse_scene: the walk over the XML tree, its includes and its search folders.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "common/base/work_monitor.h"
#include "common/description/all_errors.h"
#include "common/description/check.h"
#include "common/description/conductors.h"
#include "common/description/element.h"
#include "common/description/element_names.h"
#include "common/description/legacy.h"
#include "common/description/lenient.h"
#include "common/description/mixture.h"
#include "common/description/obj_materials.h"
#include "common/description/other_integrator.h"
#include "common/description/parameters.h"
#include "common/description/pbrt/reader.h"
#include "common/description/reading.h"
#include "common/description/repair.h"
#include "common/description/resolve.h"
#include "common/description/scene_aovs.h"
#include "common/description/scene_files.h"
#include "common/description/spectra.h"
#include "common/description/stand_in.h"
#include "common/description/transform.h"
#include "common/description/unpacked_files.h"
#include "common/description/values.h"
#include "common/description/vocabulary.h"
#include "common/description/xml_document.h"

namespace candela::description {
namespace {

constexpr int max_element_depth = 64;
constexpr std::size_t max_include_depth = 64;
constexpr std::size_t max_includes = 10'000;
constexpr std::size_t max_properties = 256;
constexpr std::size_t max_notes = 100'000;

class Parser {
 public:
  Parser(const UnpackedFiles& files, const std::string& main_key,
         const std::map<std::string, std::string>& given, const Reading& reading, std::vector<Error>* errors)
      : files_(files, main_key),
        budget_(files.budget()),
        main_key_(main_key),
        parameters_(given, reading.lenient),
        reading_(reading),
        errors_(errors) {}

  Result<ReadScene> run() {
    CANDELA_ASSIGN(const std::unique_ptr<XmlDocument> document, files_.document(main_key_));
    File file{*document, false};
    const pugi::xml_node root = document->root();
    if (std::string_view(root.name()) != "scene")
      return error_at(document->where(root), fmt::format("the root element is <{}>", root.name()))
          .with_mend("a scene file starts with <scene version=\"3.0.0\">");
    if (!root.attribute("version"))
      return error_at(document->where(root), "<scene> lacks the attribute 'version'")
          .with_mend("write <scene version=\"3.0.0\">, or the version the file was made for");
    CANDELA_ASSIGN(file.legacy, is_legacy(file.document, root, file.legacy));
    include_stack_.push_back(main_key_);
    CANDELA_ASSIGN(const std::size_t scene, parse_object(file, root, 1));
    // A shape that is wrong already has no materials to look for.
    if (errors_ == nullptr || errors_->empty()) CANDELA_TRY(add_obj_materials(drafts_, ids_, files_, notes_));
    if (!requests_.edits.empty())
      drafts_[scene].object->properties.push_back(
          {std::string(kEditsOfScene), PropertyType::string, requests_.edits, {}});
    CANDELA_ASSIGN(ObjectPtr resolved,
                   resolve(drafts_, scene, ids_, {reading_.lenient, passed_over_, errors_}));
    Result<void> used = parameters_.check_all_used();
    if (!used.ok()) return std::move(used).error().at(main_key_, 0);
    notes_.insert(notes_.end(), passed_over_.begin(), passed_over_.end());
    return ReadScene{{std::move(resolved),
                      {files_.used().begin(), files_.used().end()},
                      std::move(notes_),
                      std::move(requests_.aovs),
                      std::move(requests_.layers)},
                     std::move(passed_over_)};
  }

 private:
  // An XML file while it is walked.
  struct File {
    const XmlDocument& document;
    bool legacy;
  };

  Result<std::string> find_file(const File& file, const Location& where, std::string_view name) {
    return files_.find(file.document.key(), where, name);
  }

  // ---- elements ----

  // The node's attributes with parameters resolved.
  Result<Element> element(const File& file, const pugi::xml_node& node) {
    Result<Element> result = read_element(file.document, node, file.legacy, parameters_);
    for (const auto& [name, value] : parameters_.take_assumed()) {
      const Location where = file.document.where(node);
      note_passed_over({where, fmt::format("the parameter {} has no value: {} is assumed",
                                           text::quote("$" + name), value)});
    }
    return result;
  }

  // ---- objects ----

  Result<void> add_draft(std::shared_ptr<Object> object) {
    CANDELA_TRY(make_room(drafts_, budget_, object->where, "the scene's objects"));
    CANDELA_TRY(budget_.charge(memory_of(*object), object->where, "the scene's objects"));
    drafts_.push_back({std::move(object), {}});
    return {};
  }

  // The index of the new draft. `depth` is 1 for the scene.
  Result<std::size_t> parse_object(const File& file, const pugi::xml_node& node, int depth) {
    CANDELA_TRY(expect_element(file.document, node));
    CANDELA_ASSIGN(const Element written, element(file, node));
    const bool is_scene = written.name == "scene";
    if (is_scene) {
      CANDELA_TRY(written.expect({}, {"version", "type", "id", "name"}));
    } else if (reading_.lenient) {
      CANDELA_TRY(written.expect({}, {"type", "id", "name", "version"}));  // none is unknown, too
    } else {
      CANDELA_TRY(written.expect({"type"}, {"id", "name", "version"}));
    }
    if (depth > max_element_depth)
      return written.error(fmt::format("elements are nested deeper than {} levels", max_element_depth));
    CANDELA_TRY(check_name(written, "id"));
    CANDELA_TRY(check_name(written, "name"));

    auto object = std::make_shared<Object>();
    object->category = std::string(stand_in::category_of(node));
    const std::string plugin = is_scene ? std::string() : std::string(written.get("type"));
    object->plugin = file.legacy ? legacy::plugin_name(object->category, plugin) : plugin;
    object->plugin = std::string(canonical_plugin(object->category, object->plugin));
    object->id = std::string(written.get("id"));
    object->where = written.where;
    const PluginRule* rule = find_plugin(object->category, object->plugin);
    // Integrators that Mitsuba has are kept unread: the command line may choose another.
    const bool unread = object->category == "integrator" &&
                        (support_of_plugin("integrator", object->plugin) == Support::later ||
                         is_layer_element(object->plugin));
    const bool may_replace =
        object->category != "spectrum" && (reading_.lenient || lenient::has_close_plugin(*object));
    const bool is_unknown = rule == nullptr && !unread && !may_replace;
    Error unknown = is_unknown ? unknown_plugin(written.where, object->category, object->plugin) : Error();
    if (is_unknown && errors_ == nullptr) return unknown;

    const std::size_t index = drafts_.size();
    CANDELA_TRY(add_draft(object));
    drafts_.back().legacy = file.legacy;
    const auto read = [&]() -> Result<void> {
      CANDELA_TRY(register_id(object->id, index, written.where, written.name));
      if (is_unknown) return std::move(unknown);
      return finish_object(file, node, index, depth, plugin, may_replace);
    };
    CANDELA_TRY(go_on(read(), index));
    return drafts_[index].given_way.value_or(index);
  }

  // With all errors wanted, that of a draft is told, and the reading goes on behind it.
  Result<void> go_on(Result<void> result, std::size_t index) {
    if (result.ok()) return {};
    if (budget_.refused() || !collect(errors_, result.error())) return result;
    drafts_[index].broken = true;
    return {};
  }

  // The content of an object and its checks.
  Result<void> finish_object(const File& file, const pugi::xml_node& node, std::size_t index, int depth,
                             const std::string& plugin, bool may_replace) {
    const std::shared_ptr<Object> object = drafts_[index].object;
    const PluginRule* rule = find_plugin(object->category, object->plugin);
    CANDELA_TRY(parse_children(file, node, index, depth));
    if (drafts_[index].broken) return {};

    if (object->category == "integrator")
      CANDELA_TRY(add_requests(*object, reading_.lenient, passed_over_, requests_));
    if (object->category == "integrator" && rule == nullptr) {
      if (const auto nested = stand_in::integrator_inside(drafts_, index, notes_)) {
        drafts_[index].given_way = *nested;
        return {};
      }
      rule = stand_in::direct_as_path(*object);
    }
    if (rule == nullptr && may_replace) rule = stand_in::replace_unknown(drafts_, ids_, index, passed_over_);
    if (rule == nullptr) return {};
    if (reading_.lenient) repair::material(*object, passed_over_);
    if (reading_.lenient && file.legacy) repair::old_numbers(*object, passed_over_);
    if (file.legacy) CANDELA_TRY(legacy::upgrade(*object, drafts_[index].slots(), notes_));
    legacy::upgrade_film(*object, plugin, notes_);
    clamp_indices(*object, notes_);
    if (object->plugin == "normalmap" && (file.legacy || reading_.lenient))
      CANDELA_TRY(add_normal_map_file(file, index));
    if (notes_.size() > max_notes) notes_.resize(max_notes);
    if (file.legacy && (plugin == "mixturebsdf" || plugin == "mixturephase") &&
        object->plugin == "blend" + object->category)
      CANDELA_TRY(split_mixture(index));
    stand_in::pass_over_unknown(drafts_[index], *rule, reading_.lenient, passed_over_);
    if (drafts_[index].stands_in) stand_in::drop_unfit(*object, *rule, passed_over_);
    if (reading_.lenient) repair::properties(*object, *rule, passed_over_);
    if (passed_over_.size() > max_notes) passed_over_.resize(max_notes);
    if (errors_ != nullptr) {
      for (Property& property : object->properties) {
        const PropertyRule* property_rule = find_rule(*rule, property.name);
        CANDELA_TRY(go_on(property_rule != nullptr ? check_property(property, *property_rule)
                                                   : Result<void>(unknown_parameter(
                                                         *object, *rule, property.where, property.name)),
                          index));
      }
    }
    if (drafts_[index].broken) return {};
    CANDELA_TRY(check_properties(*object, *rule));
    if (object->category == "bsdf") CANDELA_TRY(resolve_material(*object));
    for (Property& property : object->properties)
      if (const PropertyRule* known = find_rule(*rule, property.name); known != nullptr && known->is_file) {
        CANDELA_ASSIGN(property.value,
                       find_file(file, property.where, std::get<std::string>(property.value)));
      }
    return {};
  }

  Result<void> split_mixture(std::size_t index) {
    const std::size_t before = drafts_.size();
    CANDELA_TRY(legacy::split_mixture(drafts_, index, notes_));
    for (std::size_t i = before; i < drafts_.size(); ++i) {
      const std::uint64_t links = drafts_[i].links.capacity() * (sizeof(Link) + sizeof(Child));
      CANDELA_TRY(budget_.charge(sizeof(Draft) + memory_of(*drafts_[i].object) + links,
                                 drafts_[i].object->where, "parts of the mixture"));
    }
    return {};
  }

  // A normal map that is named in place of a texture, as forks of Mitsuba have it.
  Result<void> add_normal_map_file(const File& file, std::size_t index) {
    std::optional<Property> name = stand_in::take_normal_map_file(drafts_[index]);
    if (!name) return {};
    CANDELA_ASSIGN(name->value, find_file(file, name->where, std::get<std::string>(name->value)));
    note_passed_over({name->where, "bsdf 'normalmap' has no parameter 'filename': it is read as a bitmap"});
    const Location where = name->where;
    std::shared_ptr<Object> texture = stand_in::raw_bitmap(std::move(*name));
    CANDELA_TRY(add_link(index, {"normalmap", where, drafts_.size(), false, {}}));
    return add_draft(std::move(texture));
  }

  // ---- what is passed over ----

  // Drops the note if the budget has no memory for it; the next object then fails.
  void note_passed_over(Note note) {
    if (passed_over_.size() >= max_notes) return;
    if (budget_.take(2 * sizeof note + heap_bytes(note.text) + heap_bytes(note.where)))
      passed_over_.push_back(std::move(note));
  }
  void pass_over(const Error& error) { note_passed_over(passed_over_note(error)); }

  // If a parameter is given twice, the later value counts, as in Mitsuba.
  void give_again(Property& first, Property property, const Object& object) {
    note_passed_over(
        {property.where, fmt::format("parameter {} of {} is given twice, first in line {}: this value "
                                     "counts",
                                     text::quote(property.name), describe(object), first.where.line)});
    first = std::move(property);
  }

  bool is_other_integrator(std::string_view category) const {
    return category == "integrator" && !reading_.integrator.empty();
  }

  // An <integrator> where another one runs.
  Result<void> pass_over_integrator(const File& file, const pugi::xml_node& node, std::size_t parent,
                                    int depth) {
    const OtherIntegrator reader{file.document, file.legacy,  reading_.integrator,
                                 parameters_,   passed_over_, requests_};
    parameters_.assume_usual(false);
    Result<std::shared_ptr<Object>> read = reader.read(node, depth);
    parameters_.assume_usual(reading_.lenient);
    if (!read.ok()) return std::move(read).error();
    std::shared_ptr<Object> object = std::move(read).value();
    if (passed_over_.size() > max_notes) passed_over_.resize(max_notes);
    const std::size_t index = drafts_.size();
    if (!object->id.empty()) ids_.try_emplace(object->id, index);
    const Location where = object->where;
    CANDELA_TRY(add_draft(std::move(object)));
    // The first one counts if there are several.
    if (!has_integrator_.insert(parent).second) return {};
    return add_link(parent, {{}, where, index, false, {}});
  }

  Result<void> register_id(const std::string& id, std::size_t index, const Location& where,
                           std::string_view what) {
    if (id.empty()) return {};
    constexpr std::size_t entry_bytes = 96;
    CANDELA_TRY(budget_.charge(entry_bytes + heap_bytes(id), where, "ids"));
    const auto [entry, added] = ids_.try_emplace(id, index);
    if (added) return {};
    const Location& first = drafts_[entry->second].object->where;
    return error_at(where, fmt::format("<{}> has the id {}, which is taken since {}:{}", what,
                                       text::quote(id), first.file, first.line));
  }

  Result<void> parse_children(const File& file, const pugi::xml_node& node, std::size_t parent, int depth) {
    for (const pugi::xml_node& child : node.children()) {
      work_step();
      CANDELA_TRY(go_on(parse_child(file, child, parent, depth), parent));
    }
    return {};
  }

  Result<void> parse_child(const File& file, const pugi::xml_node& node, std::size_t parent, int depth) {
    const std::string_view name = node.name();
    const bool is_element = node.type() == pugi::node_element;
    if (is_element && name == "scene")
      return error_at(file.document.where(node), "<scene> cannot be inside another element");
    if (is_element && (name == "spectrum" || name == "blackbody") && stand_in::category_of(node) != "texture")
      return parse_spectrum(file, node, parent, depth);
    if (is_element && is_other_integrator(name)) return pass_over_integrator(file, node, parent, depth + 1);
    if (is_element && is_category(name)) {
      CANDELA_ASSIGN(const std::size_t index, parse_object(file, node, depth + 1));
      return link_object(file, node, parent, index);
    }
    CANDELA_TRY(expect_element(file.document, node));
    if (reading_.lenient && (is_unknown_element(name) || support_of_category(name) == Support::later)) {
      pass_over(unknown_element(file.document.where(node), name));
      return {};
    }
    CANDELA_ASSIGN(const Element written, element(file, node));
    if (name == "include") return parse_include(file, written, parent, depth);
    if (name == "transform") return parse_transform(file, node, written, parent);
    if (name == "animation" && reading_.lenient) return parse_animation(file, node, written, parent);
    if (is_value_element(name)) {
      CANDELA_TRY(check_name(written, "name"));
      CANDELA_ASSIGN(Property property,
                     parse_value(reading_.lenient ? repair::srgb(written, passed_over_) : written));
      CANDELA_TRY(no_children(file.document, node));
      return add_property(file, std::move(property), parent);
    }
    CANDELA_TRY(no_children(file.document, node));
    if (name == "ref") return parse_reference(file, written, parent);
    if (name == "default") return parse_default(written);
    if (name == "alias") return parse_alias(written);
    if (name == "path") return parse_path(file, written, depth);
    if (is_transform_operation(name))
      return written.error(fmt::format("<{}> belongs inside <transform>", name));
    return unknown_element(written.where, name);
  }

  // A spectrum is a color from here on, by what it is given for.
  Result<void> parse_spectrum(const File& file, const pugi::xml_node& node, std::size_t parent, int depth) {
    CANDELA_ASSIGN(const Element written, element(file, node));
    CANDELA_TRY(check_name(written, "name"));
    Property property{std::string(written.get("name")), PropertyType::rgb, {}, written.where};
    const SpectrumUse use = spectrum_use(*drafts_[parent].object, modern_name(file.legacy, property.name));
    ConvertedSpectrum converted;
    std::string differs;
    if (written.name == "spectrum" && written.find("type") != nullptr) {
      if (written.find("id") != nullptr)
        return written.error("a <spectrum> with an id is not supported")
            .with_mend("write it where it is used");
      CANDELA_ASSIGN(const std::size_t index, parse_object(file, node, depth + 1));
      if (drafts_[index].broken) {
        drafts_[parent].broken = true;
        return {};
      }
      const std::shared_ptr<Object> object = drafts_[index].object;
      const PluginRule& rule = *find_plugin(object->category, object->plugin);
      CANDELA_TRY(check_children(*object, rule, {}));
      if (!rule.differs.empty()) differs = fmt::format("{}: {}", describe(*object), rule.differs);
      if (!drafts_[index].links.empty())
        return written.error(fmt::format("{} takes no texture and no other object", describe(*object)));
      drafts_.pop_back();
      CANDELA_ASSIGN(converted, convert_spectrum_plugin(*object, use));
    } else {
      CANDELA_TRY(expect_element(file.document, node));
      CANDELA_TRY(no_children(file.document, node));
      if (written.name == "blackbody") {
        CANDELA_ASSIGN(converted, convert_blackbody(written));
      } else if (written.find("filename") != nullptr) {
        CANDELA_TRY(written.expect({"name", "filename"}));
        CANDELA_ASSIGN(const std::string key, find_file(file, written.where, written.get("filename")));
        CANDELA_ASSIGN(const FileSource::Bytes bytes, files_.small_file(key, written.where, "a spectrum"));
        CANDELA_ASSIGN(const colorimetry::Spectrum spectrum, parse_spectrum_file(key, bytes.view));
        CANDELA_ASSIGN(converted, convert_spectrum(spectrum, use, file.legacy));
      } else {
        CANDELA_ASSIGN(converted, convert_spectrum_value(written, use));
      }
    }
    if (!differs.empty() && notes_.size() < max_notes) notes_.push_back({written.where, std::move(differs)});
    if (!converted.note.empty() && notes_.size() < max_notes)
      notes_.push_back({written.where, std::move(converted.note)});
    property.value = converted.rgb;
    return add_property(file, std::move(property), parent);
  }

  Result<void> link_object(const File& file, const pugi::xml_node& node, std::size_t parent,
                           std::size_t index) {
    CANDELA_ASSIGN(const Element written, element(file, node));
    return add_link(parent,
                    {modern_slot(file, parent, written.get("name")), written.where, index, false, {}});
  }

  Result<void> add_link(std::size_t parent, Link link) {
    link.after_property = !link.slot.empty() && drafts_[parent].object->find(link.slot) != nullptr;
    std::vector<Link>& links = drafts_[parent].links;
    CANDELA_TRY(make_room(links, budget_, link.where, "the scene's objects"));
    // And the child that the link will be.
    const std::uint64_t texts = 2 * heap_bytes(link.slot) + heap_bytes(link.id) + heap_bytes(link.where);
    CANDELA_TRY(budget_.charge(texts + sizeof(Child), link.where, "the scene's objects"));
    links.push_back(std::move(link));
    return {};
  }

  // Slots follow the spelling of parameters, but for names of an OBJ file's materials.
  std::string modern_slot(const File& file, std::size_t parent, std::string_view name) const {
    if (drafts_[parent].object->plugin == "obj") return std::string(name);
    const std::string slot = modern_name(file.legacy, name);
    return file.legacy ? legacy::slot_name(*drafts_[parent].object, slot) : slot;
  }

  Result<void> add_property(const File& file, Property property, std::size_t parent) {
    Object& object = *drafts_[parent].object;
    property.name = modern_name(file.legacy, property.name);
    if (property.name.empty())
      return error_at(property.where, fmt::format("a parameter of {} has an empty name", describe(object)));
    for (Link& link : drafts_[parent].links)
      if (link.slot == property.name) link.before_property = true;
    CANDELA_TRY(budget_.charge(memory_of(property) - sizeof property, property.where, "the scene's values"));
    for (Property& first : object.properties)
      if (first.name == property.name) {
        // Each looks at all links: a bound keeps hostile input cheap.
        if (++drafts_[parent].repeated > max_properties)
          return error_at(property.where, fmt::format("{} has more than {} parameters given again",
                                                      describe(object), max_properties));
        give_again(first, std::move(property), object);
        return {};
      }
    if (object.properties.size() >= max_properties)
      return error_at(property.where,
                      fmt::format("{} has more than {} parameters", describe(object), max_properties));
    CANDELA_TRY(make_room(object.properties, budget_, property.where, "the scene's values"));
    object.properties.push_back(std::move(property));
    return {};
  }

  Result<void> parse_transform(const File& file, const pugi::xml_node& node, const Element& written,
                               std::size_t parent) {
    CANDELA_TRY(written.expect({"name"}));
    CANDELA_TRY(check_name(written, "name"));
    Property property{std::string(written.get("name")), PropertyType::transform, {}, written.where};
    const bool two_dimensional = modern_name(file.legacy, property.name) == "to_uv";
    // Each operation acts after those before it.
    Mat4 matrix = transform::identity;
    for (const pugi::xml_node& child : node.children()) {
      work_step();
      CANDELA_TRY(expect_element(file.document, child));
      CANDELA_ASSIGN(const Element operation, element(file, child));
      if (!is_transform_operation(operation.name))
        return operation.error(fmt::format("<{}> cannot be inside <transform>", operation.name))
            .with_mend("there is <translate>, <rotate>, <scale>, <lookat>, <matrix>");
      CANDELA_TRY(no_children(file.document, child));
      Result<Mat4> step = parse_operation(operation, two_dimensional);
      if (!step.ok() && reading_.lenient && operation.name == "rotate" &&
          operation.find("angle") != nullptr) {
        pass_over(step.error());
        continue;
      }
      if (!step.ok()) return std::move(step).error();
      matrix = transform::multiply(*step, matrix);
    }
    CANDELA_TRY(check_transform(written, matrix));
    property.value = matrix;
    return add_property(file, std::move(property), parent);
  }

  // Nothing moves here: the first of the transforms of 0.6's <animation> is taken.
  Result<void> parse_animation(const File& file, const pugi::xml_node& node, const Element& written,
                               std::size_t parent) {
    pass_over(error_at(written.where, "motion is not supported yet")
                  .with_mend("the first transform of <animation> is taken"));
    const pugi::xml_node first = node.child("transform");
    if (!first) return {};
    CANDELA_TRY(expect_element(file.document, first));
    return parse_transform(file, first, written, parent);
  }

  Result<void> parse_reference(const File& file, const Element& written, std::size_t parent) {
    CANDELA_TRY(written.expect({"id"}, {"name"}));
    CANDELA_TRY(check_name(written, "name"));
    return add_link(parent, {modern_slot(file, parent, written.get("name")), written.where, 0, true,
                             std::string(written.get("id"))});
  }

  Result<void> parse_default(const Element& written) {
    CANDELA_TRY(written.expect({"name", "value"}));
    if (written.get("name").empty()) return written.error("<default> has an empty name");
    constexpr std::size_t entry_bytes = 160;
    CANDELA_TRY(budget_.charge(entry_bytes + written.find("name")->size() + written.find("value")->size(),
                               written.where, "values of <default>"));
    parameters_.add_default(*written.find("name"), *written.find("value"));
    return {};
  }

  // As in Mitsuba, the id must be known already.
  Result<void> parse_alias(const Element& written) {
    CANDELA_TRY(written.expect({"id", "as"}));
    const auto known = ids_.find(written.get("id"));
    if (known == ids_.end()) {
      std::vector<std::string_view> ids;
      for (const auto& [id, index] : ids_) ids.push_back(id);
      return written
          .error(fmt::format("no object before this line has the id {}", text::quote(written.get("id"))))
          .with_mend(text::did_you_mean(nearest_name(written.get("id"), ids)));
    }
    if (written.get("as").empty()) return written.error("<alias> has an empty 'as'");
    return register_id(*written.find("as"), known->second, written.where, "alias");
  }

  Result<void> parse_path(const File& file, const Element& written, int depth) {
    CANDELA_TRY(written.expect({"value"}));
    if (depth != 1) return written.error("<path> belongs directly into <scene>");
    return files_.add_folder(file.document.key(), written.where, written.get("value"));
  }

  Result<void> parse_include(const File& file, const Element& written, std::size_t parent, int depth) {
    CANDELA_TRY(written.expect({"filename"}, {"name"}));
    CANDELA_ASSIGN(const std::string key, find_file(file, written.where, written.get("filename")));
    if (std::find(include_stack_.begin(), include_stack_.end(), key) != include_stack_.end())
      return written.error(fmt::format("{} includes itself", text::quote(key)));
    if (include_stack_.size() > max_include_depth)
      return written.error(fmt::format("includes are nested deeper than {} levels", max_include_depth));
    if (++include_count_ > max_includes)
      return written.error(fmt::format("the scene has more than {} includes", max_includes));
    CANDELA_ASSIGN(const std::unique_ptr<XmlDocument> document, files_.document(key));
    File included{*document, file.legacy};
    const pugi::xml_node root = document->root();
    CANDELA_ASSIGN(included.legacy, is_legacy(included.document, root, included.legacy));
    include_stack_.push_back(key);
    Result<void> read = parse_included(file, included, root, written, parent, depth);
    include_stack_.pop_back();
    return read;
  }

  Result<void> parse_included(const File& file, const File& included, const pugi::xml_node& root,
                              const Element& written, std::size_t parent, int depth) {
    const std::string_view name = root.name();
    if (name == "scene") {
      CANDELA_TRY(expect_element(included.document, root));
      return parse_children(included, root, parent, depth);
    }
    if (is_other_integrator(name)) return pass_over_integrator(included, root, parent, depth + 1);
    if (!is_category(name)) return unknown_element(included.document.where(root), name);
    CANDELA_ASSIGN(const std::size_t index, parse_object(included, root, depth + 1));
    return add_link(parent,
                    {modern_slot(file, parent, written.get("name")), written.where, index, false, {}});
  }

  SceneFiles files_;
  ReadingBudget& budget_;
  std::string main_key_;
  Parameters parameters_;
  const Reading& reading_;
  std::vector<Error>* errors_;  // if all are wanted: those so far
  std::vector<std::string> include_stack_;
  std::vector<Draft> drafts_;
  std::map<std::string, std::size_t, std::less<>> ids_;
  std::vector<Note> notes_;
  std::vector<Note> passed_over_;
  SceneRequests requests_;
  std::size_t include_count_ = 0;
  std::set<std::size_t> has_integrator_;  // drafts that an <integrator> in place of another was put into
};

// errors: those of objects, if all are wanted.
Result<ReadScene> read(const FileSource& files, const std::string& main_key,
                       const std::map<std::string, std::string>& parameters, const Reading& reading,
                       std::vector<Error>* errors) {
  if (pbrt::is_pbrt_file(main_key)) return pbrt::read_pbrt_scene(files, main_key, parameters, reading);
  const UnpackedFiles unpacked(files);
  return Parser(unpacked, main_key, parameters, reading, errors).run();
}

}  // namespace

Result<ReadScene> read_scene(const FileSource& files, const std::string& main_key,
                             const std::map<std::string, std::string>& parameters, const Reading& reading) {
  return read(files, main_key, parameters, reading, nullptr);
}

std::vector<Error> all_errors(const FileSource& files, const std::string& main_key,
                              const std::map<std::string, std::string>& parameters, const Reading& reading) {
  std::vector<Error> errors;
  const Result<ReadScene> scene = read(files, main_key, parameters, reading, &errors);
  if (!scene.ok() && (errors.empty() || files.budget().refused())) errors.push_back(scene.error());
  return errors;
}

}  // namespace candela::description
