#include "worker/scene/shapes/mesh_parts.h"

#include <algorithm>
#include <string_view>
#include <unordered_map>
#include <utility>

namespace candela::scene {
namespace {

constexpr std::uint32_t kUnused = 0xffffffffu;

struct Range {
  std::size_t begin = 0, end = 0;
};

// The triangles of the ranges, with the vertices that they use. `index`: kUnused for all vertices, and again
// so afterwards.
loaders::Mesh part_of(const loaders::Mesh& mesh, const std::vector<Range>& ranges,
                      std::vector<std::uint32_t>& index) {
  loaders::Mesh part;
  part.face_normals = mesh.face_normals;
  std::vector<std::uint32_t> used;
  for (const Range& range : ranges) {
    for (std::size_t i = range.begin; i < range.end; ++i) {
      auto& triangle = part.triangles.emplace_back(mesh.triangles[i]);
      for (std::uint32_t& v : triangle) {
        if (index[v] == kUnused) {
          index[v] = static_cast<std::uint32_t>(used.size());
          used.push_back(v);
        }
        v = index[v];
      }
    }
  }
  const auto take = [&](auto& to, const auto& from) {
    if (from.empty()) return;
    to.reserve(used.size());
    for (const std::uint32_t v : used) to.push_back(from[v]);
  };
  take(part.positions, mesh.positions);
  take(part.normals, mesh.normals);
  take(part.uvs, mesh.uvs);
  for (const std::uint32_t v : used) index[v] = kUnused;
  return part;
}

// The bsdfs of a shape by the names of materials: of those that fit a name the last counts, and one without a
// name fits all.
class BsdfsByName {
 public:
  explicit BsdfsByName(const description::Object& shape) {
    for (const description::Child& child : shape.children) {
      if (child.object->category != "bsdf") continue;
      if (child.slot.empty()) {
        of_all_ = child.object;
        named_.clear();
      } else {
        named_[child.slot] = child.object;
      }
    }
  }
  const description::ObjectPtr& operator[](const std::string& material) const {
    const auto found = named_.find(material);
    return found != named_.end() ? found->second : of_all_;
  }

 private:
  std::unordered_map<std::string_view, description::ObjectPtr> named_;
  description::ObjectPtr of_all_;
};

}  // namespace

bool has_bsdfs_by_name(const description::Object& shape) {
  if (shape.plugin != "obj" || shape.get_bool("collapse", true)) return false;
  return std::any_of(shape.children.begin(), shape.children.end(), [](const description::Child& child) {
    return child.object->category == "bsdf" && !child.slot.empty();
  });
}

std::vector<BsdfMesh> split_by_bsdf(loaders::ObjMesh read, const description::Object& shape) {
  loaders::Mesh& mesh = read.mesh;
  const BsdfsByName bsdfs(shape);
  std::vector<std::pair<description::ObjectPtr, std::vector<Range>>> groups;
  std::unordered_map<const description::Object*, std::size_t> group_of;
  for (std::size_t i = 0; i < read.parts.size(); ++i) {
    const std::size_t end =
        i + 1 < read.parts.size() ? read.parts[i + 1].first_triangle : mesh.triangles.size();
    const description::ObjectPtr& bsdf = bsdfs[read.parts[i].material];
    const auto [group, is_new] = group_of.emplace(bsdf.get(), groups.size());
    if (is_new) groups.push_back({bsdf, {}});
    groups[group->second].second.push_back({read.parts[i].first_triangle, end});
  }
  std::vector<BsdfMesh> out;
  if (groups.size() == 1) {
    out.push_back({groups[0].first, std::move(mesh)});
    return out;
  }
  std::vector<std::uint32_t> index(mesh.positions.size(), kUnused);
  for (const auto& [bsdf, ranges] : groups) out.push_back({bsdf, part_of(mesh, ranges, index)});
  out[0].mesh.dropped_face_count = mesh.dropped_face_count;
  return out;
}

}  // namespace candela::scene
