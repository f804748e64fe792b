// The sectors that photons are in (common/adaptive/channels.h), around an eye's vertex: on surfaces in the
// plane across the geometric normal, in media along the axes of the world.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/adaptive/channels.h"
#include "worker/core/vec.h"
#include "worker/transport/merge_scale.h"
#include "worker/transport/statistics/photon_batch.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

class Sectors {
 public:
  static constexpr std::size_t kCount = adaptive::kSectorChannels;
  using Channels = std::array<std::int32_t, PhotonBatch::kMax>;

  void start(const ScatterPoint& v, const MergeScale& scale) {
    surface_ = v.on_surface();
    radius_ = surface_ ? scale.disc_radius : scale.ball_radius;
    if (surface_) frame_ = make_frame(v.hit.ng);
  }
  void find(const PhotonBatch& photons, Channels& channels) const {
    if (!surface_) {
      for (std::size_t i = 0; i < photons.count; ++i)
        channels[i] =
            adaptive::ball_channel(static_cast<double>(photons.x[i]), static_cast<double>(photons.y[i]),
                                   static_cast<double>(photons.z[i]), static_cast<double>(radius_));
      return;
    }
    const Vec3 s = frame_.s, t = frame_.t;
    const float radius_squared = radius_ * radius_;
    for (std::size_t i = 0; i < photons.count; ++i) {
      const float u = photons.x[i] * s.x + photons.y[i] * s.y + photons.z[i] * s.z;
      const float v = photons.x[i] * t.x + photons.y[i] * t.y + photons.z[i] * t.z;
      channels[i] = adaptive::disc_channel_of(u, v, radius_squared);
    }
  }

 private:
  bool surface_ = true;
  float radius_ = 0;
  Frame frame_;
};

}  // namespace candela::transport
