// The loop over the vertices of a light path, the same for all estimators.
#pragma once

#include "common/rng/stream.h"
#include "worker/transport/subpath.h"
#include "worker/transport/walk.h"

namespace candela::transport {

// Follows the light path of the walk's sampler. `room` is a VertexPair or a Subpath. `at` is the list of an
// estimator's techniques. `key` names the vertex among all of a unit, and with a number of its own each
// splat:
// - started(walk), if it has it: light left a lamp.
// - met_lens(walk, key): the edge to the next vertex met a finite lens.
// - bool vertex(walk, v, key): v may scatter, and be connected if it is connectible. False ends the path.
// - bool scattered(walk, v): the walk chose a direction. False ends the path.
template <class WalkT, class Room, class Techniques>
void follow_light_path(WalkT& walk, Room& room, Techniques& at) {
  room.clear();
  if (!walk.start_light()) return;
  if constexpr (requires { at.started(walk); }) at.started(walk);
  for (std::uint64_t key = walk.sample_key();; key = rng::combine(key, 1)) {
    auto& [v, arena] = room.next();
    const auto event = walk.advance(v, arena);
    if (walk.lens().met) at.met_lens(walk, key);
    if (event != WalkT::Event::vertex) return;
    if (!at.vertex(walk, v, key)) return room.end();
    switch (walk.scatter(v)) {
      case WalkT::Step::ended:
        return room.end();
      case WalkT::Step::scattered:
        if (!at.scattered(walk, v)) return room.end();
        room.keep();
        break;
      case WalkT::Step::passed:
        room.pass();
        break;
    }
  }
}

}  // namespace candela::transport
