// The room of tests of layers by light path expressions: two lamps and two skies over a ball of rough metal,
// glass, and a floor of two lobes of different colors.
#pragma once

#include <string>
#include <vector>

#include "common/letters/request.h"
#include "tests/integrators.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {

using Layers = std::vector<letters::NamedExpression>;

inline constexpr std::uint32_t kRoomWidth = 24, kRoomHeight = 16;
inline constexpr std::size_t kRoomValues = std::size_t{kRoomWidth} * kRoomHeight * 3;

// settings: beside those of the integrator's small jobs. more: XML beside that of the room.
inline TestScene layered_room(const std::string& integrator, const SettingsMap& settings,
                              const Layers& layers, bool partition = false, const std::string& more = "") {
  TestScene scene = scene_from_xml(
      R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="5"/></integrator>
    <sensor type="perspective"><float name="fov" value="60"/>
      <transform name="to_world"><lookat origin="0, 1.2, 2" target="0, -0.3, -0.1" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/><translate y="-0.5"/></transform>
      <bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.2"/>
      <rgb name="diffuse_reflectance" value="0.7, 0.3, 0.05"/><rgb name="specular_reflectance" value="0.1, 0.5, 1"/></bsdf></bsdf></shape>
    <shape type="sphere" id="ball"><point name="center" x="0.5" y="0" z="-0.3"/><float name="radius" value="0.45"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.25"/></bsdf></shape>
    <shape type="sphere" id="glass"><point name="center" x="-0.6" y="0" z="0"/><float name="radius" value="0.4"/>
      <bsdf type="dielectric"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.6"/><rotate x="1" angle="90"/><translate y="1.9"/></transform>
      <emitter type="area" id="panel"><rgb name="radiance" value="5, 4, 3"/></emitter></shape>
    <emitter type="point" id="bulb"><point name="position" x="-0.6" y="0.8" z="0.5"/><rgb name="intensity" value="3, 5, 9"/></emitter>
    <emitter type="constant" id="sky"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>)" +
          more + "</scene>",
      kRoomWidth, kRoomHeight);
  const auto& small = test::integrator_row(integrator).small;
  SettingsMap all(small.begin(), small.end());
  for (const auto& [name, value] : settings) all[name] = value;
  scene = with_integrator(scene, integrator, all);
  letters::LayerRequest request;
  request.layers = layers;
  request.partition = partition;
  if (!layers.empty()) scene.settings.layers = letters::text_of(request);
  scene.settings.seed = 5;
  return scene;
}

}  // namespace candela::statistical
