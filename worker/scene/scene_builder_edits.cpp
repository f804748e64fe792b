// Edits of light transport: the surfaces that they select, and their bsdfs.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <optional>
#include <utility>

#include "common/base/log.h"
#include "common/base/text.h"
#include "common/edits/selection.h"
#include "common/letters/expression.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/scene_builder.h"

namespace candela::scene {
namespace {

using letters::Letter;
using letters::Side;

SurfaceEdits::Treatments treatments_of(const SceneEdits& edits,
                                       const std::vector<edits::Selection>& selections, std::uint32_t object,
                                       std::uint32_t regions) {
  constexpr std::array<Letter, 3> letter_of_lobe = {Letter::diffuse, Letter::glossy, Letter::specular};
  SurfaceEdits::Treatments treatments;
  for (std::size_t k = 0; k < selections.size(); ++k)
    for (std::size_t lobe = 0; lobe < letter_of_lobe.size(); ++lobe)
      for (const Side side : {Side::reflected, Side::transmitted}) {
        if (!selections[k].selects(letter_of_lobe[lobe], side, object, regions)) continue;
        SurfaceEdits::Treatment& t = treatments[lobe][side == Side::transmitted];
        (edits.edits[k].of_light ? t.of_light : t.of_eye) |= static_cast<std::uint16_t>(1u << k);
      }
  return treatments;
}

// All edits that take part in any of them.
SurfaceEdits::Treatment all_of(const std::vector<SurfaceEdits::Treatments>& by_regions) {
  SurfaceEdits::Treatment all;
  for (const SurfaceEdits::Treatments& treatments : by_regions)
    for (const auto& lobe : treatments)
      for (const SurfaceEdits::Treatment& t : lobe) {
        all.of_light |= t.of_light;
        all.of_eye |= t.of_eye;
      }
  return all;
}

std::string named(const std::vector<std::string>& names) {
  return names.empty() ? std::string("without a name") : quote(names.front());
}

// It is no vertex of a path.
bool scatters_nothing(const BsdfFacts& facts) {
  return facts.black() || (!facts.smooth && !facts.delta);
}

Error passes_through(const edits::Edit& edit, const std::vector<std::string>& surface) {
  return input_error(fmt::format("edit '{}' selects the surface {}, which lets light pass straight on",
                                 edit.name, named(surface)))
      .with_mend("name the surfaces that it selects: X{wall}; masks and thin glass cannot be edited");
}

// Nothing if the edits of each direction are few enough. `kind`: such as surface.
Result<void> check_count(const SurfaceEdits::Treatment& all, std::string_view kind,
                         const std::vector<std::string>& names) {
  for (const std::uint16_t bits : {all.of_light, all.of_eye})
    if (std::popcount(bits) > static_cast<int>(SurfaceEdits::kMax))
      return input_error(fmt::format("more than {} edits of one direction select the {} {}",
                                     SurfaceEdits::kMax, kind, named(names)));
  return {};
}

std::size_t first_of(const SurfaceEdits::Treatment& all) {
  return static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(all.of_light | all.of_eye)));
}
bool takes_part(const SurfaceEdits::Treatment& all, std::size_t k) {
  return ((all.of_light | all.of_eye) >> k & 1) != 0;
}

bool reads_regions(const edits::EditList& list) {
  bool reads = false;
  for (const edits::Edit& edit : list.edits) {
    const auto tree = letters::parse_expression(edit.select);
    if (!tree.ok()) continue;
    letters::for_each_token(*tree, [&](const letters::Token& token) { reads |= !token.region.empty(); });
  }
  return reads;
}
std::uint32_t places_of(const edits::EditList& list) {
  return reads_regions(list) ? 1u << list.regions.size() : 1;
}

// Lobes that are not delta may be diffuse and glossy at one place.
bool mixes_letters(const Bsdf& bsdf) {
  constexpr std::array<std::string_view, 7> kNoGlossy = {
      "diffuse", "difftrans", "roughdiffuse", "plastic", "conductor", "dielectric", "thindielectric"};
  constexpr std::array<std::string_view, 2> kOneGlossy = {"roughconductor", "roughdielectric"};
  constexpr std::array<std::string_view, 5> kAround = {"null", "mask", "twosided", "bumpmap", "normalmap"};
  const auto in = [](const auto& list, const std::string& name) {
    return std::find(list.begin(), list.end(), name) != list.end();
  };
  std::vector<std::string> plugins;
  bsdf.collect_plugins(plugins);
  bool all_diffuse = true, alone = true;
  for (const std::string& name : plugins) {
    all_diffuse &= in(kNoGlossy, name) || in(kAround, name) || name == "blendbsdf";
    alone &= in(kOneGlossy, name) || in(kAround, name);
  }
  return !all_diffuse && !alone;
}

