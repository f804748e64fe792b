// Random paths for tests of the transport layer: subpaths walked as the kernels do, all their vertices kept,
// and joined to whole paths for the oracle (tests/unit/transport_reference.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/bundle/gather.h"
#include "tests/unit/transport_reference.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/objects.h"
#include "worker/transport/technique/connect.h"
#include "worker/transport/technique/connect_lens.h"
#include "worker/transport/technique/hit_lens.h"
#include "worker/transport/technique/hit_light.h"
#include "worker/transport/technique/next_event.h"
#include "worker/transport/walk.h"

namespace candela::test {

inline constexpr std::uint32_t kFilmSize = 64;

inline Result<std::unique_ptr<scene::Scene>> load_scene(const std::filesystem::path& file) {
  const bundle::DiskSource files(file.parent_path());
  CANDELA_ASSIGN(const description::SceneDescription description,
                 description::parse_scene(files, file.filename().string(), {}));
  scene::Scene::Options options;
  options.film_width = options.film_height = kFilmSize;
  return scene::Scene::build(description, files, options);
}

// A vertex where a walk arrived. v.parent: the slot of the vertex before, scene::kNone: the end point.
struct Slot {
  transport::Vertex<transport::MisBlock> v;
  scene::ClosureArena arena;
  std::uint32_t block = 0;  // of the sampler
  bool stratified = false;
  bool left = false;                         // the walk left the scene here
  double delta_prob = 0;                     // of the delta lobe it went on by, if any
  std::unique_ptr<scene::EditedWalk> edits;  // if the scene has some that select by the path
};
using Slots = std::vector<std::unique_ptr<Slot>>;

// Facts of the walk's last advance(), before it is scattered.
template <class WalkT>
void note(const WalkT& walk, Slot& slot, std::uint32_t parent) {
  slot.v.parent = parent;
  slot.v.left_by_delta = false;
  slot.block = walk.draws().block;
  slot.stratified = walk.stratified();
}

// As estimators with edits that select by the path do it with a vertex before they use it. before: the slot
// of the vertex before; null: it is the first of a walk from the eye, or from the lamp of this number.
inline void edit(const scene::Scene& scene, Slot& slot, const Slot* before, const std::uint32_t* lamp) {
  const scene::PathEdits* const edits = scene.objects().path_edits.get();
  if (edits == nullptr || slot.left) return;
  slot.edits = std::make_unique<scene::EditedWalk>(*edits, true);
  if (before != nullptr)
    slot.edits->follow(*before->edits);
  else if (lamp != nullptr)
    slot.edits->begin_at_lamp(*lamp);
  else
    slot.edits->begin_at_eye();
  if (slot.v.on_surface())
    slot.v.closure = slot.edits->surface(slot.v.hit, slot.v.closure);
  else
    slot.v.turned =
        slot.edits->medium(slot.v.medium, scene.medium(slot.v.medium).phase(), slot.v.hit.p, slot.v.closure);
  if (lamp == nullptr) slot.edits->towards_lamp(0);
}

// The random numbers of the slot's vertex.
inline transport::VertexDraws<samplers::Sampler> draws_of(const Slot& slot, samplers::Sampler& sampler) {
  return {sampler, slot.block, slot.stratified};
}

// The vertices from the one after the end point up to slots[last]; none for kNone.
inline std::vector<const Slot*> chain(const Slots& slots, std::uint32_t last) {
  std::vector<const Slot*> found;
  for (std::uint32_t i = last; i != scene::kNone; i = slots[i]->v.parent)
    found.insert(found.begin(), slots[i].get());
  return found;
}

inline transport::reference::InnerVertex inner_vertex(const Slot& slot, bool last, bool from_light) {
  transport::reference::InnerVertex inner;
  inner.kind = slot.v.kind;
  inner.hit = slot.v.hit;
  inner.medium = slot.v.kind == transport::VertexKind::medium ? slot.v.medium : scene::kNone;
  inner.delta = !last && slot.v.left_by_delta;
  inner.delta_prob = slot.delta_prob;
  inner.delta_prob_from_light = from_light;
  return inner;
}

// Fills the middle of a path: vertices from the light, then those from the eye; `along` but for an edge that
// connects both: that is `between` (from the light's last to the eye's last vertex).
inline void fill(transport::reference::FullPath& path, const std::vector<const Slot*>& light,
                 const std::vector<const Slot*>& eye, const Vec3* between) {
  for (std::size_t i = 0; i < light.size(); ++i) {
    path.along.push_back(-light[i]->v.wo);
    path.inner.push_back(inner_vertex(*light[i], i + 1 == light.size() && between != nullptr, true));
  }
  if (between != nullptr) path.along.push_back(*between);
  for (std::size_t i = eye.size(); i-- > 0;) {
    path.along.push_back(eye[i]->v.wo);
    path.inner.push_back(inner_vertex(*eye[i], i + 1 == eye.size() && between != nullptr, false));
  }
}

inline void set_light(transport::reference::FullPath& path, const scene::EmissionSample& origin) {
  path.light = origin.vertex;
  path.light_infinite = origin.infinite;
  path.light_delta_position = origin.delta_position;
  path.light_delta_direction = origin.delta_direction;
  path.light_delta_radiance = origin.radiance;
}

}  // namespace candela::test
