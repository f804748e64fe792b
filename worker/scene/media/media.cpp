#include "worker/scene/media/media.h"

#include <utility>

namespace candela::scene {

Result<std::uint32_t> Media::add(const description::ObjectPtr& medium, const description::FileSource& files) {
  if (const auto found = known_.find(medium); found != known_.end()) return found->second;
  CANDELA_ASSIGN(Medium built, build_medium(*medium, files));
  const auto index = static_cast<std::uint32_t>(media_.size());
  media_.push_back(std::move(built));
  known_[medium] = index;
  return index;
}

Result<std::uint32_t> Media::add_interface(const description::Object& shape,
                                           const description::FileSource& files) {
  MediumInterface sides;
  bool any = false;
  for (const description::Child& child : shape.children) {
    if (child.object->category != "medium") continue;
    CANDELA_ASSIGN(const std::uint32_t medium, add(child.object, files));
    (child.slot == "interior" ? sides.interior : sides.exterior) = medium;
    any = true;
  }
  if (!any) return kNone;
  interfaces_.push_back(sides);
  return static_cast<std::uint32_t>(interfaces_.size() - 1);
}

}  // namespace candela::scene
