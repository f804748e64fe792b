// Levels of a radius: the state of a pixel is a byte g, and its radius is the first radius times factor^g.
// Text of the constants that levels and tests of a job have in its plan of work.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"

namespace candela::adaptive {

inline constexpr int kMaxLevel = 255;  // a level is one byte

struct Levels {
  double factor = 0;  // in (0, 1)
  int max_level = 0;
  // floors[g - 1]: the iteration that an epoch has to begin at or after for level g to be allowed. Does not
  // decrease. Empty: all levels are allowed at all times.
  std::vector<std::uint64_t> floors = {};
  bool operator==(const Levels&) const = default;

  // The largest level that is allowed in an epoch which begins at this iteration.
  int deepest(std::uint64_t iteration) const;
  // radii[g] = first * factor^g, by repeated multiplication, for g = 0 .. max_level.
  std::vector<double> radii(double first) const;
};

// Levels whose radius stays at or above min_radius * (i + 1)^((alpha - 1) / 2), for a radius of 1 at level 0
// and the epoch's first iteration i [Lin et al. 2023, Eq. 21]. Levels that are never allowed are left out.
// Preconditions: 0 < factor < 1, 0 < min_radius < 1, 0 < alpha < 1.
Levels levels_above(double factor, double min_radius, double alpha);

// The iteration from which on factor^g is nearest to i^((to_alpha - alpha) / 2), for g = 1 and on: the levels
// by which radii that shrink with alpha stay beside radii that shrink with to_alpha. At most max_level, and
// none unless to_alpha < alpha. Preconditions: 0 < factor < 1, 0 < to_alpha < 1.
std::vector<std::uint64_t> levels_beside(double factor, double alpha, double to_alpha, int max_level);

// Iterations that do not decrease, as text. Reading fails (input) with the constant's name as field; it gives
// an empty list if the constant is absent.
std::string iterations_text(const std::vector<std::uint64_t>& iterations);
Result<std::vector<std::uint64_t>> get_iterations(const SettingsMap& constants, std::string_view name);

// Writes `factor`, `max_level` and, unless empty, `floors`.
void put_levels(const Levels& levels, SettingsMap& constants);
// Fails (input) with the constant's name as field.
Result<Levels> get_levels(const SettingsMap& constants);

// Numbers as text: the shortest that is read back as the same bits, whatever the machine.
std::string constant_text(double value);
Result<double> get_number(const SettingsMap& constants, std::string_view name);
Result<std::uint64_t> get_integer(const SettingsMap& constants, std::string_view name);

// round(value * 2^32): critical values, which decisions take as integers. Precondition: 0 <= value < 2^31.
std::uint64_t critical_integer(double value);

}  // namespace candela::adaptive
