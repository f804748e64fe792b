#include "worker/scene/light_sampler.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

constexpr float kEvenShare = 0.1f;
constexpr float kLeastCosine = 0.02f;  // a bound that is possible but small still counts this much
constexpr float kCosineSlack =
    1e-3f;  // rounding of the bounds must not declare a possible emitter impossible
constexpr float kLargestImportance = 1e30f;

bool is_zero(Vec3 v) {
  return v.x == 0 && v.y == 0 && v.z == 0;
}

// cos and sin of max(0, a - b), from those of a and b in [0, pi].
void subtract_angle(float& cos_a, float& sin_a, float cos_b, float sin_b) {
  if (cos_a >= cos_b) {
    cos_a = 1;
    sin_a = 0;
    return;
  }
  const float c = cos_a * cos_b + sin_a * sin_b;
  sin_a = sin_a * cos_b - cos_a * sin_b;
  cos_a = c;
}

float sine(float cosine) {
  return std::sqrt(std::max(0.0f, 1 - cosine * cosine));
}

}  // namespace

std::uint32_t LightSampler::add_area(std::uint32_t shape, const Rectangle* rectangle,
                                     const ColorTexture& radiance) {
  const ShapeRecord& record = geometry_->shapes[shape];
  Emitter e;
  e.radiance = radiance;
  // A texture is bounded by its maximum: it must not be missed where it is bright.
  const double level = static_cast<double>(luminance(radiance.maximum()));
  double area = 0;
  if (record.sphere != kNone) {
    const Sphere& s = geometry_->spheres[record.sphere].sphere;
    e.kind = Kind::sphere;
    e.index = static_cast<std::uint32_t>(spheres_.size());
    spheres_.emplace_back(s);
    sphere_records_.push_back(record.sphere);
    e.center = Vec3(s.center);
    e.radius = static_cast<float>(s.radius);
    area = 4 * static_cast<double>(math::kPi) * s.radius * s.radius;
    e.strength = static_cast<float>(level * area / 4);
  } else {
    Bounds bounds;
    Vec3d sum;
    float error = 0;
    for (std::uint32_t i = record.first_triangle; i < record.first_triangle + record.triangle_count; ++i) {
      const Triangle& t = geometry_->triangles[i];
      for (const Vec3 v : {t.v0, t.v1, t.v2}) {
        bounds.add(Vec3d(v));
        error = std::max(error, geometry_->point_error(i, v));
      }
      sum += cross(Vec3d(t.v1) - Vec3d(t.v0), Vec3d(t.v2) - Vec3d(t.v0));
    }
    e.center = Vec3(bounds.center());
    e.radius = static_cast<float>(bounds.radius());
    const double l = length(sum);
    e.axis = l > 0 ? Vec3(sum / l) : Vec3(0, 0, 1);
    float least = 1;
    for (std::uint32_t i = record.first_triangle; i < record.first_triangle + record.triangle_count; ++i) {
      least = std::min(least, dot(e.axis, geometry_->triangles[i].ng));
    }
    e.cos_spread = l > 0 ? std::clamp(least, -1.0f, 1.0f) : -1.0f;
    e.sin_spread = sine(e.cos_spread);
    if (rectangle != nullptr) {
      e.kind = Kind::rectangle;
      e.index = static_cast<std::uint32_t>(rectangles_.size());
      rectangles_.emplace_back(*rectangle, error);
      area = rectangles_.back().area();
    } else {
      e.kind = Kind::mesh;
      e.index = static_cast<std::uint32_t>(meshes_.size());
      meshes_.emplace_back(*geometry_, shape);
      area = meshes_.back().area();
    }
    // Of a closed surface a quarter of the area is what a distant point sees, on average.
    e.strength = static_cast<float>(level * area * (e.cos_spread > 0 ? 1.0 : 0.25));
  }
  e.power = level * area * static_cast<double>(math::kPi);
  emitters_.push_back(e);
  return static_cast<std::uint32_t>(emitters_.size() - 1);
}

std::uint32_t LightSampler::add_point(Vec3 position, Spectrum intensity) {
  Emitter e;
  e.kind = Kind::point;
  e.radiance.constant = intensity;
  e.vector = position;
  e.strength = luminance(intensity);
  e.power = 4 * static_cast<double>(math::kPi) * static_cast<double>(luminance(intensity));
  emitters_.push_back(e);
  return static_cast<std::uint32_t>(emitters_.size() - 1);
}

std::uint32_t LightSampler::add_directional(Vec3 direction, Spectrum irradiance) {
  Emitter e;
  e.kind = Kind::directional;
  e.radiance.constant = irradiance;
  e.vector = direction;
  e.strength = luminance(irradiance);
  emitters_.push_back(e);
  return static_cast<std::uint32_t>(emitters_.size() - 1);
}