std::string note_of(const edits::Edit& edit, std::size_t selected, std::size_t shapes, bool by_path,
                    std::size_t lamps, std::size_t all_lamps, std::size_t media, std::size_t all_media) {
  std::string text =
      fmt::format("edit '{}': {} {}, {}{} of {} shapes", edit.name,
                  edit.direction == edits::Edit::Direction::light ? "light after" : "gathered at",
                  edit.select, by_path ? "by the path: at most " : "", selected, shapes);
  if (lamps > 0) text += fmt::format(", {} of {} lamps", lamps, all_lamps);
  if (media > 0) text += fmt::format(", {} of {} media", media, all_media);
  if (!edit.source.empty())
    text += fmt::format(", {} {}", edit.hit ? "to first surfaces in" : "towards", edit.source);
  if (edit.rotate) text += fmt::format(", turned by {} degrees", edit.rotate->degrees);
  if (edit.move) text += ", moved";
  if (edit.factor != edits::Triple{1, 1, 1})
    text += fmt::format(", times {}, {}, {}", edit.factor[0], edit.factor[1], edit.factor[2]);
  return text;
}

}  // namespace

Result<std::vector<edits::Selection>> SceneBuilder::selections_of(const EditRequest& request) const {
  std::vector<letters::ObjectNames> names = objects_.names;
  std::vector<std::uint8_t> uses = objects_.uses;
  names.insert(names.end(), request.names.begin(), request.names.end());
  uses.insert(uses.end(), request.uses.begin(), request.uses.end());
  std::vector<edits::Selection> selections;
  for (const edits::Edit& edit : request.list.edits) {
    CANDELA_ASSIGN(edits::Selection selection, edits::Selection::compile(request.list, edit, names, uses));
    selections.push_back(std::move(selection));
  }
  return selections;
}

Result<void> SceneBuilder::edit(const EditRequest& request) {
  const edits::EditList& list = request.list;
  CANDELA_ASSIGN(const std::vector<edits::Selection> selections, selections_of(request));
  for (const edits::Edit& edit : list.edits)
    edits_.edits.push_back({.of_light = edit.direction == edits::Edit::Direction::light,
                            .map = direction_map(edit),
                            .cone = cone_of(list, edit),
                            .factor = {static_cast<float>(edit.factor[0]), static_cast<float>(edit.factor[1]),
                                       static_cast<float>(edit.factor[2])},
                            .hit = edit.hit});
  for (const letters::Region& region : list.regions) edits_.regions.push_back(cone_of(region));
  edits_.glossy_below = static_cast<float>(list.glossy_below);
  selected_.resize(list.edits.size());
  for (const edits::Selection& selection : selections)
    if (selection.by_path()) return {};  // finish_edits() does the rest

  const std::uint32_t places = places_of(list);
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> made;  // by bsdf and object
  for (std::uint32_t shape = 0; shape < geometry_.shapes.size(); ++shape) {
    const std::uint32_t bsdf = geometry_.shapes[shape].bsdf, object = objects_.of_shape[shape];
    const BsdfFacts facts = bsdfs_[bsdf].facts();
    if (scatters_nothing(facts)) continue;
    SurfaceEdits edits;
    edits.scene = &edits_;
    for (std::uint32_t place = 0; place < places; ++place)
      edits.by_regions.push_back(treatments_of(edits_, selections, object, place));
    const SurfaceEdits::Treatment all = all_of(edits.by_regions);
    if (all == SurfaceEdits::Treatment{}) continue;
    if (facts.passthrough) return passes_through(list.edits[first_of(all)], objects_.names[object]);
    CANDELA_TRY(check_count(all, "surface", objects_.names[object]));
    for (std::size_t k = 0; k < selected_.size(); ++k) selected_[k].shapes += takes_part(all, k) ? 1 : 0;
    const auto [at, fresh] = made.try_emplace({bsdf, object}, static_cast<std::uint32_t>(bsdfs_.size()));
    if (fresh) {
      CANDELA_ASSIGN(Bsdf edited, Bsdf::with_edits(bsdfs_, bsdf, std::move(edits)));
      bsdfs_.push_back(std::move(edited));
    }
    geometry_.shapes[shape].bsdf = at->second;
  }
  edited_ = true;
  return {};
}

