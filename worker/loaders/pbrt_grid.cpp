#include "worker/loaders/pbrt_grid.h"

#include <array>
#include <cmath>
#include <utility>

#include "common/description/check.h"
#include "common/description/pbrt/parameters.h"

namespace candela::loaders {
namespace {

using description::error_at;
using description::Location;
using description::pbrt::Parameter;
using description::pbrt::ParameterList;
using description::pbrt::Tokens;

}  // namespace

Result<VolumeData> load_pbrt_grid(std::string_view bytes, const std::string& name, std::int64_t offset,
                                  int line) {
  const Location where{name, line};
  if (offset < 0 || static_cast<std::uint64_t>(offset) >= bytes.size())
    return error_at(where, "the offset of a medium lies outside of the file");
  Tokens tokens(name, bytes, static_cast<std::size_t>(offset), line);
  CANDELA_ASSIGN(const auto word, tokens.next());
  CANDELA_ASSIGN(const auto medium, tokens.next());
  if (!word || word->quoted || word->text != "MakeNamedMedium" || !medium || !medium->quoted)
    return error_at(where, "no MakeNamedMedium directive begins at byte " + std::to_string(offset));
  CANDELA_ASSIGN(ParameterList parameters, ParameterList::read(tokens));
  VolumeData data;
  data.channels = 1;
  std::uint64_t cells = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string_view side = std::array<std::string_view, 3>{"nx", "ny", "nz"}[i];
    CANDELA_ASSIGN(const std::int64_t size, parameters.integer(side, 1));
    if (size < 1 || size > (1 << 20)) return error_at(where, "a side of the grid has 1 to 2^20 cells");
    data.size[i] = static_cast<std::uint32_t>(size);
    cells *= data.size[i];
  }
  const Parameter* density = parameters.take("density", {"float"});
  if (density == nullptr) return error_at(where, "the grid has no densities");
  if (density->numbers.size() != cells)
    return error_at(density->where, "the grid has " + std::to_string(cells) + " cells, but " +
                                        std::to_string(density->numbers.size()) + " densities");
  data.values.reserve(density->numbers.size());
  for (const double number : density->numbers) {
    const auto value = static_cast<float>(number);
    if (!(value >= 0) || !std::isfinite(value))
      return error_at(density->where, "a density of the grid is negative or too large");
    data.values.push_back(value);
  }
  return data;
}

}  // namespace candela::loaders
