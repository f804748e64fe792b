// Affine transforms as pbrt composes them.
#pragma once

#include <optional>

#include "common/description/object.h"

namespace candela::description::pbrt {

// The inverse of an affine matrix; nothing if the matrix is singular.
std::optional<Mat4> inverse(const Mat4& matrix);

// Rotation, even scale, mirror and translation: spheres stay spheres.
bool is_similarity(const Mat4& matrix);
bool swaps_handedness(const Mat4& matrix);

// The length of what the matrix makes of the unit vector along an axis (0, 1, 2).
double axis_length(const Mat4& matrix, std::size_t axis);

Vec3 transform_point(const Mat4& matrix, const Vec3& p);
Vec3 transform_vector(const Mat4& matrix, const Vec3& v);

// The tangent of an angle in degrees, below 90.
double tangent_degrees(double degrees);
double cosine_degrees(double degrees);

}  // namespace candela::description::pbrt
