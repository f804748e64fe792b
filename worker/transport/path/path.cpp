#include "worker/transport/path/path.h"

#include <algorithm>

namespace candela::transport::path {

Path Path::replaced(PathRange range, std::span<const PathVertex> by) const {
  Path out;
  const auto at = [&](std::size_t i) { return vertices.begin() + static_cast<std::ptrdiff_t>(i); };
  out.vertices.assign(vertices.begin(), at(range.begin));
  out.vertices.insert(out.vertices.end(), by.begin(), by.end());
  out.vertices.insert(out.vertices.end(), at(range.end), vertices.end());
  return out;
}

bool Path::well_formed() const {
  if (vertices.size() < 2 || !is_light(vertices.front().kind) || vertices.back().kind != Kind::sensor)
    return false;
  return std::all_of(vertices.begin() + 1, vertices.end() - 1, [](const PathVertex& v) {
    if (v.mollified && v.delta) return false;
    return v.kind == Kind::surface || (v.kind == Kind::medium && !v.delta && !v.mollified);
  });
}

PathRange changed_range(const Path& from, const Path& to) {
  const std::size_t shorter = std::min(from.vertices.size(), to.vertices.size());
  std::size_t front = 0, back = 0;
  while (front < shorter && from.vertices[front] == to.vertices[front]) ++front;
  while (back < shorter - front &&
         from.vertices[from.vertices.size() - 1 - back] == to.vertices[to.vertices.size() - 1 - back])
    ++back;
  return {front, from.vertices.size() - back};
}

}  // namespace candela::transport::path
