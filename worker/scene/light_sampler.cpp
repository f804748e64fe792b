#include "worker/scene/light_sampler.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "worker/core/math.h"
#include "worker/scene/cone.h"

namespace candela::scene {
namespace {

constexpr float kEvenShare = 0.1f;
constexpr float kEvenShareBesideTree = 0.5f;  // a tree's importance is a crude bound
constexpr float kLeastCosine = 0.02f;         // a bound that is possible but small still counts this much
constexpr float kCosineSlack =
    1e-3f;  // rounding of the bounds must not declare a possible emitter impossible
constexpr float kLargestImportance = 1e30f;

}  // namespace

std::uint32_t LightSampler::add_area(std::uint32_t shape, const Rectangle* rectangle,
                                     const ColorTexture& radiance) {
  const ShapeRecord& record = geometry_->shapes[shape];
  Emitter e;
  e.radiance = radiance;
  e.shape = shape;
  const auto append = [&](Kind kind, auto& lights, auto&&... arguments) {
    e.kind = kind;
    e.index = static_cast<std::uint32_t>(lights.size());
    lights.emplace_back(arguments...);
  };
  float seen = 0.25f;  // of a closed surface a quarter of the area is what a distant point sees, on average
  if (record.sphere != kNone) {
    const Sphere& s = geometry_->spheres[record.sphere].sphere;
    append(Kind::sphere, spheres_, s);
    e.center = Vec3(s.center);
    e.radius = static_cast<float>(s.radius);
  } else if (record.disk != kNone) {
    const Disk& d = geometry_->disks[record.disk].disk;
    append(Kind::disk, disks_, d);
    e.center = Vec3(d.center);
    e.radius = static_cast<float>(d.radius);
    e.axis = Vec3(d.axes[2]);
    e.cos_spread = 1;
    seen = 1;
  } else if (record.cylinder != kNone) {
    const Cylinder& c = geometry_->cylinders[record.cylinder].cylinder;
    append(Kind::cylinder, cylinders_, c);
    e.center = Vec3(c.base + c.axes[2] * (c.length / 2));
    e.radius = static_cast<float>(std::sqrt(c.radius * c.radius + c.length * c.length / 4));
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
      append(Kind::rectangle, rectangles_, *rectangle, error);
    } else {
      append(Kind::mesh, meshes_, *geometry_, shape);
    }
    if (e.cos_spread > 0) seen = 1;
  }
  // A texture is bounded by its maximum: it must not be missed where it is bright.
  const double level = static_cast<double>(luminance(radiance.maximum()));
  e.strength = static_cast<float>(std::min(level * area(e) * static_cast<double>(seen), 1e30));
  emitters_.push_back(e);
  return static_cast<std::uint32_t>(emitters_.size() - 1);
}

std::uint32_t LightSampler::add_spot(SpotLight spot) {
  Emitter e;
  e.kind = Kind::spot;
  e.index = static_cast<std::uint32_t>(spots_.size());
  e.vector = spot.position();
  e.strength = luminance(spot.peak());
  spots_.push_back(spot);
  emitters_.push_back(e);
  return static_cast<std::uint32_t>(emitters_.size() - 1);
}

