#include "worker/loaders/pbrt_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/description/check.h"
#include "common/description/pbrt/parameters.h"
#include "worker/loaders/parallel.h"
#include "worker/loaders/pbrt_cloud.h"

namespace candela::loaders {
namespace {

using description::error_at;
using description::Location;
using description::pbrt::Parameter;
using description::pbrt::ParameterList;
using description::pbrt::Tokens;

Result<void> read_size(ParameterList& parameters, const Location& where, VolumeData& data,
                       std::uint64_t& cells) {
  cells = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string_view side = std::array<std::string_view, 3>{"nx", "ny", "nz"}[i];
    CANDELA_ASSIGN(const std::int64_t size, parameters.integer(side, 1));
    if (size < 1 || size > (1 << 20)) return error_at(where, "a side of the grid has 1 to 2^20 cells");
    data.size[i] = static_cast<std::uint32_t>(size);
    cells *= data.size[i];
  }
  return {};
}

Result<float> checked(double number, const Location& where, std::string_view of) {
  const auto value = static_cast<float>(number);
  if (!(value >= 0) || !std::isfinite(value))
    return error_at(where, "a " + std::string(of) + " of the grid is negative or too large");
  return value;
}

Result<VolumeData> densities(ParameterList& parameters, const Location& where) {
  VolumeData data;
  data.channels = 1;
  std::uint64_t cells = 1;
  CANDELA_TRY(read_size(parameters, where, data, cells));
  const Parameter* density = parameters.take("density", {"float"});
  if (density == nullptr) return error_at(where, "the grid has no densities");
  if (density->numbers.size() != cells)
    return error_at(density->where, "the grid has " + std::to_string(cells) + " cells, but " +
                                        std::to_string(density->numbers.size()) + " densities");
  data.values.reserve(density->numbers.size());
  for (const double number : density->numbers) {
    CANDELA_ASSIGN(const float value, checked(number, density->where, "density"));
    data.values.push_back(value);
  }
  return data;
}

// pbrt's coefficients are 1 where the directive has no values.
Result<VolumeData> colors(ParameterList& parameters, const Location& where, bool albedo) {
  VolumeData data;
  data.channels = 3;
  std::uint64_t cells = 1;
  CANDELA_TRY(read_size(parameters, where, data, cells));
  const Parameter* absorption = parameters.take("sigma_a", {"rgb"});
  const Parameter* scattering = parameters.take("sigma_s", {"rgb"});
  if (absorption == nullptr && scattering == nullptr)
    return error_at(where, "the grid has neither sigma_a nor sigma_s");
  for (const Parameter* given : {absorption, scattering})
    if (given != nullptr && given->numbers.size() != 3 * cells)
      return error_at(given->where, "the grid has " + std::to_string(cells) + " cells, but " +
                                        std::to_string(given->numbers.size() / 3) + " colors");
  data.values.reserve(3 * cells);
  for (std::size_t i = 0; i < 3 * cells; ++i) {
    float a = 1, s = 1;
    if (absorption != nullptr) {
      CANDELA_ASSIGN(a, checked(absorption->numbers[i], absorption->where, "sigma_a"));
    }
    if (scattering != nullptr) {
      CANDELA_ASSIGN(s, checked(scattering->numbers[i], scattering->where, "sigma_s"));
    }
    const float total = a + s;
    if (!std::isfinite(total)) return error_at(where, "the extinction of the grid is too large");
    data.values.push_back(!albedo ? total : total > 0 ? std::min(s / total, 1.0f) : 0.0f);
  }
  return data;
}

// The noise at the centers of cells in the box from p0 to p1.
Result<VolumeData> cloud(ParameterList& parameters, const Location& where) {
  constexpr std::uint32_t kSide = 128;
  PbrtCloud noise;
  for (const auto& [name, value] :
       {std::pair("density", &noise.density), std::pair("wispiness", &noise.wispiness),
        std::pair("frequency", &noise.frequency)}) {
    CANDELA_ASSIGN(const double number, parameters.number(name, static_cast<double>(*value)));
    *value = static_cast<float>(number);
    if (!(std::abs(*value) < 1e6f)) return error_at(where, "a parameter of the cloud is too large");
  }
  CANDELA_ASSIGN(const description::Vec3 p0, parameters.point("p0", {0, 0, 0}));
  CANDELA_ASSIGN(const description::Vec3 p1, parameters.point("p1", {1, 1, 1}));
  VolumeData data;
  data.channels = 1;
  data.size = {kSide, kSide, kSide};
  data.values.resize(std::size_t{kSide} * kSide * kSide);
  const auto place = [&](std::size_t axis, std::size_t cell) {
    const double t = (static_cast<double>(cell) + 0.5) / kSide;
    const double low = std::min(p0[axis], p1[axis]), high = std::max(p0[axis], p1[axis]);
    return static_cast<float>(low + t * (high - low));
  };
  for_ranges(data.values.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      data.values[i] =
          noise.at({place(0, i % kSide), place(1, i / kSide % kSide), place(2, i / (kSide * kSide))});
  });
  return data;
}

}  // namespace

Result<VolumeData> load_pbrt_grid(std::string_view bytes, const std::string& name, std::int64_t offset,
                                  int line, std::string_view quantity, description::ReadingBudget& budget) {
  const Location where{name, line};
  if (offset < 0 || static_cast<std::uint64_t>(offset) >= bytes.size())
    return error_at(where, "the offset of a medium lies outside of the file");
  Tokens tokens(name, bytes, static_cast<std::size_t>(offset), line, nullptr, budget);
  CANDELA_ASSIGN(const auto word, tokens.next());
  CANDELA_ASSIGN(const auto medium, tokens.next());
  if (!word || word->quoted || word->text != "MakeNamedMedium" || !medium || !medium->quoted)
    return error_at(where, "no MakeNamedMedium directive begins at byte " + std::to_string(offset));
  CANDELA_ASSIGN(ParameterList parameters, ParameterList::read(tokens));
  CANDELA_ASSIGN(const std::string type, parameters.text("type", ""));
  if (quantity == "sigma_t" || quantity == "albedo") return colors(parameters, where, quantity == "albedo");
  if (!quantity.empty())
    return error_at(where, "the directive has no quantity '" + std::string(quantity) + "'");
  return type == "cloud" ? cloud(parameters, where) : densities(parameters, where);
}

}  // namespace candela::loaders
