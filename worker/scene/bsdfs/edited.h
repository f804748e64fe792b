// A bsdf whose light is turned by edits [docs/edits.md; Kaplanyan 2017, section 9.2]. It is no plugin: the
// scene puts it around the bsdfs of surfaces that an edit selects.
//
// An edit of light moves what the surface scatters: light that leaves along w in the edit's cone leaves along
// M(w) instead. Seen from o, that is a sum over branches, the directions w that light may have been meant
// for: R(o), if it lies in the cone, and o itself, if o does not,
//   f'(i -> o) = sum_b f(i -> w_b) Gamma_b,   Gamma_b = |w_b.g| / |o.g| J_b,   g: the geometric normal.
// An edit of the eye does the same to i. A walk in the edit's own direction draws w by the bsdf and turns it.
// A walk against it draws one of the n branches of the direction it came along, with probability 1 / n.
//
// Closures leave shading normals to their callers (shading_correction() of transport/vertex.h): of two
// branches the correction differs, and its quotient belongs to the factor.
//
// Light that a map would push through the plane of either normal is lost, in all directions of walks alike.
//
// In a medium, and at lamps that are points, there is no normal: Gamma_b = J_b, and no light is lost.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/delta_lobes.h"
#include "worker/scene/bsdfs/surface.h"
#include "worker/scene/edits/direction_map.h"
#include "worker/scene/edits/first_surface.h"
#include "worker/scene/hit.h"
#include "worker/scene/media/phase.h"

namespace candela::scene {

class Bsdf;

// The edits of a scene.
struct SceneEdits {
  struct One {
    bool of_light = true;
    DirectionMap map;
    Cone cone;
    Spectrum factor = Spectrum(1);
    bool hit = false;  // the first surface has to lie in the cone's region
  };
  std::vector<One> edits;     // in the order in which they act
  std::vector<Cone> regions;  // by their bits in expressions
  float glossy_below = 0.3f;
  Vec3d offset;  // a point of the scene and this vector make the point in the file's coordinates
  const FirstSurface* first_surface = nullptr;  // set before the first question if an edit has `hit`

  std::uint32_t regions_at(Vec3d p) const;  // in the file's coordinates
};

// Edits that one surface has, of each kind of scattering; or one medium, of all kinds the same.
struct SurfaceEdits {
  static constexpr std::size_t kMax = 4;  // of light, and as many of the eye
  // Bit k: edit k of the list takes part.
  struct Treatment {
    std::uint16_t of_light = 0, of_eye = 0;
    bool operator==(const Treatment&) const = default;
  };
  enum Lobe : std::uint8_t { diffuse, glossy, delta };
  // [lobe][transmitted]
  using Treatments = std::array<std::array<Treatment, 2>, 3>;

  const SceneEdits* scene = nullptr;
  std::vector<Treatments> by_regions;  // one, or one for each set of regions
};

struct EditedClosure {
  const Closure* nested;
  const SceneEdits* edits;
  const SurfaceEdits::Treatments* treatments;
  Frame shading;
  Vec3 p, ng;       // ng in the shading frame; zero: there is no surface
  float error = 0;  // SurfaceHit::error

  bool on_surface() const { return !(ng == Vec3{}); }
  ClosureTraits traits() const;
};
Spectrum eval_pdf(const EditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf);
Spectrum eval_diffuse(const EditedClosure& e, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below);
bool sample(const EditedClosure& e, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out);
Spectrum passthrough(const EditedClosure& e, Vec3 wo);
void delta_choices(const EditedClosure& e, Vec3 wo, TransportMode mode, LobeRange range, LobeChoices& out);

// Makes the closure of a place in a medium, a part of it in the arena. False: nothing is edited there.
bool edited_phase(const SurfaceEdits& edits, const Phase& phase, Vec3 p, ClosureArena& arena, Closure& out);

struct EditedSurface {
  using ClosureType = EditedClosure;
  static constexpr std::array<std::string_view, 0> kPlugins = {};

  // By index: other surfaces have the same bsdf without edits, or with others.
  const std::vector<Bsdf>* bsdfs = nullptr;
  std::uint32_t nested = 0;
  std::unique_ptr<SurfaceEdits> edits;

  Result<void> build(const description::Object& object, const BuildContext& context);  // never called
  void prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const;
  BsdfFacts facts() const;
  std::uint32_t arena_parts() const;
  const Bsdf& part() const;
  template <class Visitor>
  void for_each_part(const Visitor& visit) const {
    visit(part());
  }
};

}  // namespace candela::scene