std::uint32_t LightSampler::add_point(Vec3 position, Spectrum intensity) {
  Emitter e;
  e.kind = Kind::point;
  e.radiance.constant = intensity;
  e.vector = position;
  e.strength = luminance(intensity);
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

void LightSampler::finish(bool choose_by_power) {
  center_ = geometry_->bounds.center();
  radius_ = std::max(geometry_->bounds.radius(), 1e-12) * (1 + 1e-5);
  std::vector<double> powers;
  powers.reserve(emitters_.size());
  for (std::uint32_t i = 0; i < emitters_.size(); ++i) {
    double p = static_cast<double>(luminance(power(i)));
    // A texture whose light the quadrature missed must still be found.
    const Emitter& e = emitters_[i];
    if (!e.radiance.is_constant())
      p = std::max(p, 1e-3 * static_cast<double>(luminance(e.radiance.maximum())) * area(e));
    powers.push_back(p >= 0 ? std::min(p, 1e200) : 0.0);
  }
  powers_ = Distribution(powers);
  if (by_importance() || choose_by_power) return;
  std::vector<LightBounds> placed;
  for (std::uint32_t i = 0; i < emitters_.size(); ++i) {
    if (infinite(emitters_[i])) {
      infinite_.push_back(i);
    } else {
      placed.push_back(bounds(i));
      placed.back().power = powers[i];
    }
  }
  tree_ = LightTree(std::move(placed), emitters_.size());
}

LightBounds LightSampler::bounds(std::uint32_t i) const {
  const Emitter& e = emitters_[i];
  LightBounds out;
  out.emitter = i;
  out.strength = e.strength;
  if (e.kind == Kind::point || e.kind == Kind::spot) {
    out.box.add(Vec3d(e.vector));
    out.spread = math::kPi;
    if (e.kind == Kind::spot) {
      const SpotLight& spot = spots_[e.index];
      out.axis = spot.axis();
      out.spread = spot.beam();
      out.emission = spot.cutoff() - spot.beam();
    }
    return out;
  }
  const ShapeRecord& record = geometry_->shapes[e.shape];
  out.emission = math::kPi / 2;
  if (record.sphere != kNone) {
    out.box = bounds_of(geometry_->spheres[record.sphere].sphere);
  } else if (record.disk != kNone) {
    out.box = bounds_of(geometry_->disks[record.disk].disk);
  } else if (record.cylinder != kNone) {
    out.box = bounds_of(geometry_->cylinders[record.cylinder].cylinder);
  } else {
    for (std::uint32_t t = record.first_triangle; t < record.first_triangle + record.triangle_count; ++t) {
      const Triangle& triangle = geometry_->triangles[t];
      for (const Vec3 v : {triangle.v0, triangle.v1, triangle.v2}) out.box.add(Vec3d(v));
    }
  }
  out.axis = length_squared(e.axis) > 0 ? e.axis : Vec3(0, 0, 1);
  out.spread = math::acosf(e.cos_spread);
  return out;
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
    case Kind::spot: {
      const SpotLight& spot = spots_[e.index];
      const Vec3 v = e.vector - p;
      const float d2 = std::max(length_squared(v), 1e-36f), inverse_d = 1 / std::sqrt(d2);
      if (-dot(spot.axis(), v) * inverse_d < spot.cos_cutoff() - kCosineSlack) return 0;
      if (both_sides) return std::min(e.strength / d2, kLargestImportance);
      const float h = dot(front, v);
      if (!(h > 0)) return 0;
      return std::min(e.strength * std::max(h * inverse_d, kLeastCosine) / d2, kLargestImportance);
    }
    case Kind::rectangle:
      if (!rectangles_[e.index].reaches(p)) return 0;
      break;
    case Kind::disk:
      if (!disks_[e.index].reaches(p)) return 0;
      break;
    case Kind::cylinder:
      if (!cylinders_[e.index].reaches(p)) return 0;
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
  if (e.kind != Kind::sphere && e.kind != Kind::cylinder) {
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

float LightSampler::share(float even, float importance, float sum, std::uint32_t positive_count) {
  if (!(importance > 0)) return 0;
  return (1 - even) * (importance / sum) + even / static_cast<float>(positive_count);
}

bool LightSampler::select(Vec3 p, Vec3 front, double u, Choice& choice) const {
  if (emitters_.size() == 1) {
    choice = {0, 1.0f, u};
    return true;
  }
  if (!by_importance()) return select_by_tree(p, front, u, choice);
  std::array<float, kImportanceEmitters> values;
  std::uint32_t positive_count = 0;
  const float sum = importances(p, front, values.data(), positive_count);
  if (positive_count == 0) return false;
  double cumulative = 0;
  bool found = false;
  for (std::size_t i = 0; i < emitters_.size(); ++i) {
    const float q = share(kEvenShare, values[i], sum, positive_count);
    if (!(q > 0)) continue;
    choice.emitter = static_cast<std::uint32_t>(i);
    choice.prob = q;
    found = true;
    choice.rest = std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53);
    cumulative += static_cast<double>(q);
    if (u < cumulative) break;
  }
  return found;
}

// The tree is one candidate beside the infinite emitters.
bool LightSampler::select_by_tree(Vec3 p, Vec3 front, double u, Choice& choice) const {
  if (tree_.empty() && infinite_.empty()) {
    if (!(powers_.total() > 0)) return false;
    choice.emitter = powers_.sample(u, &choice.rest);
    choice.prob = prob_emission(choice.emitter);
    return true;
  }
  if (infinite_.empty()) return tree_.sample(p, front, u, choice.emitter, choice.prob, choice.rest);
  const float tree = tree_.importance(p, front);
  float sum = tree;
  std::uint32_t positive_count = tree > 0 ? 1 : 0;
  for (const std::uint32_t i : infinite_) {
    const float value = importance(emitters_[i], p, front);
    sum += value;
    positive_count += value > 0 ? 1u : 0u;
  }
  if (positive_count == 0) return false;
  double cumulative = 0;
  bool found = false;
  for (const std::uint32_t i : infinite_) {
    const float q = share(kEvenShareBesideTree, importance(emitters_[i], p, front), sum, positive_count);
    if (!(q > 0)) continue;
    choice = {i, q, std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53)};
    found = true;
    cumulative += static_cast<double>(q);
    if (u < cumulative) return true;
  }
  const float q = share(kEvenShareBesideTree, tree, sum, positive_count);
  if (!(q > 0)) return found;  // rounding left a sliver beyond the last
  const double left = std::clamp((u - cumulative) / static_cast<double>(q), 0.0, 1.0 - 0x1p-53);
  if (!tree_.sample(p, front, left, choice.emitter, choice.prob, choice.rest)) return false;
  choice.prob *= q;
  return choice.prob > 0;
}

float LightSampler::prob_by_tree(Vec3 p, Vec3 front, std::uint32_t emitter) const {
  if (tree_.empty() && infinite_.empty()) return prob_emission(emitter);
  if (infinite_.empty()) return tree_.prob(p, front, emitter);
  const float tree = tree_.importance(p, front);
  float sum = tree;
  std::uint32_t positive_count = tree > 0 ? 1 : 0;
  for (const std::uint32_t i : infinite_) {
    const float value = importance(emitters_[i], p, front);
    sum += value;
    positive_count += value > 0 ? 1u : 0u;
  }
  const Emitter& e = emitters_[emitter];
  if (infinite(e)) return share(kEvenShareBesideTree, importance(e, p, front), sum, positive_count);
  const float q = share(kEvenShareBesideTree, tree, sum, positive_count);
  return q > 0 ? q * tree_.prob(p, front, emitter) : 0.0f;
}

float LightSampler::prob(Vec3 p, Vec3 front, std::uint32_t emitter) const {
  if (emitters_.size() == 1) return 1;
  if (!by_importance()) return prob_by_tree(p, front, emitter);
  std::array<float, kImportanceEmitters> values;
  std::uint32_t positive_count = 0;
  const float sum = importances(p, front, values.data(), positive_count);
  return share(kEvenShare, values[emitter], sum, positive_count);
}

bool LightSampler::sample(const SurfaceHit& reference, Vec3 front, float u_select, Vec2 u,
                          DirectSample& out) const {
  if (emitters_.empty()) return false;
  Choice choice{0, 1.0f, 0.0};
  if ((emitters_.size() > 1 || emitters_[0].kind == Kind::mesh) &&
      !select(reference.p, front, extend_draw(u_select, u.x, u.y), choice)) {
    return false;
  }
  const float prob = choice.prob;
  out.emitter = choice.emitter;
  const Emitter& e = emitters_[out.emitter];
  const bool both_sides = is_zero(front);
  out.delta = false;
  out.infinite = false;
  LightPoint point;
  switch (e.kind) {
    case Kind::point:
    case Kind::spot: {
      const Vec3 v = e.vector - reference.p;
      const float d2 = length_squared(v);
      if (!(d2 > 0)) return false;
      out.wi = v / std::sqrt(d2);
      out.p = e.vector;
      out.ng = {};
      out.radiance = (e.kind == Kind::point ? e.radiance.constant : spots_[e.index].intensity(-out.wi)) / d2;
      out.pdf_solid_angle = prob;
      out.delta = true;
      if (!both_sides && !(dot(front, out.wi) > 0)) return false;
      out.shadow_ray = spawn_shadow_ray(reference, e.vector, {0, 0, 0}, 0);
      return !out.radiance.is_black();
    }
    case Kind::directional:
      out.infinite = true;
      out.ng = {};
      out.wi = -e.vector;
      out.radiance = e.radiance.constant;
      out.pdf_solid_angle = prob;
      out.delta = true;
      if (!both_sides && !(dot(front, out.wi) > 0)) return false;
      out.shadow_ray = spawn_ray(reference, out.wi);
      return !out.radiance.is_black();
    case Kind::environment: {
      out.infinite = true;
      out.ng = {};
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
      break;
    case Kind::disk:
      if (!disks_[e.index].sample(reference.p, u, point)) return false;
      break;
    case Kind::cylinder:
      if (!cylinders_[e.index].sample(reference.p, u, point)) return false;
      break;
    case Kind::mesh:
      if (!meshes_[e.index].sample(reference.p, choice.rest, u, point)) return false;
      break;
  }
  if (!both_sides && !(dot(front, point.wi) > 0)) return false;
  if (!e.radiance.is_constant()) find_uv(e, point);
  out.wi = point.wi;
  out.p = point.p;
  out.ng = point.ng;
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
    case Kind::disk:
      pdf = disks_[e.index].pdf_solid_angle(reference.p, hit.p);
      break;
    case Kind::cylinder:
      pdf = cylinders_[e.index].pdf_solid_angle(reference.p, hit);
      break;
    case Kind::mesh:
      pdf = meshes_[e.index].pdf_solid_angle(reference.p, hit);
      break;
    case Kind::point:
    case Kind::spot:
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
