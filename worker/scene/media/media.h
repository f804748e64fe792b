// All media of a scene, and where they meet.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/hit.h"
#include "worker/scene/media/medium.h"

namespace candela::scene {

// Media on both sides of a surface; kNone: nothing that scatters or absorbs.
struct MediumInterface {
  std::uint32_t interior = kNone, exterior = kNone;  // behind and before the geometric normal
};

class Media {
 public:
  const Medium& operator[](std::uint32_t medium) const { return media_[medium]; }
  std::size_t size() const { return media_.size(); }
  void edit(std::uint32_t medium, std::shared_ptr<const SurfaceEdits> edits) {
    media_[medium].edit(std::move(edits));
  }
  // Their objects with their indices.
  const std::map<description::ObjectPtr, std::uint32_t>& known() const { return known_; }

  // The medium that a ray enters that leaves `hit` in direction d, having arrived through `current`.
  std::uint32_t beyond(const SurfaceHit& hit, Vec3 d, std::uint32_t current) const {
    if (hit.medium_interface == kNone) return current;
    const MediumInterface& sides = interfaces_[hit.medium_interface];
    return dot(d, hit.ng) > 0 ? sides.exterior : sides.interior;
  }

  // Behind the surface, and before it; kNone too where there is no interface.
  std::uint32_t interior(std::uint32_t medium_interface) const {
    return medium_interface == kNone ? kNone : interfaces_[medium_interface].interior;
  }
  std::uint32_t exterior(std::uint32_t medium_interface) const {
    return medium_interface == kNone ? kNone : interfaces_[medium_interface].exterior;
  }

  // The index of a medium; one object is built once, however often it is referred to.
  Result<std::uint32_t> add(const description::ObjectPtr& medium, const description::FileSource& files);
  // Adds the children `interior` and `exterior` of a shape; kNone if it has neither.
  Result<std::uint32_t> add_interface(const description::Object& shape, const description::FileSource& files);

 private:
  std::vector<Medium> media_;
  std::vector<MediumInterface> interfaces_;
  std::map<description::ObjectPtr, std::uint32_t> known_;
};

}  // namespace candela::scene