std::uint32_t LightSampler::add_environment(Environment environment) {
  Emitter e;
  e.kind = Kind::environment;
  e.index = static_cast<std::uint32_t>(environments_.size());
  e.strength = luminance(environment.mean_radiance()) * math::kPi;
  const auto index = static_cast<std::uint32_t>(emitters_.size());
  environments_.push_back(std::move(environment));
  environment_emitters_.push_back(index);
  emitters_.push_back(e);
  return index;
}

void LightSampler::finish() {
  const double radius = std::max(geometry_->bounds.radius(), 1e-12);
  const double disk = static_cast<double>(math::kPi) * radius * radius;
  std::vector<double> powers;
  for (Emitter& e : emitters_) {
    if (e.kind == Kind::directional) e.power = static_cast<double>(e.strength) * disk;
    if (e.kind == Kind::environment) e.power = 4 * static_cast<double>(e.strength) * disk;
    powers.push_back(std::clamp(e.power, 0.0, 1e200));
  }
  powers_ = Distribution(powers);
}

Spectrum LightSampler::environment(Vec3 d) const {
  Spectrum sum;
  for (const Environment& e : environments_) sum += e.radiance(d);
  return sum;
}

float LightSampler::importance(const Emitter& e, Vec3 p, Vec3 front) const {
  const bool both_sides = is_zero(front);
  switch (e.kind) {
    case Kind::environment:
      return e.strength;
    case Kind::directional: {
      if (both_sides) return e.strength;
      const float cosine = -dot(front, e.vector);
      return cosine > 0 ? e.strength * std::max(cosine, kLeastCosine) : 0.0f;
    }
    case Kind::point: {
      const Vec3 v = e.vector - p;
      const float d2 = std::max(length_squared(v), 1e-36f);
      if (both_sides) return std::min(e.strength / d2, kLargestImportance);
      const float h = dot(front, v);
      if (!(h > 0)) return 0;
      return std::min(e.strength * std::max(h / std::sqrt(d2), kLeastCosine) / d2, kLargestImportance);
    }
    case Kind::rectangle:
      if (!rectangles_[e.index].reaches(p)) return 0;
      break;
    case Kind::sphere:
      if (!spheres_[e.index].reaches(p)) return 0;
      break;
    case Kind::mesh:
      break;
  }
  const Vec3 v = e.center - p;
  const float d2 = length_squared(v);
  const float h = dot(front, v);
  if (!both_sides && h <= -e.radius * (1 + kCosineSlack) - kCosineSlack * std::sqrt(d2)) return 0;
  const float r2 = std::max(e.radius * e.radius, 1e-36f);
  if (d2 <= r2) return std::min(e.strength / r2, kLargestImportance);
  const float inverse_d = 1 / std::sqrt(d2);
  const float sin_extent = std::min(1.0f, e.radius * inverse_d), cos_extent = sine(sin_extent);
  float result = e.strength * inverse_d * inverse_d;
  if (e.kind != Kind::sphere) {
    // The least angle between a normal of the emitter and the direction to the reference.
    float c = std::clamp(-dot(e.axis, v) * inverse_d, -1.0f, 1.0f), s = sine(c);
    subtract_angle(c, s, e.cos_spread, e.sin_spread);
    subtract_angle(c, s, cos_extent, sin_extent);
    if (c < -kCosineSlack) return 0;
    result *= std::max(c, kLeastCosine);
  }
  if (!both_sides) {
    float c = std::clamp(h * inverse_d, -1.0f, 1.0f), s = sine(c);
    subtract_angle(c, s, cos_extent, sin_extent);
    result *= std::max(c, kLeastCosine);
  }
  return std::min(result, kLargestImportance);
}

float LightSampler::importances(Vec3 p, Vec3 front, float* out, std::uint32_t& positive_count) const {
  float sum = 0;
  positive_count = 0;
  for (std::size_t i = 0; i < emitters_.size(); ++i) {
    out[i] = importance(emitters_[i], p, front);
    sum += out[i];
    positive_count += out[i] > 0 ? 1u : 0u;
  }
  return sum;
}

float LightSampler::share(float importance, float sum, std::uint32_t positive_count) {
  if (!(importance > 0)) return 0;
  return (1 - kEvenShare) * (importance / sum) + kEvenShare / static_cast<float>(positive_count);
}

bool LightSampler::select(Vec3 p, Vec3 front, double u, std::uint32_t& emitter, float& prob,
                          double& rest) const {
  if (emitters_.size() == 1) {
    emitter = 0;
    prob = 1;
    rest = u;
    return true;
  }
  if (!by_importance()) {
    if (!(powers_.total() > 0)) return false;
    emitter = powers_.sample(u, &rest);
    prob = static_cast<float>(powers_.probability(emitter));
    return true;
  }
  std::array<float, kImportanceEmitters> values;
  std::uint32_t positive_count = 0;
  const float sum = importances(p, front, values.data(), positive_count);
  if (positive_count == 0) return false;
  double cumulative = 0;
  bool found = false;
  for (std::size_t i = 0; i < emitters_.size(); ++i) {
    const float q = share(values[i], sum, positive_count);
    if (!(q > 0)) continue;
    emitter = static_cast<std::uint32_t>(i);
    prob = q;
    found = true;
    rest = std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53);
    cumulative += static_cast<double>(q);
    if (u < cumulative) break;
  }
  return found;
}

