#include "worker/transport/path/mollified.h"

#include <algorithm>

#include "worker/transport/technique/mollify.h"

namespace candela::transport::path {
namespace {

using enum Letter;

// The letters of regularise.h.
std::vector<Letter> letters_of(const scene::Scene& scene, const Path& path) {
  const auto letter = [](bool delta) { return delta ? specular : diffuse; };
  const Kind light = path.vertices.front().kind;
  std::vector<Letter> out{letter(light == Kind::point_light || light == Kind::directed_light), diffuse};
  for (std::size_t i = 1; i + 1 < path.vertices.size(); ++i)
    out.push_back(letter(path.vertices[i].delta || path.vertices[i].mollified));
  out.push_back(diffuse);
  out.push_back(letter(!scene.features().finite_lens));
  return out;
}

}  // namespace

std::optional<MollifiedVertex> mollified_vertex(const scene::Scene& scene, const Path& path,
                                                std::span<const PathEdge> edges) {
  constexpr auto kAll = Connecting::bidirectional;
  const std::vector<Letter> string = letters_of(scene, path);
  if (!mollify(string, kAll)) return std::nullopt;
  std::vector<double> lengths;
  for (const PathEdge& edge : edges) lengths.push_back(edge.length > 0 ? edge.length : far_length(scene));
  const std::uint32_t s = choose(string, kAll, lengths);
  if (s == 0) return std::nullopt;
  // The letter of vertex i is string[i + 1].
  const bool of_light = string[s] == specular;
  const MollifiedVertex found{of_light ? s - 1 : s, of_light ? Cone::towards_eye : Cone::towards_light};
  const auto flagged = std::ranges::count_if(path.vertices, [](const PathVertex& v) { return v.mollified; });
  if (flagged != 1 || !path.vertices[found.vertex].mollified) return std::nullopt;
  return found;
}

}  // namespace candela::transport::path