Result<void> SceneBuilder::edit_lamps(const EditRequest& request) {
  CANDELA_ASSIGN(const std::vector<edits::Selection> selections, selections_of(request));
  for (std::uint32_t lamp = 0; lamp < lights_.size(); ++lamp) {
    const std::uint32_t object = objects_.of_emitter[lamp];
    SurfaceEdits::Treatment all;
    for (std::size_t k = 0; k < selections.size(); ++k)
      if (selections[k].selects_lamp(object)) all.of_light |= static_cast<std::uint16_t>(1u << k);
    if (all == SurfaceEdits::Treatment{}) continue;
    if (lights_.infinite(lamp))
      return input_error(fmt::format("edit '{}' selects the lamp {}, whose light comes from outside of the "
                                     "scene: it leaves no place where it could be turned",
                                     request.list.edits[first_of(all)].name, named(objects_.names[object])))
          .with_mend("name the lamps that it selects: L{bulb}");
    CANDELA_TRY(check_count(all, "lamp", objects_.names[object]));
    for (std::size_t k = 0; k < selected_.size(); ++k) selected_[k].lamps += takes_part(all, k) ? 1 : 0;
    lights_.edit(lamp, edits_, all.of_light);
  }
  return {};
}

Result<void> SceneBuilder::finish_edits(const EditRequest& request) {
  CANDELA_TRY(check_first_surfaces(request));
  if (std::any_of(edits_.edits.begin(), edits_.edits.end(), [](const auto& e) { return e.of_light; }) &&
      std::any_of(edits_.edits.begin(), edits_.edits.end(), [](const auto& e) { return !e.of_light; }))
    log::warn("edits of light and of what is gathered act in one scene: light may grow with each bounce");
  if (edited_) {
    CANDELA_ASSIGN(const std::vector<edits::Selection> selections, selections_of(request));
    CANDELA_TRY(edit_media(request, selections));
  } else {
    CANDELA_TRY(edit_by_path(request));
  }
  for (std::size_t k = 0; k < selected_.size(); ++k)
    features_.edits.push_back(note_of(request.list.edits[k], selected_[k].shapes, geometry_.shapes.size(),
                                      !edited_, selected_[k].lamps, lights_.size(), selected_[k].media,
                                      media_.size()));
  return {};
}

// The first surface must be one that light does not pass straight, and nothing may scatter before it.
Result<void> SceneBuilder::check_first_surfaces(const EditRequest& request) const {
  const auto asks =
      std::find_if(request.list.edits.begin(), request.list.edits.end(), [](const auto& e) { return e.hit; });
  if (asks == request.list.edits.end()) return {};
  const auto refuse = [&](const std::string& why) {
    return input_error(fmt::format("edit '{}' asks what light meets first, and {}", asks->name, why))
        .with_field("hit")
        .with_mend("leave out hit: then a source is all that lies in its directions");
  };
  if (media_.size() > 0) return refuse("the scene has media");
  for (std::uint32_t shape = 0; shape < geometry_.shapes.size(); ++shape)
    if (bsdfs_[geometry_.shapes[shape].bsdf].facts().passthrough)
      return refuse(fmt::format("the surface {} lets light pass straight on",
                                named(objects_.names[objects_.of_shape[shape]])));
  return {};
}

Result<void> SceneBuilder::edit_media(const EditRequest& request,
                                      const std::vector<edits::Selection>& selections) {
  const std::uint32_t places = places_of(request.list);
  for (std::uint32_t medium = 0; medium < media_.size(); ++medium) {
    const std::uint32_t object = objects_.of_medium[medium];
    auto edits = std::make_shared<SurfaceEdits>();
    edits->scene = &edits_;
    for (std::uint32_t place = 0; place < places; ++place) {
      SurfaceEdits::Treatment t;
      for (std::size_t k = 0; k < selections.size(); ++k)
        if (selections[k].selects(Letter::volume, Side::none, object, place))
          (edits_.edits[k].of_light ? t.of_light : t.of_eye) |= static_cast<std::uint16_t>(1u << k);
      SurfaceEdits::Treatments& treatments = edits->by_regions.emplace_back();
      for (auto& sides : treatments) sides.fill(t);
    }
    const SurfaceEdits::Treatment all = all_of(edits->by_regions);
    if (all == SurfaceEdits::Treatment{}) continue;
    CANDELA_TRY(check_count(all, "medium", objects_.names[object]));
    for (std::size_t k = 0; k < selected_.size(); ++k) selected_[k].media += takes_part(all, k) ? 1 : 0;
    media_.edit(medium, std::move(edits));
  }
  return {};
}

