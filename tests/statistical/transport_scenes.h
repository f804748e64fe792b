// The scenes of transport/: each exercises one hazard of light transport, is 64 by 64 pixels, and renders in
// seconds. The table says who can render it, so that every integrator is tested on everything it can do, and
// what it cannot do is written down.
#pragma once

#include <algorithm>
#include <array>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/integrators.h"

namespace candela::statistical {

// Sets of integrators. Those of tests/integrators.h that are `like` another are wherever it is.
enum TransportIntegrators : unsigned {
  kNone = 0,
  kPath = 1,
  kLight = 2,
  kBdpt = 4,
  kPpm = 8,
  kBpm = 16,
  kVcm = 32,
  kMerging = kPpm | kBpm | kVcm,
  kUnbiased = kPath | kLight | kBdpt,
  kAll = kUnbiased | kMerging,
};

inline unsigned transport_bit(std::string_view integrator) {
  constexpr std::array<std::pair<unsigned, std::string_view>, 6> bits = {
      {{kPath, "path"}, {kLight, "light"}, {kBdpt, "bdpt"}, {kPpm, "ppm"}, {kBpm, "bpm"}, {kVcm, "vcm"}}};
  const std::string name = test::integrator_row(integrator).family();
  const auto found =
      std::find_if(bits.begin(), bits.end(), [&](const auto& bit) { return bit.second == name; });
  if (found == bits.end()) throw std::runtime_error("tests/integrators.h: '" + name + "' has no scenes");
  return found->first;
}

struct TransportScene {
  std::string_view name;    // of the file transport/NAME.xml
  std::string_view hazard;  // what it tests
  // Whose expectation is the whole image; of merging ones in the limit of small radii.
  unsigned complete;
  // Complete integrators that need far more than some hundred iterations: rare, bright samples.
  unsigned slow;
  std::string_view why;  // why the others are not complete, or slow
};

// Reasons that recur.
inline constexpr std::string_view kLightSeesNoDelta =
    "light connects vertices to the camera, which a delta surface before it does not let pass";
inline constexpr std::string_view kThinPhotons = "photons in a thin medium are few: much noise, or blur";
inline constexpr std::string_view kPointBehindDelta =
    "light from a point that meets the camera over delta, matt, delta surfaces has no connection";

inline constexpr std::array kTransportScenes = {
    TransportScene{"box-diffuse", "matt surfaces and an area light", kAll, kNone, ""},
    TransportScene{"mirror-glossy", "a mirror ball on a glossy floor", kAll & ~kLight, kNone,
                   kLightSeesNoDelta},
    TransportScene{"caustic", "a glass ball under a small lamp", kAll & ~kLight, kPath, kLightSeesNoDelta},
    TransportScene{"sds", "matt things under a pane that the light passes too", kAll & ~kLight, kNone,
                   kLightSeesNoDelta},
    TransportScene{"immersed", "a ball in a block of water: eta^2", kAll & ~kLight, kNone, kLightSeesNoDelta},
    TransportScene{"lamp-in-glass", "a lamp inside glass: one refraction only", kAll & ~kLight, kNone,
                   kLightSeesNoDelta},
    TransportScene{"rough-glass", "rough refraction with eta^2", kAll, kNone, ""},
    TransportScene{"bump", "bump maps: scattering without symmetry", kAll, kNone, ""},
    TransportScene{"normal-map", "normal maps", kAll, kNone, ""},
    TransportScene{"coarse-mesh", "smooth normals on twenty faces", kAll, kNone, ""},
    TransportScene{"strict-normals", "smooth normals that let no light through", kAll, kNone, ""},
    TransportScene{"sides", "one-sided and two-sided sheets", kAll, kNone, ""},
    TransportScene{"mask", "textured opacity before the lamp and before the eye", kAll, kNone, ""},
    TransportScene{"thin-null", "thin panes and a null box: light passes straight", kAll & ~kLight, kNone,
                   "light does not see reflections in a thin pane"},
    TransportScene{"point", "a point light", kAll, kNone, ""},
    TransportScene{"spot", "spots, one textured", kAll, kNone, ""},
    TransportScene{"directional", "parallel light", kAll, kNone, ""},
    TransportScene{"constant", "a constant sky, seen directly", kAll, kNone, ""},
    TransportScene{"envmap", "an image of a sky with a sun, seen directly", kAll, kNone, ""},
    TransportScene{"sun-and-lamps", "a sky with a sun beside lamps: a shadow ray to each", kAll, kNone, ""},
    TransportScene{"textured-lamp", "lamps with textured radiance", kAll, kNone, ""},
    TransportScene{"many-lamps", "eighty-three lamps: the light tree", kAll, kNone, ""},
    TransportScene{"mesh-lamp", "a mesh with smooth normals as a lamp", kAll, kNone, ""},
    TransportScene{"lens", "a lens that light paths hit, out of focus, a lamp behind its plane", kAll, kNone,
                   ""},
    TransportScene{"cropped", "a crop window, seen through a lens", kAll, kNone, ""},
    TransportScene{"orthographic", "parallel projection", kAll, kNone, ""},
    TransportScene{"fog-thin", "thin fog everywhere", kAll, kPpm, kThinPhotons},
    TransportScene{"fog-null", "dense fog without a surface, and one that only absorbs", kAll, kNone, ""},
    TransportScene{"fog-rough-glass", "fog in frosted glass", kAll, kNone, ""},
    TransportScene{"fog-glass", "milk in smooth glass", kAll & ~kLight, kNone, kLightSeesNoDelta},
    TransportScene{"fog-camera", "camera and point light in fog", kAll, kPath | kPpm,
                   "path finds the surroundings of the light rarely; photons in a thin medium are few"},
    TransportScene{"smoke", "smoke on a grid", kAll, kPpm, kThinPhotons},
    TransportScene{"mixed", "delta and other lobes in one material", kAll & ~kLight, kNone,
                   kLightSeesNoDelta},
    TransportScene{"principled", "three principled materials", kAll, kNone, ""},
    TransportScene{"filter", "a wide Gaussian filter over textured reflectance", kAll, kNone, ""},
    TransportScene{"hidden-caustic", "the caustic of a point light and glass outside the picture",
                   kAll & ~kPath, kNone, "path cannot hit a point light behind glass"},
    TransportScene{"point-caustic", "the caustic of a point light, and its reflection", kMerging, kNone,
                   kPointBehindDelta},
    TransportScene{"point-sds", "a point light over a pane with matt things beneath", kMerging, kNone,
                   kPointBehindDelta},
    TransportScene{"directional-caustic", "parallel light through a glass ball", kMerging, kNone,
                   kPointBehindDelta},
    TransportScene{"mirror-room", "most of the picture is in a mirror", kAll & ~kLight, kNone,
                   kLightSeesNoDelta},
    TransportScene{"near-delta", "roughness 0.003: densities of 1e5, but no delta", kAll,
                   kLight | kPpm | kBpm, "connecting to or merging at such a surface rarely meets its lobe"},
    TransportScene{"index-matched", "refraction that hardly bends", kAll & ~kLight, kPpm,
                   "light sees no delta surface; frosted glass of index 1.01 is nearly delta to merging"},
    TransportScene{"flush", "lamps in the planes of a ceiling, a wall, a side of fog", kAll, kPath,
                   "path samples the fog next to a lamp rarely"},
    TransportScene{"fog-lens", "a lens that fog covers in part", kAll, kNone, ""},
    TransportScene{"fog-endless", "fog without an end that lets one colour pass", kAll, kNone, ""},
    TransportScene{"instances", "squeezed and mirrored copies", kAll, kNone, ""},
};

// Names of the integrators whose pictures of the scene are compared: of those that are complete, in the short
// form those that the table of integrators has in it.
inline std::vector<std::string> compared_on(const TransportScene& scene, bool long_form) {
  constexpr std::array<std::string_view, 3> some = {"box-diffuse", "caustic", "many-lamps"};
  const bool is_some = std::find(some.begin(), some.end(), scene.name) != some.end();
  std::vector<std::string> names;
  for (const test::IntegratorRow& row : test::integrators()) {
    using test::Pictures;
    if (row.chains || row.pictures == Pictures::own_tests || (scene.complete & transport_bit(row.name)) == 0)
      continue;
    if (long_form || row.pictures == Pictures::everywhere || (is_some && row.pictures == Pictures::some))
      names.push_back(row.name);
  }
  return names;
}

}  // namespace candela::statistical
