// Square pictures of the sphere of directions, as pbrt's infinite lights have them.
#pragma once

#include "common/base/result.h"
#include "worker/core/vec.h"
#include "worker/scene/textures/scratch.h"
#include "worker/scene/textures/texel_image.h"

namespace candela::scene {

// The place of a direction (unit) in the square [0, 1]^2, which keeps areas [Clarberg 2008]: +z is in the
// middle, -z in the corners, x to the right and y downwards in the rows of a picture.
Vec2 equal_area_square(Vec3d direction);
// The direction (unit) of a place in the square.
Vec3d equal_area_direction(double x, double y);

// The picture as rows from pole to pole that Environment reads, of twice the columns and one row more. The
// picture is square.
Result<TexelImage> latitude_longitude(const TexelImage& square, Scratch& scratch);

}  // namespace candela::scene
