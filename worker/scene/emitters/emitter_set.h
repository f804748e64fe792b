// All emitters of a scene, by index: one closed set of kinds. Each kind is an object with the whole
// interface,
//   sample_direct, pdf_direct_solid_angle   light as seen from a point, given that this emitter was chosen
//   sample_emission, pdf_emission           light as it leaves; `prob` of its choice is filled in by the
//   caller power, importance, bounds (unless kInfinite), emitted and min_power (surfaces)
// and this is the only place that knows which kinds there are.
//
// To add one: write emitters/<kind>.{h,cpp}, which builds itself (emitter_build.h), add it to the list below,
// and its parameters to the vocabulary (common/description/rules_emitters.cpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "worker/scene/emitters/cylinder.h"
#include "worker/scene/emitters/directional.h"
#include "worker/scene/emitters/disk.h"
#include "worker/scene/emitters/edited_light.h"
#include "worker/scene/emitters/environment.h"
#include "worker/scene/emitters/goniometric.h"
#include "worker/scene/emitters/mesh.h"
#include "worker/scene/emitters/point.h"
#include "worker/scene/emitters/projector.h"
#include "worker/scene/emitters/rectangle.h"
#include "worker/scene/emitters/sphere.h"
#include "worker/scene/emitters/spot.h"

namespace candela::scene {

using Emitter =
    std::variant<RectangleLight, SphereLight, DiskLight, CylinderLight, MeshLight, PointLight, SpotLight,
                 ProjectorLight, GoniometricLight, DirectionalLight, Environment, EditedLight>;

inline constexpr std::size_t kEmitterKinds = std::variant_size_v<Emitter>;

template <class Visitor>
using EmitterVisit = std::invoke_result_t<Visitor&, const std::variant_alternative_t<0, Emitter>&>;

template <std::size_t kRow, class Visitor>
[[gnu::always_inline]] inline EmitterVisit<Visitor> visit_row(const Emitter& emitter, Visitor& visitor) {
  if constexpr (kRow < kEmitterKinds)
    return visitor(*std::get_if<kRow>(&emitter));
  else
    __builtin_unreachable();
}

// As std::visit, which beyond 11 kinds is a table of functions: nothing of them would be inlined.
template <class Visitor>
[[gnu::always_inline]] inline EmitterVisit<Visitor> visit_emitter(const Emitter& emitter, Visitor&& visitor) {
  static_assert(kEmitterKinds <= 16, "the switch has a row for each kind");
  switch (emitter.index()) {
    case 0:
      return visit_row<0>(emitter, visitor);
    case 1:
      return visit_row<1>(emitter, visitor);
    case 2:
      return visit_row<2>(emitter, visitor);
    case 3:
      return visit_row<3>(emitter, visitor);
    case 4:
      return visit_row<4>(emitter, visitor);
    case 5:
      return visit_row<5>(emitter, visitor);
    case 6:
      return visit_row<6>(emitter, visitor);
    case 7:
      return visit_row<7>(emitter, visitor);
    case 8:
      return visit_row<8>(emitter, visitor);
    case 9:
      return visit_row<9>(emitter, visitor);
    case 10:
      return visit_row<10>(emitter, visitor);
    case 11:
      return visit_row<11>(emitter, visitor);
    case 12:
      return visit_row<12>(emitter, visitor);
    case 13:
      return visit_row<13>(emitter, visitor);
    case 14:
      return visit_row<14>(emitter, visitor);
    case 15:
      return visit_row<15>(emitter, visitor);
  }
  __builtin_unreachable();
}

// An emitter of a scene file that is no surface; nothing: it is black.
Result<std::optional<Emitter>> build_emitter(const description::Object& object, TextureStore& textures);

// The emitter of a shape that is in the geometry already; rectangle: as build_shape gave it, null otherwise.
Emitter make_area_light(const Geometry& geometry, std::uint32_t shape, const Rectangle* rectangle,
                        const ColorTexture& radiance);

// The emitter, which is not infinite, with the edits in `bits`; scene_size: the largest coordinate.
Emitter edited_light(Emitter light, const SceneEdits& edits, std::uint16_t bits, double scene_size);

class EmitterSet {
  template <class Visitor>
  decltype(auto) visit(std::uint32_t i, Visitor&& visitor) const {
    return visit_emitter(emitters_[i], std::forward<Visitor>(visitor));
  }

 public:
  std::uint32_t add(Emitter emitter);
  // See edited_light().
  void edit(std::uint32_t i, const SceneEdits& edits, std::uint16_t bits, double scene_size) {
    emitters_[i] = edited_light(std::move(emitters_[i]), edits, bits, scene_size);
  }

  std::size_t size() const { return emitters_.size(); }
  bool empty() const { return emitters_.empty(); }
  // Indices of the environments. Their light arrives together, whichever of them proposed a direction.
  const std::vector<std::uint32_t>& environments() const { return environments_; }
  const Environment& environment(std::uint32_t i) const { return *std::get_if<Environment>(&emitters_[i]); }
  bool is_environment(std::uint32_t i) const { return std::holds_alternative<Environment>(emitters_[i]); }

