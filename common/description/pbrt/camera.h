// pbrt's camera, film, filter, sampler and integrator.
#pragma once

#include <string>

#include "common/description/pbrt/context.h"

namespace candela::description::pbrt {

// A directive that has a type and parameters.
struct Entity {
  std::string type;
  ParameterList parameters;
  Location where;
};

// The directives before WorldBegin, with the defaults of pbrt.
struct RenderOptions {
  Entity camera{"perspective", {}, {}};
  Entity film{"rgb", {}, {}};
  Entity filter{"gaussian", {}, {}};
  Entity sampler{"zsobol", {}, {}};
  Entity integrator{"volpath", {}, {}};
  Mat4 camera_from_world{};
  std::string camera_medium;
  double film_diagonal = 0.035;  // meters
};

// How many times brighter the film shows the scene: exposure time and ISO.
Result<double> exposure(Context& context, RenderOptions& options);

// The sensor with film, filter and sampler. `medium`: around the camera; may be null.
Result<ObjectPtr> build_sensor(Context& context, RenderOptions& options, ObjectPtr medium);

Result<ObjectPtr> build_integrator(Context& context, RenderOptions& options);

}  // namespace candela::description::pbrt
