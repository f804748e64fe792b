// Both subpaths of a bidirectional estimator with edits that select by more of the path than the vertex.
// Walks from the light know the verdict of edits of light alone, those from the eye that of edits of the eye;
// where two vertices are joined, each tells the other the state of its end.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "worker/estimators/bidirectional.h"
#include "worker/scene/bsdfs/edited_arrivals.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/objects.h"
#include "worker/transport/technique/contribution.h"

namespace candela::estimators {

template <>
struct EditedSubpaths<true> {
  // Precondition: the scene has such edits.
  explicit EditedSubpaths(const scene::Scene& scene)
      : scene_(scene), all_(*scene.objects().path_edits), light_{scene, all_}, eye_{scene, all_} {
    const auto& emitters = scene.objects().of_emitter;
    for (std::uint32_t emitter = 0; emitter < emitters.size(); ++emitter) {
      bool known = false;
      for (const std::uint32_t other : lamps_) known |= state_at(other) == state_at(emitter);
      if (!known) lamps_.push_back(emitter);
    }
  }

  void begin_light(std::uint32_t emitter) { light_.begin().begin_at_lamp(emitter); }
  void begin_eye() { eye_.begin().begin_at_eye(); }
  // The walk is at v, the i-th vertex of its subpath.
  void light_vertex(std::uint32_t i, transport::ScatterPoint& v) { light_.arrive(i, v); }
  void eye_vertex(std::uint32_t i, transport::ScatterPoint& v) { eye_.arrive(i, v); }
  // The i-th vertex of a light path that was kept, with what its walk knew: number `kept` of the list.
  void kept_light_vertex(std::uint32_t i, const scene::EditedArrivals& arrivals, std::size_t kept,
                         transport::ScatterPoint& v) {
    light_.begin().arrive_from_light(arrivals.state(kept), arrivals.shares(kept));
    light_.arrive(i, v);
  }
  scene::EditedWalk& eye_walk(std::uint32_t i) { return *eye_.walks[i]; }
  void leave_light(std::uint32_t i, const transport::ScatterPoint& v) { light_.leave(i, v); }
  void leave_eye(std::uint32_t i, const transport::ScatterPoint& v) { eye_.leave(i, v); }

  // Factors of contributions: of a connection of the vertex beside what its closure says, and of the edges
  // that meet the lens, and light.
  Spectrum light_share(std::uint32_t i, const transport::ScatterPoint& v) const { return light_.share(i, v); }
  Spectrum eye_share(std::uint32_t i, const transport::ScatterPoint& v) const { return eye_.share(i, v); }
  Spectrum share_at_lens() const { return light_.last->share_at_eye(); }
  Spectrum share_at_light(const transport::ScatterPoint& v, bool left) const {
    return eye_.last->share_at_lamp(left ? scene_.lights().environments()[0] : v.hit.emitter);
  }

  // The i-th vertex z from the light and the j-th y from the eye are to be connected.
  void join(std::uint32_t i, const transport::ScatterPoint& z, std::uint32_t j,
            const transport::ScatterPoint& y) {
    const Vec3d between = Vec3d(z.hit.p) - Vec3d(y.hit.p);
    const double distance = length(between);
    if (!(distance > 0)) return;
    const Vec3 to_light = Vec3(between / distance);
    scene::EditedWalk &light = *light_.walks[i], &eye = *eye_.walks[j];
    light.towards(eye, y.wo, -to_light);
    eye.towards(light, z.wo, to_light);
  }
  // next_event() is made for each state that lamps have, and counts if it chose a lamp of that state.
  template <class NextEvent>
  bool light_directly(std::uint32_t i, const transport::ScatterPoint& v, const NextEvent& next_event,
                      transport::Contribution& found, const transport::Towards& towards) {
    for (const std::uint32_t lamp : lamps_) {
      eye_.walks[i]->towards_lamp(lamp);
      if (!next_event() || state_at(towards.emitter) != state_at(lamp)) continue;
      found.value *= eye_.share(i, v);
      return true;
    }
    return false;
  }

 private:
  struct Side {
    Side(const scene::Scene& of, const scene::PathEdits& edits)
        : scene(of), all(edits), start(edits, true), last(&start) {}

    scene::EditedWalk& begin() {
      last = &start;
      return start;
    }
    void arrive(std::uint32_t i, transport::ScatterPoint& v) {
      while (walks.size() <= i) walks.push_back(std::make_unique<scene::EditedWalk>(all, true));
      scene::EditedWalk& walk = *walks[i];
      walk.follow(*last);
      last = &walk;
      if (v.on_surface())
        v.closure = walk.surface(v.hit, v.closure);
      else
        v.turned = walk.medium(v.medium, scene.medium(v.medium).phase(), v.hit.p, v.closure);
    }
    void leave(std::uint32_t i, const transport::ScatterPoint& v) {
      if (!v.on_surface()) walks[i]->leave_medium();
    }
    Spectrum share(std::uint32_t i, const transport::ScatterPoint& v) const {
      return v.on_surface() ? Spectrum(1) : walks[i]->medium_share();
    }

    const scene::Scene& scene;
    const scene::PathEdits& all;
    scene::EditedWalk start;
    std::vector<std::unique_ptr<scene::EditedWalk>> walks;  // by vertex
    scene::EditedWalk* last;                                // whose edge is under way
  };
  scene::EditedWalk::State state_at(std::uint32_t emitter) const {
    return all_.of_light.at_lamp(scene_.objects().of_emitter[emitter]);
  }

  const scene::Scene& scene_;
  const scene::PathEdits& all_;
  Side light_, eye_;
  std::vector<std::uint32_t> lamps_;  // one for each state
};

}  // namespace candela::estimators
