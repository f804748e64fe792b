// The parts that emitters of scene files share when they build themselves. An emitter that is no surface has,
// beside the interface of emitter_set.h,
//   kPlugins                the names in scene files
//   build(object, textures) parameters mean what Mitsuba 3 documents; errors name file, line and property
//   black()                 sends no light: the scene leaves it out
//   kDelta                  no ray meets it: a point or a direction
//   max_radiance(radius)    the largest luminance that a point of a scene of this radius receives, roughly:
//                           the film's scale is bounded by it
#pragma once

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/scene/textures/texture.h"
#include "worker/scene/transform.h"

namespace candela::scene {

Error emitter_error(const description::Object& object, std::string message, std::string_view property = {});

// Finite and not negative.
bool is_radiometric(Spectrum s);
// A color of the description that is_radiometric(); white if it is not given.
Result<Spectrum> read_quantity(const description::Object& object, std::string_view name);

// The frame of a light that to_world turns and places.
Result<Frame> read_frame(const description::Object& object, const Transform& to_world);

// The largest luminance of a point light's peak intensity over the squared radius of the scene.
float radiance_of_point(Spectrum peak, double scene_radius);

}  // namespace candela::scene
