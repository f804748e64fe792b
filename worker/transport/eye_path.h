// The loop over the vertices of an eye path, the same for all estimators.
#pragma once

#include "worker/transport/subpath.h"
#include "worker/transport/walk.h"

namespace candela::transport {

// Follows the path along a ray of Scene::camera_ray. `room` is a VertexPair or a Subpath. `at` is the list of
// an estimator's techniques:
// - arrived(walk, v, before, left): light may be met at v, on a surface, or out of the scene if `left`.
// - bool vertex(walk, v): v may scatter, and be connected if it is connectible. False ends the path.
// - bool scattered(walk, v): the walk chose a direction. False ends the path.
// - passed(): the walk goes straight on. The next vertex takes v's place unless the room keeps it.
template <class WalkT, class Room, class Techniques>
void follow_eye_path(WalkT& walk, const Ray& ray, Room& room, Techniques& at) {
  room.clear();
  walk.start_eye(ray);
  for (;;) {
    auto& [v, arena] = room.next();
    const auto event = walk.advance(v, arena);
    if (event == WalkT::Event::ended) return;
    const bool left = event == WalkT::Event::left;
    at.arrived(walk, v, room.before(), left);
    if (left || !at.vertex(walk, v)) return;
    switch (walk.scatter(v)) {
      case WalkT::Step::ended:
        return;
      case WalkT::Step::scattered:
        if (!at.scattered(walk, v)) return;
        room.keep();
        break;
      case WalkT::Step::passed:
        at.passed();
        room.pass();
        break;
    }
  }
}

// The usual answers after a vertex.
struct EyeTechniques {
  template <class WalkT>
  static bool scattered(const WalkT& /*walk*/, const ScatterPoint& /*v*/) {
    return true;
  }
  static void passed() {}
};

}  // namespace candela::transport
