// Participating media: what lies between surfaces, absorbs and scatters.
//
// sigma_t: extinction per scene unit, per channel; sigma_s = albedo sigma_t scatters. Where sigma_t is
// constant the medium is homogeneous and everything has a closed form; where it is a grid, free flights are
// found by delta tracking and transmittances estimated by residual ratio tracking, both through a coarse grid
// of bounds (tracking.h). The albedo may vary in either.
//
// A flight's random numbers come from one pair of primary samples u: a closed form reads them, tracking,
// which needs a number of draws nobody knows in advance, keys a stream with them.
#pragma once

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/rng/stream.h"
#include "worker/core/vec.h"
#include "worker/scene/media/phase.h"
#include "worker/scene/media/tracking.h"
#include "worker/scene/media/volume.h"

namespace candela::scene {

struct SurfaceEdits;  // bsdfs/edited.h

// Distance that light, or a walk, gets along a ray before it interacts.
struct DistanceSample {
  bool scattered = false;
  float distance = 0;  // where scattered, up to the ray's t_max
  // To multiply the throughput with. scattered: sigma_s T(distance) / pdf_distance; else T(t_max) /
  // P(passing).
  Spectrum weight;
};

class Medium {
 public:
  Medium(Volume sigma_t, float scale, Volume albedo, Phase phase);

  const Phase& phase() const { return phase_; }
  // Edits of what it scatters; null: none. Edits that select by more of the path than the vertex are not
  // here (bsdfs/path_edited.h).
  const SurfaceEdits* edits() const { return edits_.get(); }
  void edit(std::shared_ptr<const SurfaceEdits> edits) { edits_ = std::move(edits); }
  bool homogeneous() const { return tracking_ == nullptr; }
  // Homogeneous, with the same sigma_t in all channels.
  bool gray() const { return gray_; }

  // Along the ray up to its t_max, where the medium ends or a surface is. channels: how much each color
  // counts in the choice of the distance, not negative. With the walk's throughput so far, the sum over
  // channels of throughput times weight never exceeds the sum of the throughput, however strongly colored
  // the medium is; a walk whose densities must not depend on its past passes (1, 1, 1).
  // steps: see Tracking::collide; homogeneous media have none.
  DistanceSample sample_distance(const Ray& ray, Spectrum channels, Vec2 u,
                                 std::vector<FlightStep>* steps = nullptr) const;
  // Homogeneous media only: the density per length with which sample_distance stops at `distance`, and the
  // probability with which it passes `distance`, in their closed forms.
  float pdf_distance(float distance, Spectrum channels) const;
  float prob_pass(float distance, Spectrum channels) const;

  // A stretch of a homogeneous medium, for callers that ask for more than one of these.
  class Stretch {
   public:
    Stretch(const Medium& medium, float length);
    Spectrum transmittance() const;
    float prob_pass(Spectrum channels) const;

   private:
    std::array<double, 3> passes_;  // by channel
    bool gray_;
  };

  // Transmittance of the ray up to its t_max: exact if homogeneous, else an unbiased estimate in [0, 1].
  Spectrum transmittance(const Ray& ray, rng::Stream& stream) const;

  Spectrum sigma_t(Vec3 p) const;
  // The same, and 0 outside of a grid, where no flight ends. For places of a ray that no flight chose.
  Spectrum sigma_t_inside(Vec3 p) const;
  // See Tracking; t_max in homogeneous media.
  float distance_to_end(const Ray& ray, double margin) const {
    return tracking_ == nullptr ? ray.t_max : tracking_->distance_to_end(ray, margin);
  }
  Spectrum albedo(Vec3 p) const { return albedo_.eval(Vec3d(p)); }
  Spectrum max_sigma_t() const { return max_sigma_t_; }
  Spectrum max_albedo() const { return max_albedo_; }

 private:
  DistanceSample sample_homogeneous(float t_max, Spectrum channels, Vec2 u, const Ray& ray) const;

  Spectrum sigma_t_;  // homogeneous
  Spectrum max_sigma_t_, max_albedo_;
  Volume albedo_;
  Phase phase_;
  std::shared_ptr<const Tracking> tracking_;  // null: homogeneous
  std::shared_ptr<const SurfaceEdits> edits_;
  bool gray_ = false;
};

// The phase function inside of a medium or a bsdf; isotropic if there is none.
Result<Phase> build_phase(const description::Object& owner);

// From a description object "homogeneous" or "heterogeneous". Errors name file, line and parameter.
Result<Medium> build_medium(const description::Object& object, const description::FileSource& files);

}  // namespace candela::scene