Result<void> SceneBuilder::edit_by_path(const EditRequest& request) {
  const edits::EditList& list = request.list;
  std::vector<letters::ObjectNames> names = objects_.names;
  std::vector<std::uint8_t> uses = objects_.uses;
  names.insert(names.end(), request.names.begin(), request.names.end());
  uses.insert(uses.end(), request.uses.begin(), request.uses.end());
  using Direction = edits::Edit::Direction;
  CANDELA_ASSIGN(edits::PathStates of_light, edits::PathStates::compile(list, Direction::light, names, uses));
  CANDELA_ASSIGN(edits::PathStates of_eye, edits::PathStates::compile(list, Direction::eye, names, uses));

  const std::uint32_t places = 1u << list.regions.size();
  std::vector<bool> scatters(geometry_.shapes.size());
  std::string mixed;
  for (std::uint32_t shape = 0; shape < geometry_.shapes.size(); ++shape) {
    const std::uint32_t bsdf = geometry_.shapes[shape].bsdf, object = objects_.of_shape[shape];
    const BsdfFacts facts = bsdfs_[bsdf].facts();
    scatters[shape] = !scatters_nothing(facts);
    if (!scatters[shape]) continue;
    const bool mixes = mixes_letters(bsdfs_[bsdf]);
    bool varies = false;
    std::array<std::uint16_t, 2> all{};
    for (const edits::PathStates* states : {&of_light, &of_eye})
      for (std::uint32_t place = 0; place < places; ++place)
        for (const Side side : {Side::reflected, Side::transmitted})
          for (std::size_t q = 0; q < states->size(); ++q) {
            const auto state = static_cast<edits::PathStates::State>(q);
            for (const Letter letter : {Letter::diffuse, Letter::glossy, Letter::specular}) {
              const auto c = states->class_of(letter, side, object, place);
              all[states == &of_eye] |= states->selected(state, c);
              varies |= letter != Letter::specular && states->selected(state, c) != states->selected(0, c);
            }
            if (mixes && states->next(state, states->class_of(Letter::diffuse, side, object, place)) !=
                             states->next(state, states->class_of(Letter::glossy, side, object, place)))
              return input_error(
                         fmt::format("the edits of {} tell D from G at the surface {}, which scatters "
                                     "by both at once",
                                     states == &of_light ? "light" : "what is gathered",
                                     named(objects_.names[object])))
                  .with_mend("write X or [DG] for vertices before the edited one");
          }
    if (mixes && varies && mixed.empty()) mixed = named(objects_.names[object]);
    const SurfaceEdits::Treatment either{all[0], all[1]};
    if (!(either == SurfaceEdits::Treatment{}) && facts.passthrough)
      return passes_through(list.edits[first_of(either)], objects_.names[object]);
    CANDELA_TRY(check_count(either, "surface", objects_.names[object]));
    for (std::size_t k = 0; k < selected_.size(); ++k) selected_[k].shapes += takes_part(either, k) ? 1 : 0;
  }
  for (const std::uint32_t object : objects_.of_medium) {
    SurfaceEdits::Treatment either;
    for (const edits::PathStates* states : {&of_light, &of_eye})
      for (std::uint32_t place = 0; place < places; ++place)
        for (std::size_t q = 0; q < states->size(); ++q)
          (states == &of_light ? either.of_light : either.of_eye) |=
              states->selected(static_cast<edits::PathStates::State>(q),
                               states->class_of(Letter::volume, Side::none, object, place));
    CANDELA_TRY(check_count(either, "medium", objects_.names[object]));
    for (std::size_t k = 0; k < selected_.size(); ++k) selected_[k].media += takes_part(either, k) ? 1 : 0;
  }
  std::optional<std::uint32_t> outside;
  for (const std::uint32_t emitter : lights_.environments()) {
    const std::uint32_t state = of_light.at_lamp(objects_.of_emitter[emitter]);
    if (outside && *outside != state)
      return input_error("edits tell lights from outside of the scene apart, whose light arrives together")
          .with_mend("name none of them: L");
    outside = state;
  }
  objects_.path_edits = std::make_shared<const PathEdits>(PathEdits{
      std::move(of_light), std::move(of_eye), &edits_, &objects_, std::move(scatters), std::move(mixed)});
  return {};
}

}  // namespace candela::scene
