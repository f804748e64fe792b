// The smallest scene that has a plugin, with the files that it names.
#pragma once

#include <set>
#include <string>

#include "common/description/reading.h"
#include "test_description_common.h"

namespace candela::description {

// The parameters and children that a plugin requires, without those in `given`.
inline std::string required_contents(const std::string& category, const std::string& plugin,
                                     const std::set<std::string>& given = {}) {
  static const std::set<std::string> with_file = {"obj",         "ply",          "serialized",  "hair",
                                                  "heightfield", "bsplinecurve", "linearcurve", "sdfgrid",
                                                  "bitmap",      "gridvolume",   "envmap"};
  static const std::set<std::string> with_part = {"coating", "roughcoating", "bumpmap",     "normalmap",
                                                  "mask",    "twosided",     "mixturebsdf", "blendbsdf"};
  std::string inside;
  const auto needs = [&](const std::string& name, const std::string& element) {
    if (!given.contains(name)) inside += element;
  };
  if (with_file.contains(plugin) && category != "bsdf")
    needs("filename", "<string name='filename' value='mesh.obj'/>");
  if (plugin == "shapegroup" || plugin == "merge") inside += "<shape type='cube'/>";
  if (plugin == "instance") inside += "<ref id='group'/>";
  if (with_part.contains(plugin)) inside += "<bsdf type='diffuse'/>";
  if (plugin == "mixturebsdf" || plugin == "blendbsdf") inside += "<bsdf type='diffuse'/>";
  if (plugin == "bumpmap" || (plugin == "scale" && category == "texture"))
    needs("texture", "<texture type='checkerboard'/>");
  if (plugin == "normalmap") needs("normalmap", "<texture name='normalmap' type='checkerboard'/>");
  if (plugin == "mixturephase" || plugin == "blendphase")
    inside += "<phase type='hg'/><phase type='isotropic'/>";
  if (plugin == "mixturebsdf" || plugin == "mixturephase")
    needs("weights", "<string name='weights' value='0.5, 0.5'/>");
  if (plugin == "blendphase") needs("weight", "<float name='weight' value='0.5'/>");
  if (plugin == "thinlens" || plugin == "telecentric")
    if (!given.contains("aperture_radius"))
      needs("apertureRadius", "<float name='apertureRadius' value='0.1'/>");
  if (plugin == "constvolume") needs("value", "<float name='value' value='0.5'/>");
  if (category == "texture" && plugin == "volume")
    needs("volume", "<volume name='volume' type='constvolume'/>");
  if (plugin == "mesh_attribute") needs("name", "<string name='name' value='vertex_color'/>");
  // Roughness along one axis needs that along the other.
  if (plugin == "roughconductor" || plugin == "roughdielectric")
    for (const auto& [one, other] : {std::pair("alphaU", "alphaV"),
                                     {"alphaV", "alphaU"},
                                     {"alpha_u", "alpha_v"},
                                     {"alpha_v", "alpha_u"}})
      if (given.contains(one)) inside += std::string("<float name='") + other + "' value='0.2'/>";
  return inside;
}

// The body of a scene with one object of the plugin, at a place where it may be.
inline std::string smallest_scene(const std::string& category, const std::string& plugin,
                                  const std::string& contents) {
  const std::string object =
      "\n<" + category + " type='" + plugin + "'" + (category == "texture" ? " name='reflectance'" : "") +
      (category == "volume" ? " name='sigma_t'" : "") + (category == "medium" ? " name='interior'" : "") +
      ">" + contents + "</" + category + ">\n";
  const auto in = [&](const std::string& before, const std::string& after) {
    return before + object + after;
  };
  if (category == "bsdf") return in("<shape type='cube'>", "</shape>");
  if (category == "texture") return in("<shape type='cube'><bsdf type='diffuse'>", "</bsdf></shape>");
  if (category == "medium") return in("<shape type='cube'>", "</shape>");
  if (category == "phase")
    return in("<shape type='cube'><medium name='interior' type='homogeneous'>", "</medium></shape>");
  if (category == "volume")
    return in("<shape type='cube'><medium name='interior' type='heterogeneous'>", "</medium></shape>");
  if (category == "emitter" && (plugin == "area" || plugin == "directionalarea"))
    return in("<shape type='cube'>", "</shape>");
  if (plugin == "irradiancemeter") return in("<shape type='cube'>", "</shape>");
  if (category == "sampler" || category == "film") return in("<sensor type='perspective'>", "</sensor>");
  if (category == "rfilter")
    return in("<sensor type='perspective'><film type='hdrfilm'>", "</film></sensor>");
  return object +
         (plugin == "instance" ? "<shape type='shapegroup' id='group'><shape type='cube'/></shape>" : "");
}

inline Result<ReadScene> read_smallest(const std::string& version, const std::string& body, bool lenient) {
  return read_scene(MemorySource({{"scene.xml", "<scene version='" + version + "'>" + body + "</scene>"},
                                  {"mesh.obj", "v"}}),
                    "scene.xml", {}, Reading{.lenient = lenient});
}

}  // namespace candela::description
