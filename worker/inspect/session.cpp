#include "worker/inspect/session.h"

#include <algorithm>
#include <map>
#include <utility>

#include "common/description/object_list.h"
#include "common/description/reading.h"
#include "common/description/reading_budget.h"
#include "common/description/unpacked_files.h"
#include "common/edits/edits.h"
#include "common/edits/selection.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/edits/edit_request.h"
#include "worker/scene/objects.h"
#include "worker/transport/letters/vertex_letter.h"

namespace candela::inspect {
namespace {

constexpr const char* kAllLight = "L[DGSV]*E";

letters::LayerRequest request_of(const Selection& selection) {
  letters::LayerRequest request;
  request.layers.push_back({"select", selection.expression.empty() ? kAllLight : selection.expression});
  request.regions = selection.regions;
  request.glossy_below = selection.glossy_below;
  return request;
}

}  // namespace

Session::Session(JobSettings settings, film::PixelFilter filter, std::unique_ptr<scene::Scene> scene,
                 letters::Automaton automaton, letters::LayerRequest request, bool selects)
    : settings_(std::move(settings)),
      filter_(std::move(filter)),
      scene_(std::move(scene)),
      automaton_(std::move(automaton)),
      request_(std::move(request)),
      selects_(selects) {
  std::map<std::string, std::uint32_t> first;
  for (std::uint32_t i = 0; i < scene_->objects().names.size(); ++i)
    object_of_name_.push_back(first.emplace(object_name(i), i).first->second);
  std::map<std::string, std::uint32_t> bearers;
  for (const letters::ObjectNames& names : scene_->objects().names)
    for (const std::string& name : names) ++bearers[name];
  for (std::uint32_t i = 0; i < scene_->objects().names.size(); ++i)
    objects_of_name_.push_back(object_name(i).empty() ? letters::kNoObject : bearers[object_name(i)]);
}

Result<std::unique_ptr<Session>> Session::open(const description::FileSource& files,
                                               const std::string& main_key,
                                               const std::map<std::string, std::string>& parameters,
                                               const JobSettings& settings, const Selection& selection,
                                               unsigned threads, std::uint64_t memory_bytes) {
  letters::LayerRequest request = request_of(selection);
  CANDELA_TRY(letters::check(request));
  CANDELA_ASSIGN(film::PixelFilter filter,
                 film::PixelFilter::create(settings.filter, settings.filter_settings));
  description::ReadingBudget budget(memory_bytes);
  const description::BudgetedFiles counted(files, budget);
  // The client has refused what it should or told of it.
  CANDELA_ASSIGN(const description::ReadScene scene_file,
                 description::read_scene(counted, main_key, parameters,
                                         {.integrator = settings.integrator, .lenient = true}));
  const description::UnpackedFiles unpacked(counted);
  scene::Scene::Options options;
  options.isa = settings.isa;
  options.build_threads = threads;
  options.film_width = settings.width;
  options.film_height = settings.height;
  options.crop = settings.crop;
  options.named = true;
  description::LetterObjects described = description::letter_objects(*scene_file.description.scene);
  scene::EditRequest edits;
  CANDELA_ASSIGN(edits.list, edits::parse_edits(settings.edits));
  CANDELA_TRY(edits::check_integrator(edits.list, settings.integrator,
                                      edits::max_depth_of(settings.integrator_settings)));
  edits.names = described.names;
  edits.uses = described.uses;
  options.edits = &edits;
  CANDELA_ASSIGN(std::unique_ptr<scene::Scene> scene,
                 scene::Scene::build(scene_file.description, unpacked, options));
  if (const scene::PathEdits* const by_path = scene->objects().path_edits.get();
      by_path != nullptr && !by_path->mixed.empty())
    return edits::letters_not_known(by_path->mixed);
  // An expression may name what the scene left out, such as a black lamp.
  std::vector<letters::ObjectNames> names = scene->objects().names;
  std::vector<std::uint8_t> uses = scene->objects().uses;
  names.insert(names.end(), described.names.begin(), described.names.end());
  uses.insert(uses.end(), described.uses.begin(), described.uses.end());
  CANDELA_ASSIGN(letters::Automaton automaton, letters::Automaton::compile(request, names, uses));
  return std::unique_ptr<Session>(new Session(settings, std::move(filter), std::move(scene),
                                              std::move(automaton), std::move(request),
                                              !selection.expression.empty()));
}

const std::string& Session::object_name(std::uint32_t object) const {
  static const std::string none;
  const auto& names = scene_->objects().names;
  return object < names.size() && !names[object].empty() ? names[object].front() : none;
}

std::uint32_t Session::regions_at(Vec3 p) const {
  std::uint32_t mask = 0;
  for (std::size_t i = 0; i < request_.regions.size(); ++i)
    if (transport::is_inside(request_.regions[i], in_file(p))) mask |= 1u << i;
  return mask;
}

std::optional<Vec2> Session::project(Vec3 p) const {
  scene::SurfaceHit at;
  at.p = p;
  at.ng = {0, 0, 1};
  scene::CameraSample camera;
  const auto border = static_cast<float>(std::max(settings_.width, settings_.height));
  if (!scene_->sample_camera(at, {0.5f, 0.5f}, camera, border)) return std::nullopt;
  return Vec2{camera.film_x, camera.film_y};
}

}  // namespace candela::inspect
