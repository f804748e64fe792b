// The ways of sampling a point on an emitter that has been chosen, as seen from a reference point. An emitter
// that lacks one is sampled in its own way. So are emitters without a surface.
//
//                  spherical                         area    parallel
//   rectangle      uniform in solid angle            yes     yes
//     sheared      the same, as two triangles        yes     yes
//   triangles      one by area, in its solid angle   yes     own
//   sphere         own: the visible cap              own     own
//   disk           own: by area                      own     own
//   cylinder       own                               own     own
//
// Densities per solid angle, theta being the angle to the normal at the reference [Kondapaneni 2019,
// supplement, Eq. S1]: spherical 1 / S; area r^3 / (z area); parallel 1 / (A_p cos^3 theta).
#pragma once

#include <cstdint>

namespace candela::scene {

enum class PointSampler : std::uint8_t {
  own,  // of the emitter's kind: a part of Scene::sample_direct
  spherical,
  area,
  parallel,  // does not cover what is near the horizon: see parallel_projection.h
};

}  // namespace candela::scene
