// Small vectors. Geometry is float; what must be double says so where it is used.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace candela {

template <class T>
struct TVec2 {
  T x{}, y{};
};
using Vec2 = TVec2<float>;

template <class T>
struct TVec3 {
  T x{}, y{}, z{};

  constexpr TVec3() = default;
  constexpr TVec3(T x_, T y_, T z_) : x(x_), y(y_), z(z_) {}
  template <class U>
  explicit constexpr TVec3(const TVec3<U>& v)
      : x(static_cast<T>(v.x)), y(static_cast<T>(v.y)), z(static_cast<T>(v.z)) {}

  constexpr T operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
  constexpr TVec3 operator-() const { return {-x, -y, -z}; }
  friend constexpr TVec3 operator+(TVec3 a, TVec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend constexpr TVec3 operator-(TVec3 a, TVec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend constexpr TVec3 operator*(TVec3 a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  friend constexpr TVec3 operator*(T s, TVec3 a) { return a * s; }
  friend constexpr TVec3 operator/(TVec3 a, T s) { return a * (T(1) / s); }
  constexpr TVec3& operator+=(TVec3 b) { return *this = *this + b; }
  constexpr TVec3& operator-=(TVec3 b) { return *this = *this - b; }
  constexpr TVec3& operator*=(T s) { return *this = *this * s; }
  friend constexpr bool operator==(const TVec3&, const TVec3&) = default;
};
using Vec3 = TVec3<float>;
using Vec3d = TVec3<double>;

template <class T>
constexpr T dot(TVec3<T> a, TVec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr TVec3<T> cross(TVec3<T> a, TVec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
constexpr T length_squared(TVec3<T> v) {
  return dot(v, v);
}
template <class T>
T length(TVec3<T> v) {
  return std::sqrt(dot(v, v));
}
template <class T>
TVec3<T> normalize(TVec3<T> v) {
  return v / length(v);
}

// Linear Rec.709 radiance, throughput or reflectance.
struct Spectrum {
  float r = 0, g = 0, b = 0;
  constexpr Spectrum() = default;
  constexpr Spectrum(float r_, float g_, float b_) : r(r_), g(g_), b(b_) {}
  explicit constexpr Spectrum(float v) : r(v), g(v), b(v) {}
  friend constexpr Spectrum operator+(Spectrum a, Spectrum c) { return {a.r + c.r, a.g + c.g, a.b + c.b}; }
  friend constexpr Spectrum operator-(Spectrum a, Spectrum c) { return {a.r - c.r, a.g - c.g, a.b - c.b}; }
  friend constexpr Spectrum operator*(Spectrum a, Spectrum c) { return {a.r * c.r, a.g * c.g, a.b * c.b}; }
  friend constexpr Spectrum operator*(Spectrum a, float s) { return {a.r * s, a.g * s, a.b * s}; }
  friend constexpr Spectrum operator*(float s, Spectrum a) { return a * s; }
  friend constexpr Spectrum operator/(Spectrum a, Spectrum c) { return {a.r / c.r, a.g / c.g, a.b / c.b}; }
  friend constexpr Spectrum operator/(Spectrum a, float s) { return a * (1.0f / s); }
  constexpr Spectrum& operator+=(Spectrum c) { return *this = *this + c; }
  constexpr Spectrum& operator*=(Spectrum c) { return *this = *this * c; }
  constexpr Spectrum& operator*=(float s) { return *this = *this * s; }
  friend constexpr bool operator==(const Spectrum&, const Spectrum&) = default;
  constexpr float max_component() const { return std::max(r, std::max(g, b)); }
  constexpr float min_component() const { return std::min(r, std::min(g, b)); }
  constexpr bool is_black() const { return r == 0 && g == 0 && b == 0; }
};
// By component.
constexpr Spectrum min(Spectrum a, Spectrum b) {
  return {std::min(a.r, b.r), std::min(a.g, b.g), std::min(a.b, b.b)};
}
constexpr Spectrum max(Spectrum a, Spectrum b) {
  return {std::max(a.r, b.r), std::max(a.g, b.g), std::max(a.b, b.b)};
}
// Rec.709 luminance weights.
constexpr float luminance(Spectrum s) {
  return 0.212671f * s.r + 0.715160f * s.g + 0.072169f * s.b;
}

// An orthonormal basis; local z is n.
struct Frame {
  Vec3 s, t, n;
  Vec3 to_local(Vec3 v) const { return {dot(v, s), dot(v, t), dot(v, n)}; }
  Vec3 to_world(Vec3 v) const { return s * v.x + t * v.y + n * v.z; }
};
// Any basis around a unit normal, without branches that could differ (Duff et al. 2017).
inline Frame make_frame(Vec3 n) {
  const float sign = std::copysign(1.0f, n.z);
  const float a = -1.0f / (sign + n.z);
  const float b = n.x * n.y * a;
  return {{1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n};
}

struct Ray {
  Vec3 origin;
  Vec3 direction;  // unit
  float t_max = 3.0e38f;
};

}  // namespace candela
