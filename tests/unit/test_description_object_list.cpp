// Names, numbers and bounds of a scene's objects, as light path expressions and `candela objects` know them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/description/object_list.h"
#include "common/description/object_names.h"
#include "common/description/reading.h"
#include "test_description_common.h"

namespace candela::description {
namespace {

ObjectPtr read(const std::string& name, const std::string& text) {
  const std::map<std::string, std::string> files{{name, text}};
  const auto result = read_scene(MemorySource(files), name, {}, {});
  EXPECT_TRUE(result.ok()) << result.error().to_string();
  return result.ok() ? result->description.scene : std::make_shared<Object>();
}

ObjectPtr box() {
  return read("scene.xml", R"(<scene version='3.0.0'>
<bsdf type='twosided' id='paint'><bsdf type='diffuse' id='red'/></bsdf>
<medium type='homogeneous' id='fog'/>
<shape type='rectangle' id='floor'><ref id='paint'/></shape>
<shape type='sphere'><point name='center' value='1, 2, 3'/><float name='radius' value='2'/><ref id='paint'/>
  <ref name='interior' id='fog'/><medium name='exterior' type='homogeneous'/></shape>
<shape type='cube' id='panel'><emitter type='area'/></shape>
<shape type='cube' id='window'><emitter type='area' id='key'/></shape>
<emitter type='point'><point name='position' value='0, 5, 0'/></emitter>
<emitter type='constant'/>
<shape type='disk'><emitter type='area'/></shape>
<shape type='shapegroup' id='tree'><shape type='rectangle' id='leaf'/><shape type='cube'/></shape>
<shape type='instance'><ref id='tree'/><transform name='to_world'><translate x='10'/></transform></shape>
<shape type='instance'><ref id='tree'/><transform name='to_world'><scale value='2'/></transform></shape>
</scene>)");
}

std::string text_of(const std::vector<NamedObjects>& rows) {
  std::string text;
  for (const NamedObjects& row : rows) {
    text += row.name + ":";
    for (const auto& [kind, count] : row.kinds) text += fmt::format(" {} {}", count, kind);
    if (row.bounds) {
      const auto& [low, high] = *row.bounds;
      text += fmt::format(" {},{},{}..{},{},{}", low[0], low[1], low[2], high[0], high[1], high[2]);
    }
    text += "\n";
  }
  return text;
}

// Claim: surfaces, lamps and media are listed by id, by the id of their bsdf and of their shapegroup, and by
// kind and number, with instances counted and bounds in the world.
TEST(DescriptionObjects, AreListedByName) {
  const ObjectList list = list_objects(*box());
  EXPECT_EQ(text_of(list.surfaces),
            "floor: 1 rectangle -1,-1,0..1,1,0\n"
            "paint: 1 rectangle 1 sphere -1,-1,0..3,4,5\n"
            "red: 1 rectangle 1 sphere -1,-1,0..3,4,5\n"
            "panel: 1 cube -1,-1,-1..1,1,1\n"
            "window: 1 cube -1,-1,-1..1,1,1\n"
            "leaf: 2 rectangle -2,-2,0..11,2,0\n"
            "tree: 2 cube 2 rectangle -2,-2,-2..11,2,2\n");
  EXPECT_EQ(text_of(list.lamps),
            "panel: 1 area -1,-1,-1..1,1,1\n"
            "key: 1 area -1,-1,-1..1,1,1\n"
            "point.1: 1 point 0,5,0..0,5,0\n"
            "constant.1: 1 constant\n"
            "area.3: 1 area -1,-1,0..1,1,0\n");
  EXPECT_EQ(text_of(list.media), "fog: 1 homogeneous -1,0,1..3,4,5\nhomogeneous.2: 1 homogeneous\n");
}

// Claim: an id that looks as a made name does not become another lamp's.
TEST(DescriptionObjects, MadeNamesAreOfNobodyElse) {
  const ObjectPtr scene = read("scene.xml", R"(<scene version='3.0.0'>
<emitter type='point' id='point.2'/><emitter type='point'/><emitter type='point'/></scene>)");
  EXPECT_EQ(letter_objects(*scene).lamp_names, (std::vector<std::string>{"point.2", "point.3", "point.4"}));
}

std::string check(const ObjectPtr& scene, const std::string& layers) {
  const auto request = letters::parse_layer_request(layers);
  if (!request.ok()) return request.error().to_string();
  const auto checked = check_layers(*request, *scene);
  return checked.ok() ? "" : checked.error().to_string();
}

// Claim: expressions are checked against the scene: names, kinds of objects, light groups and partitions.
TEST(DescriptionObjects, LayersAreCheckedByTheScene) {
  const ObjectPtr scene = box();
  EXPECT_EQ(check(scene, "layer a=L{key}X{leaf}X{tree}V{fog}D{red}E"), "");
  EXPECT_EQ(check(scene, "layer a=L{panel}X{panel}E; layer b=L{area.*}E"), "");
  EXPECT_EQ(check(scene, "layer a=LX{flor}E"),
            "layer 'a', column 2: no surface is called 'flor' (did you mean 'floor'?)");
  EXPECT_EQ(check(scene, "layer a=L{leaf}E"),
            "layer 'a', column 1: no lamp is called 'leaf' (objects of that name are no lamp)");
  EXPECT_EQ(check(scene, "light-groups; partition"), "");
  EXPECT_TRUE(check(scene, "layer a=L{key}[XV]*E; partition")
                  .starts_with("the layers are no partition: none matches"));
}

// Claim: pbrt's named materials and media and its objects have their names.
TEST(DescriptionObjects, PbrtNames) {
  const ObjectPtr scene = read("scene.pbrt", R"(Camera "perspective"
WorldBegin
MakeNamedMaterial "gold" "string type" "conductor"
MakeNamedMedium "smoke" "string type" "homogeneous"
LightSource "point"
AttributeBegin
  AreaLightSource "diffuse"
  Shape "sphere"
AttributeEnd
AttributeBegin
  MediumInterface "smoke" ""
  NamedMaterial "gold"
  Shape "sphere" "float radius" 3
AttributeEnd
ObjectBegin "tree"
  Shape "disk"
ObjectEnd
ObjectInstance "tree"
)");
  const ObjectList list = list_objects(*scene);
  const auto names = [](const std::vector<NamedObjects>& rows) {
    std::vector<std::string> result;
    for (const NamedObjects& row : rows) result.push_back(row.name);
    return result;
  };
  EXPECT_EQ(names(list.surfaces), (std::vector<std::string>{"gold", "tree"}));
  EXPECT_EQ(names(list.lamps), (std::vector<std::string>{"point.1", "area.1"}));
  EXPECT_EQ(names(list.media), (std::vector<std::string>{"smoke"}));
}

}  // namespace
}  // namespace candela::description
