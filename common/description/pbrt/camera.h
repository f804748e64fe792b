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
  bool has_filter = false;       // the scene has a PixelFilter
};

// An Option directive. Errors: a name that pbrt does not have.
Result<void> read_option(Context& context, const std::string& name, std::string_view value,
                         const Location& where);

// Factor of the brightness of the film: the time that the shutter is open, and ISO.
Result<double> exposure(Context& context, RenderOptions& options);

// The sensor with film, filter and sampler. `medium`: around the camera; may be null.
Result<ObjectPtr> build_sensor(Context& context, RenderOptions& options, ObjectPtr medium);

Result<ObjectPtr> build_integrator(Context& context, RenderOptions& options);

}  // namespace candela::description::pbrt
