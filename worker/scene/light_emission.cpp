// Emission: where light paths start. Emitters are chosen by power, positions uniformly in area, directions in
// proportion to the cosine (surfaces), uniformly (points, cones of spots) or to the environment's radiance;
// light from outside starts on a disk across its direction that covers the scene's bounding sphere
// [Veach 1997, Sec. 4.6 and 8.3].
#include <algorithm>
#include <cmath>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/light_sampler.h"

namespace candela::scene {
namespace {

constexpr float kPi = math::kPi;

// Light too strong for a float starts all the same: what it brings is rejected and counted, not lost
// silently.
bool is_usable(const EmissionSample& s) {
  return s.weight.max_component() > 0;
}

}  // namespace

double LightSampler::area(const Emitter& e) const {
  switch (e.kind) {
    case Kind::rectangle:
      return rectangles_[e.index].area();
    case Kind::sphere:
      return spheres_[e.index].area();
    case Kind::disk:
      return disks_[e.index].area();
    case Kind::cylinder:
      return cylinders_[e.index].area();
    case Kind::mesh:
      return meshes_[e.index].area();
    case Kind::point:
    case Kind::spot:
    case Kind::directional:
    case Kind::environment:
      break;
  }
  return 0;
}

void LightSampler::find_uv(const Emitter& e, LightPoint& point) const {
  const ShapeRecord& record = geometry_->shapes[e.shape];
  if (e.kind == Kind::sphere) {
    const Sphere& s = geometry_->spheres[record.sphere].sphere;
    const Vec3d n(point.ng);
    point.uv = sphere_uv(s, s.inside_out ? -n : n);
  } else if (e.kind == Kind::disk) {
    point.uv = disk_uv(geometry_->disks[record.disk].disk, Vec3d(point.p));
  } else if (e.kind == Kind::cylinder) {
    point.uv = cylinder_uv(geometry_->cylinders[record.cylinder].cylinder, Vec3d(point.p));
  }
}

void LightSampler::sample_area(const Emitter& e, double u_triangle, Vec2 u, LightPoint& out) const {
  switch (e.kind) {
    case Kind::rectangle:
      rectangles_[e.index].sample_area(u, out);
      break;
    case Kind::sphere:
      spheres_[e.index].sample_area(u, out);
      break;
    case Kind::disk:
      disks_[e.index].sample_area(u, out);
      break;
    case Kind::cylinder:
      cylinders_[e.index].sample_area(u, out);
      break;
    case Kind::mesh:
      meshes_[e.index].sample_area(u_triangle, u, out);
      break;
    case Kind::point:
    case Kind::spot:
    case Kind::directional:
    case Kind::environment:
      return;
  }
  if (!e.radiance.is_constant()) find_uv(e, out);
}

// Of a texture: the mean over a grid on the surface, triangles in turn by multiples of the golden ratio.
Spectrum LightSampler::mean_radiance(const Emitter& e) const {
  if (e.radiance.is_constant()) return e.radiance.constant;
  constexpr std::uint32_t kSteps = 64;
  double sum[3] = {};
  for (std::uint32_t i = 0; i < kSteps * kSteps; ++i) {
    const Vec2 u{(static_cast<float>(i % kSteps) + 0.5f) / kSteps,
                 (static_cast<float>(i / kSteps) + 0.5f) / kSteps};
    const double turn = 0.6180339887498949 * (i + 0.5);
    LightPoint point;
    sample_area(e, turn - std::floor(turn), u, point);
    const Spectrum radiance = e.radiance.eval(point.uv);
    sum[0] += static_cast<double>(radiance.r);
    sum[1] += static_cast<double>(radiance.g);
    sum[2] += static_cast<double>(radiance.b);
  }
  constexpr double kEach = 1.0 / (kSteps * kSteps);
  return {static_cast<float>(sum[0] * kEach), static_cast<float>(sum[1] * kEach),
          static_cast<float>(sum[2] * kEach)};
}

Spectrum LightSampler::power(std::uint32_t emitter) const {
  const Emitter& e = emitters_[emitter];
  const auto disk = static_cast<float>(static_cast<double>(kPi) * radius_ * radius_);
  switch (e.kind) {
    case Kind::point:
      return e.radiance.constant * (4 * kPi);
    case Kind::spot:
      return spots_[e.index].power();
    case Kind::directional:
      return e.radiance.constant * disk;
    case Kind::environment:
      return environments_[e.index].mean_radiance() * (4 * kPi) * disk;
    case Kind::rectangle:
    case Kind::sphere:
    case Kind::disk:
    case Kind::cylinder:
    case Kind::mesh:
      break;
  }
  return mean_radiance(e) * static_cast<float>(static_cast<double>(kPi) * area(e));
}

float LightSampler::prob_emission(std::uint32_t emitter) const {
  return powers_.total() > 0 ? static_cast<float>(powers_.probability(emitter)) : 0.0f;
}

float LightSampler::prob_emission_environments() const {
  float sum = 0;
  for (const std::uint32_t i : environment_emitters_) sum += prob_emission(i);
  return sum;
}

bool LightSampler::pdf_emission_environment(Vec3 to_light, EmissionDensity& out) const {
  out = {};
  double joint = 0;
  for (std::size_t i = 0; i < environments_.size(); ++i) {
    joint += static_cast<double>(prob_emission(environment_emitters_[i])) *
             static_cast<double>(environments_[i].pdf_solid_angle(to_light));
  }
  if (!(joint > 0)) return false;
  out.prob = prob_emission_environments();
  out.pdf_solid_angle = static_cast<float>(joint / static_cast<double>(out.prob));
  out.pdf_area = static_cast<float>(1 / (static_cast<double>(kPi) * radius_ * radius_));
  out.cosine = 1;
  out.infinite = true;
  return true;
}

bool LightSampler::pdf_emission(const SurfaceHit& hit, Vec3 d, EmissionDensity& out) const {
  out = {};
  if (hit.emitter == kNone) return false;
  out.cosine = dot(d, hit.ng);
  out.prob = prob_emission(hit.emitter);
  if (!(out.cosine > 0) || !(out.prob > 0)) return false;
  out.pdf_area = static_cast<float>(1 / area(emitters_[hit.emitter]));
  out.pdf_solid_angle = warp::pdf_cosine_hemisphere_solid_angle(out.cosine);
  return true;
}

bool LightSampler::pdf_emission(const DirectSample& light, EmissionDensity& out) const {
  const Emitter& e = emitters_[light.emitter];
  if (e.kind == Kind::environment) return pdf_emission_environment(light.wi, out);
  if (e.shape != kNone) {
    SurfaceHit hit;
    hit.ng = light.ng;
    hit.emitter = light.emitter;
    return pdf_emission(hit, -light.wi, out);
  }
  out = {};
  out.prob = prob_emission(light.emitter);
  out.cosine = 1;
  if (e.kind == Kind::directional) {
    out.infinite = out.delta_direction = true;
    out.pdf_area = static_cast<float>(1 / (static_cast<double>(kPi) * radius_ * radius_));
    out.pdf_solid_angle = 1;
  } else {
    out.delta_position = true;
    out.pdf_area = 1;
    out.pdf_solid_angle = e.kind == Kind::point ? warp::kPdfUniformSphereSolidAngle
                                                : spots_[e.index].pdf_solid_angle(-light.wi);
  }
  return out.prob > 0 && out.pdf_solid_angle > 0;
}

bool LightSampler::sample_emission(float u_select, Vec2 u_position, Vec2 u_direction,
                                   EmissionSample& out) const {
  if (emitters_.empty() || !(powers_.total() > 0)) return false;
  double rest = 0;
  const std::uint32_t emitter = powers_.sample(extend_draw(u_select, u_position.x, u_position.y), &rest);
  const Emitter& e = emitters_[emitter];
  static_cast<EmissionDensity&>(out) = {};
  out.prob = prob_emission(emitter);
  out.vertex = {};
  out.vertex.emitter = emitter;
  out.cosine = 1;
  if (!(out.prob > 0)) return false;

  if (infinite(e)) {
    Vec3 d = e.vector;
    if (e.kind == Kind::directional) {
      out.radiance = e.radiance.constant;
      out.infinite = out.delta_direction = true;
      out.pdf_solid_angle = 1;
      out.pdf_area = static_cast<float>(1 / (static_cast<double>(kPi) * radius_ * radius_));
    } else {
      Vec3 to_light;
      float pdf = 0;
      if (!environments_[e.index].sample(u_direction, to_light, out.radiance, pdf) || !(pdf > 0))
        return false;
      // Light of all environments comes along this ray, whichever of them proposed it.
      if (environments_.size() > 1) out.radiance = environment(to_light);
      if (!pdf_emission_environment(to_light, out)) return false;
      d = -to_light;
    }
    const Frame frame = make_frame(d);
    const Vec2 disk = warp::concentric_disk(u_position);
    const Vec3d across =
        Vec3d(frame.s) * static_cast<double>(disk.x) + Vec3d(frame.t) * static_cast<double>(disk.y);
    out.vertex.p = Vec3(center_ + (across - Vec3d(d)) * radius_);
    out.vertex.ng = d;
    out.vertex.shading = frame;
    out.ray = {out.vertex.p, d};
  } else if (e.shape == kNone) {
    out.delta_position = true;
    out.pdf_area = 1;
    Vec3 d;
    if (e.kind == Kind::point) {
      d = normalize(warp::uniform_sphere(u_direction));
      out.radiance = e.radiance.constant;
      out.pdf_solid_angle = warp::kPdfUniformSphereSolidAngle;
    } else {
      d = spots_[e.index].sample(u_direction);
      out.radiance = spots_[e.index].intensity(d);
      out.pdf_solid_angle = spots_[e.index].pdf_solid_angle(d);
      if (!(out.pdf_solid_angle > 0)) return false;  // on the rim, by rounding
    }
    out.vertex.p = e.vector;
    out.vertex.ng = d;
    out.vertex.shading = make_frame(d);
    out.ray = {out.vertex.p, d};
  } else {
    LightPoint point;
    sample_area(e, rest, u_position, point);
    out.vertex.p = point.p;
    out.vertex.ng = point.ng;
    out.vertex.shading = make_frame(point.ng);
    out.vertex.uv = point.uv;
    out.vertex.error = point.error;
    out.vertex.shape = e.shape;
    out.vertex.bsdf = geometry_->shapes[e.shape].bsdf;
    const Vec3 d = normalize(out.vertex.shading.to_world(warp::cosine_hemisphere(u_direction)));
    out.radiance = e.radiance.eval(point.uv);
    out.cosine = dot(d, point.ng);
    if (!(out.cosine > 0)) return false;
    out.pdf_area = static_cast<float>(1 / area(e));
    out.pdf_solid_angle = warp::pdf_cosine_hemisphere_solid_angle(out.cosine);
    out.ray = spawn_ray(out.vertex, d);
  }
  // In double: an area of 1e-30 and a probability of 1e-9 leave the range of floats.
  const double density = static_cast<double>(out.prob) * static_cast<double>(out.pdf_area) *
                         static_cast<double>(out.pdf_solid_angle);
  const double factor = static_cast<double>(out.cosine) / density;
  out.weight = {static_cast<float>(static_cast<double>(out.radiance.r) * factor),
                static_cast<float>(static_cast<double>(out.radiance.g) * factor),
                static_cast<float>(static_cast<double>(out.radiance.b) * factor)};
  return is_usable(out);
}

}  // namespace candela::scene