  bool infinite(std::uint32_t i) const {
    return visit(i, [](const auto& e) { return e.kInfinite; });
  }
  bool reads_rest(std::uint32_t i) const {
    return visit(i, [](const auto& e) {
      if constexpr (requires { e.reads_rest(); })
        return e.reads_rest();
      else
        return e.kReadsRest;
    });
  }

  DirectOutcome sample_direct(std::uint32_t i, const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const {
    return visit(i, [&](const auto& e) { return e.sample_direct(reference, front, rest, u, out); });
  }
  // The density of the direction d to `hit`; 0 for emitters that no ray meets.
  float pdf_direct_solid_angle(std::uint32_t i, Vec3 reference, Vec3 d, const SurfaceHit& hit) const {
    return visit(i, [&](const auto& e) { return e.pdf_direct_solid_angle(reference, d, hit); });
  }

  // The same by a sampler of points; by the emitter's own where it has no other.
  DirectOutcome sample_direct_by(PointSampler sampler, std::uint32_t i, const SurfaceHit& reference,
                                 Vec3 front, double rest, Vec2 u, DirectSample& out) const {
    return visit(i, [&](const auto& e) {
      if constexpr (requires { e.sample_direct_by(sampler, reference, front, rest, u, out); })
        return e.sample_direct_by(sampler, reference, front, rest, u, out);
      else
        return e.sample_direct(reference, front, rest, u, out);
    });
  }
  float pdf_direct_by_solid_angle(PointSampler sampler, std::uint32_t i, Vec3 reference, Vec3 front, Vec3 d,
                                  const SurfaceHit& hit) const {
    return visit(i, [&](const auto& e) {
      if constexpr (requires { e.pdf_direct_by_solid_angle(sampler, reference, front, hit); })
        return e.pdf_direct_by_solid_angle(sampler, reference, front, hit);
      else
        return e.pdf_direct_solid_angle(reference, d, hit);
    });
  }

  bool sample_emission(std::uint32_t i, const SceneExtent& scene, double rest, Vec2 u_position,
                       Vec2 u_direction, EmissionSample& out) const {
    return visit(i,
                 [&](const auto& e) { return e.sample_emission(scene, rest, u_position, u_direction, out); });
  }
  // The densities of light leaving along d from a place p where the emitter's normal is ng.
  bool pdf_emission(std::uint32_t i, const SceneExtent& scene, Vec3 p, Vec3 ng, Vec3 d,
                    EmissionDensity& out) const {
    return visit(i, [&](const auto& e) {
      if constexpr (requires { e.pdf_emission_at(scene, p, ng, d, out); })
        return e.pdf_emission_at(scene, p, ng, d, out);
      else
        return e.pdf_emission(scene, ng, d, out);
    });
  }

  // Radiance of emitter hit.emitter from its surface at `hit` towards wo; black where it has no surface.
  Spectrum emitted(const SurfaceHit& hit, Vec3 wo) const {
    return visit(hit.emitter, [&](const auto& e) {
      if constexpr (requires { e.emitted(hit, wo); })
        return e.emitted(hit, wo);
      else
        return Spectrum();
    });
  }

  // W, towards the scene; analytic where radiance does not vary, by a fixed quadrature otherwise.
  Spectrum power(std::uint32_t i, const SceneExtent& scene) const {
    return visit(i, [&](const auto& e) { return e.power(scene); });
  }
  // W, luminance, as a choice by power weighs the emitter. Finite, not negative.
  double weight_of_power(std::uint32_t i, const SceneExtent& scene) const;
  // An estimate of the irradiance at p, unoccluded; zero only where the emitter can give none.
  float importance(std::uint32_t i, Vec3 p, Vec3 front) const {
    return visit(i, [&](const auto& e) { return e.importance(p, front); });
  }
  // Data for SurfaceLanes of an emitter that is a surface; nothing for another one.
  std::optional<SurfaceLane> lane(std::uint32_t i) const {
    return visit(i, [](const auto& e) -> std::optional<SurfaceLane> {
      if constexpr (requires { e.lane(); }) return e.lane();
      return std::nullopt;
    });
  }
  // True if a surface sends any light to p.
  bool reaches(std::uint32_t i, Vec3 p) const {
    return visit(i, [&](const auto& e) {
      if constexpr (requires { e.reaches(p); }) return e.reaches(p);
      return true;
    });
  }
  // Nothing for an emitter that is infinite. Leaves `power` to the caller.
  std::optional<LightBounds> bounds(std::uint32_t i, const Geometry& geometry) const;

 private:
  std::vector<Emitter> emitters_;
  std::vector<std::uint32_t> environments_;
};

}  // namespace candela::scene
