// Promises of a loader about every mesh it returns.
#pragma once

#include <cmath>
#include <cstdlib>

#include "worker/loaders/mesh.h"

inline void check_mesh(const candela::Result<candela::loaders::Mesh>& mesh) {
  if (!mesh.ok()) {
    if (mesh.error().to_string().find('\n') != std::string::npos) std::abort();
    return;
  }
  const std::size_t count = mesh->positions.size();
  if (!mesh->normals.empty() && mesh->normals.size() != count) std::abort();
  if (!mesh->uvs.empty() && mesh->uvs.size() != count) std::abort();
  for (const auto& t : mesh->triangles)
    for (const std::uint32_t i : t)
      if (i >= count) std::abort();
  const auto finite = [](float v) {
    if (!std::isfinite(v)) std::abort();
  };
  for (const auto& p : mesh->positions) finite(p.x), finite(p.y), finite(p.z);
  for (const auto& n : mesh->normals) finite(n.x), finite(n.y), finite(n.z);
  for (const auto& t : mesh->uvs) finite(t.x), finite(t.y);
}
