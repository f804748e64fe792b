// Ray intersection by Embree, hidden behind this.
#pragma once

#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/description/reading_budget.h"
#include "worker/core/vec.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

// An error if this machine lacks the instruction set, or nobody knows it.
Result<void> check_isa(const std::string& isa);

class Accel {
 public:
  // Builds over `geometry`, which must outlive this; its positions and indices must not change. isa: "sse2",
  // "sse4.2", "avx", "avx2" or "avx512"; one that this machine or this Embree lacks is an error, never
  // replaced by another. Embree's memory counts in the budget.
  static Result<Accel> build(const Geometry& geometry, const std::string& isa, unsigned threads,
                             description::ReadingBudget& budget = description::ReadingBudget::unlimited());
  Accel(Accel&&) noexcept;
  Accel& operator=(Accel&&) noexcept;
  ~Accel();

  struct Found {
    std::uint32_t primitive;  // in Geometry's array of its kind
    PrimitiveKind kind;
    std::uint32_t instance;  // kNone: the scene's own
  };
  // The nearest primitive in (0, ray.t_max]. A ray that is not finite, or begins beyond 1.8e18,
  // meets nothing.
  bool intersect(const Ray& ray, Found& found) const;
  bool occluded(const Ray& ray) const;
  // See Scene.
  float clearance(Vec3 p, float limit) const;

  // The RTCScene, for measurements; null if few_primitives.h finds all. Round primitives that it finds beside
  // meshes are not in the RTCScene.
  void* embree_scene() const;

 private:
  struct Impl;
  bool intersect_few(const Ray& ray, Found& found) const;
  explicit Accel(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace candela::scene
