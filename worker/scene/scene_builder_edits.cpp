// Edits of light transport: the surfaces that they select, and their bsdfs.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <optional>
#include <utility>

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

Error too_many_edits(const std::vector<std::string>& surface) {
  return input_error(fmt::format("more than {} edits of one direction select the surface {}",
                                 SurfaceEdits::kMax, named(surface)));
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

std::string note_of(const edits::Edit& edit, std::size_t selected, std::size_t shapes, bool by_path) {
  std::string text =
      fmt::format("edit '{}': {} {}, {}{} of {} shapes", edit.name,
                  edit.direction == edits::Edit::Direction::light ? "light after" : "gathered at",
                  edit.select, by_path ? "by the path: at most " : "", selected, shapes);
  if (!edit.source.empty()) text += fmt::format(", towards {}", edit.source);
  if (edit.rotate) text += fmt::format(", turned by {} degrees", edit.rotate->degrees);
  if (edit.move) text += ", moved";
  if (edit.factor != edits::Triple{1, 1, 1})
    text += fmt::format(", times {}, {}, {}", edit.factor[0], edit.factor[1], edit.factor[2]);
  return text;
}

}  // namespace

Result<void> SceneBuilder::edit(const EditRequest& request) {
  const edits::EditList& list = request.list;
  std::vector<letters::ObjectNames> names = objects_.names;
  std::vector<std::uint8_t> uses = objects_.uses;
  names.insert(names.end(), request.names.begin(), request.names.end());
  uses.insert(uses.end(), request.uses.begin(), request.uses.end());
  std::vector<edits::Selection> selections;
  bool by_place = false, by_path = false;
  for (const edits::Edit& edit : list.edits) {
    CANDELA_ASSIGN(edits::Selection selection, edits::Selection::compile(list, edit, names, uses));
    by_path |= selection.by_path();
    selections.push_back(std::move(selection));
    edits_.edits.push_back({.of_light = edit.direction == edits::Edit::Direction::light,
                            .map = direction_map(edit),
                            .cone = cone_of(list, edit),
                            .factor = {static_cast<float>(edit.factor[0]), static_cast<float>(edit.factor[1]),
                                       static_cast<float>(edit.factor[2])}});
    CANDELA_ASSIGN(const letters::Node tree, letters::parse_expression(edit.select));
    letters::for_each_token(tree, [&](const letters::Token& token) { by_place |= !token.region.empty(); });
  }
  for (const letters::Region& region : list.regions) edits_.regions.push_back(cone_of(region));
  edits_.glossy_below = static_cast<float>(list.glossy_below);
  if (by_path) return {};  // finish_edits() does the rest

  const std::uint32_t places = by_place ? 1u << list.regions.size() : 1;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> made;  // by bsdf and object
  std::vector<std::size_t> selected(list.edits.size());
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
    if (facts.passthrough)
      return passes_through(list.edits[static_cast<std::size_t>(
                                std::countr_zero(static_cast<unsigned>(all.of_light | all.of_eye)))],
                            objects_.names[object]);
    for (const std::uint16_t bits : {all.of_light, all.of_eye})
      if (std::popcount(bits) > static_cast<int>(SurfaceEdits::kMax))
        return too_many_edits(objects_.names[object]);
    for (std::size_t k = 0; k < selected.size(); ++k) selected[k] += (all.of_light | all.of_eye) >> k & 1;
    const auto [at, fresh] = made.try_emplace({bsdf, object}, static_cast<std::uint32_t>(bsdfs_.size()));
    if (fresh) {
      CANDELA_ASSIGN(Bsdf edited, Bsdf::with_edits(bsdfs_, bsdf, std::move(edits)));
      bsdfs_.push_back(std::move(edited));
    }
    geometry_.shapes[shape].bsdf = at->second;
  }
  for (std::size_t k = 0; k < selected.size(); ++k)
    features_.edits.push_back(note_of(list.edits[k], selected[k], geometry_.shapes.size(), false));
  edited_ = true;
  return {};
}

Result<void> SceneBuilder::finish_edits(const EditRequest& request) {
  if (edited_) return {};
  const edits::EditList& list = request.list;
  std::vector<letters::ObjectNames> names = objects_.names;
  std::vector<std::uint8_t> uses = objects_.uses;
  names.insert(names.end(), request.names.begin(), request.names.end());
  uses.insert(uses.end(), request.uses.begin(), request.uses.end());
  using Direction = edits::Edit::Direction;
  CANDELA_ASSIGN(edits::PathStates of_light, edits::PathStates::compile(list, Direction::light, names, uses));
  CANDELA_ASSIGN(edits::PathStates of_eye, edits::PathStates::compile(list, Direction::eye, names, uses));

  const std::uint32_t places = 1u << list.regions.size();
  std::vector<std::size_t> selected(list.edits.size());
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
    const auto either = static_cast<unsigned>(all[0] | all[1]);
    if (either != 0 && facts.passthrough)
      return passes_through(list.edits[static_cast<std::size_t>(std::countr_zero(either))],
                            objects_.names[object]);
    for (const std::uint16_t bits : all)
      if (std::popcount(bits) > static_cast<int>(SurfaceEdits::kMax))
        return too_many_edits(objects_.names[object]);
    for (std::size_t k = 0; k < selected.size(); ++k) selected[k] += either >> k & 1;
  }
  std::optional<std::uint32_t> outside;
  for (const std::uint32_t emitter : lights_.environments()) {
    const std::uint32_t state = of_light.at_lamp(objects_.of_emitter[emitter]);
    if (outside && *outside != state)
      return input_error("edits tell lights from outside of the scene apart, whose light arrives together")
          .with_mend("name none of them: L");
    outside = state;
  }
  for (std::size_t k = 0; k < selected.size(); ++k)
    features_.edits.push_back(note_of(list.edits[k], selected[k], geometry_.shapes.size(), true));
  objects_.path_edits = std::make_shared<const PathEdits>(PathEdits{
      std::move(of_light), std::move(of_eye), &edits_, &objects_, std::move(scatters), std::move(mixed)});
  return {};
}

}  // namespace candela::scene
