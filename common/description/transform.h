// 4x4 matrices as scene files build them. No libm transcendental functions: a scene means the same bits
// everywhere.
#pragma once

#include <optional>

#include "common/description/object.h"

namespace candela::description::transform {

inline constexpr Mat4 identity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Mat4 multiply(const Mat4& a, const Mat4& b);
Mat4 translate(const Vec3& by);
Mat4 scale(const Vec3& by);

// Right-handed, by degrees about an axis of any length; nullopt for an axis of no length. Multiples of 90
// degrees about the coordinate axes are exact.
std::optional<Mat4> rotate(const Vec3& axis, double degrees);

// Mitsuba's: looks along +z from origin to target, +x to the left; an `up` of zero picks one. nullopt where
// target is origin, or up is parallel to the view.
std::optional<Mat4> look_at(const Vec3& origin, const Vec3& target, const Vec3& up);

// Invertible in practice: the volume of the unit cube's image is more than 1e-12 of the product of its edges.
bool is_invertible(const Mat4& matrix);
bool is_affine(const Mat4& matrix);  // the last row is 0 0 0 1
bool is_finite(const Mat4& matrix);
// Turns, places, mirrors and scales all axes alike, to a relative tolerance of 1e-4.
bool is_similarity(const Mat4& matrix);
// The rotation, or mirrored rotation, and place that keep the image of +z and the side of +x and +y; nullopt
// if the matrix flattens them.
std::optional<Mat4> without_shear(const Mat4& matrix);

// The sRGB transfer function's inverse, for an encoded value in [0, 1].
double srgb_to_linear(double encoded);

}  // namespace candela::description::transform
