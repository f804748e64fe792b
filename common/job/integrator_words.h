// Integrators by name, and the settings of integrators that a scene file may give: name, bounds and default
// of each, written once. The renderer reads its settings by these words (worker/integrators/*/settings.h),
// and the vocabulary of scene files is made from them (common/description/rules_sensors.cpp).
#pragma once

#include <array>
#include <string_view>

namespace candela::integrator_words {

struct IntegerSetting {
  std::string_view name;
  int minimum, maximum;
};

struct NumberSetting {
  std::string_view name;
  double minimum, maximum;
  // The minimum itself is out of bounds.
  bool above_minimum = false;
};

struct BooleanSetting {
  std::string_view name;
  bool default_value;
};

// A default and its text for readers.
struct NumberDefault {
  double value = 0;
  std::string_view text = {};
};

// Longest path in edges; -1 for no limit.
inline constexpr IntegerSetting kMaxDepth{"max_depth", -1, 1 << 20};
inline constexpr int kDefaultMaxDepth = -1;
// Path depth from which Russian roulette may end a path. Its default is the integrator's.
inline constexpr IntegerSetting kRrDepth{"rr_depth", 1, 1 << 20};
inline constexpr BooleanSetting kHideEmitters{"hide_emitters", false};
// Squared merging radii shrink as i^(alpha - 1). Its default is the integrator's.
inline constexpr NumberSetting kAlpha{"alpha", 0, 1, true};

// One integrator and the defaults that are its own.
struct IntegratorWords {
  std::string_view name;
  int rr_depth;
  // Integrators that merge have the setting alpha; its text is empty for the others.
  NumberDefault alpha = {};
};

inline constexpr NumberDefault kTwoThirds{2.0 / 3, "2/3"};

inline constexpr IntegratorWords kPath{"path", 5};
inline constexpr IntegratorWords kBdpt{"bdpt", 2};
inline constexpr IntegratorWords kLight{"light", 2};
inline constexpr IntegratorWords kPpm{"ppm", 2, kTwoThirds};
inline constexpr IntegratorWords kBpm{"bpm", 2, kTwoThirds};
// Merging carries less of the image than in ppm: its bias matters less, its variance as much.
inline constexpr IntegratorWords kVcm{"vcm", 2, {0.75, "0.75"}};
// alpha is that of merging on surfaces; radii in media have exponents of their own.
inline constexpr IntegratorWords kUpbp{"upbp", 2, {0.75, "0.75"}};
inline constexpr IntegratorWords kOptimis{"optimis", 5};
// Their radii follow from statistics.
inline constexpr IntegratorWords kFppm{"fppm", 2};
inline constexpr IntegratorWords kCppm{"cppm", 2};
inline constexpr IntegratorWords kAppm{"appm", 2};
// Gathers as ppm.
inline constexpr IntegratorWords kMcppm{"mcppm", 2, kTwoThirds};
// Radii of pixels shrink by tests, and all a little for the bias that no test has seen.
inline constexpr IntegratorWords kVcmplus{"vcmplus", 2, {0.9, "0.9"}};
// 0: the default of the estimator that the chains are over.
inline constexpr IntegratorWords kPssmlt{"pssmlt", 0};
inline constexpr IntegratorWords kMmlt{"mmlt", 1024};
// rr_depth is that of the path tracing beside the chains.
inline constexpr IntegratorWords kMlt{"mlt", 5};
inline constexpr IntegratorWords kErpt{"erpt", 5};

inline constexpr std::array kIntegrators = {kPath,  kBdpt,    kLight, kPpm,  kBpm,  kVcm,
                                            kUpbp,  kOptimis, kFppm,  kCppm, kAppm, kVcmplus,
                                            kMcppm, kPssmlt,  kMmlt,  kMlt,  kErpt};

}  // namespace candela::integrator_words