float LightSampler::prob(Vec3 p, Vec3 front, std::uint32_t emitter) const {
  if (emitters_.size() == 1) return 1;
  if (!by_importance()) return powers_.total() > 0 ? static_cast<float>(powers_.probability(emitter)) : 0.0f;
  std::array<float, kImportanceEmitters> values;
  std::uint32_t positive_count = 0;
  const float sum = importances(p, front, values.data(), positive_count);
  return share(values[emitter], sum, positive_count);
}

bool LightSampler::sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                          DirectSample& out) const {
  if (emitters_.empty()) return false;
  float prob = 0;
  double rest = 0;
  if (emitters_.size() == 1 && emitters_[0].kind != Kind::mesh) {
    prob = 1;
    out.emitter = 0;
  } else if (!select(reference.p, front, extend_draw(u_select, u.x, u.y), out.emitter, prob, rest)) {
    return false;
  }
  const Emitter& e = emitters_[out.emitter];
  const bool both_sides = is_zero(front);
  out.delta = false;
  LightPoint point;
  switch (e.kind) {
    case Kind::point: {
      const Vec3 v = e.vector - reference.p;
      const float d2 = length_squared(v);
      if (!(d2 > 0)) return false;
      out.wi = v / std::sqrt(d2);
      out.radiance = e.radiance.constant / d2;
      out.pdf_solid_angle = prob;
      out.delta = true;
      if (!both_sides && !(dot(front, out.wi) > 0)) return false;
      out.shadow_ray = spawn_shadow_ray(reference, e.vector, {0, 0, 0}, 0);
      return !out.radiance.is_black();
    }
    case Kind::directional:
      out.wi = -e.vector;
      out.radiance = e.radiance.constant;
      out.pdf_solid_angle = prob;
      out.delta = true;
      if (!both_sides && !(dot(front, out.wi) > 0)) return false;
      out.shadow_ray = spawn_ray(reference, out.wi);
      return !out.radiance.is_black();
    case Kind::environment: {
      float pdf = 0;
      if (!environments_[e.index].sample(u, out.wi, out.radiance, pdf) || !(pdf > 0)) return false;
      if (!both_sides && !(dot(front, out.wi) > 0)) return false;
      out.pdf_solid_angle = prob * pdf;
      if (environments_.size() > 1) {
        // Light of all environments arrives from one direction, whichever of them proposed it.
        out.radiance = environment(out.wi);
        out.pdf_solid_angle = pdf_environment_solid_angle(reference, front, out.wi);
      }
      out.shadow_ray = spawn_ray(reference, out.wi);
      return !out.radiance.is_black();
    }
    case Kind::rectangle:
      if (!rectangles_[e.index].sample(reference.p, u, point)) return false;
      break;
    case Kind::sphere:
      if (!spheres_[e.index].sample(reference.p, u, point)) return false;
      if (!e.radiance.is_constant()) {
        const Sphere& s = geometry_->spheres[sphere_records_[e.index]].sphere;
        const Vec3d n(point.ng);
        point.uv = sphere_uv(s, s.inside_out ? -n : n);
      }
      break;
    case Kind::mesh:
      if (!meshes_[e.index].sample(reference.p, rest, u, point)) return false;
      break;
  }
  if (!both_sides && !(dot(front, point.wi) > 0)) return false;
  out.wi = point.wi;
  out.radiance = e.radiance.eval(point.uv);
  if (out.radiance.is_black()) return false;
  out.pdf_solid_angle = prob * point.pdf_solid_angle;
  out.shadow_ray = spawn_shadow_ray(reference, point.p, point.ng, point.error);
  return true;
}

float LightSampler::pdf_solid_angle(const SurfaceHit& reference, Vec3 front, const SurfaceHit& hit) const {
  const Emitter& e = emitters_[hit.emitter];
  float pdf = 0;
  switch (e.kind) {
    case Kind::rectangle:
      pdf = rectangles_[e.index].pdf_solid_angle(reference.p, hit.p);
      break;
    case Kind::sphere:
      pdf = spheres_[e.index].pdf_solid_angle(reference.p);
      break;
    case Kind::mesh:
      pdf = meshes_[e.index].pdf_solid_angle(reference.p, hit);
      break;
    case Kind::point:
    case Kind::directional:
    case Kind::environment:
      return 0;
  }
  return pdf > 0 ? pdf * prob(reference.p, front, hit.emitter) : 0.0f;
}

float LightSampler::pdf_environment_solid_angle(const SurfaceHit& reference, Vec3 front, Vec3 d) const {
  float sum = 0;
  for (std::size_t i = 0; i < environments_.size(); ++i) {
    sum += environments_[i].pdf_solid_angle(d) * prob(reference.p, front, environment_emitters_[i]);
  }
  return sum;
}

}  // namespace candela::scene
