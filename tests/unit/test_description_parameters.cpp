// Each parameter that the manuals of Mitsuba 0.6 and 3 document, alone in the smallest scene that has its
// plugin: it is understood, or a warning says that it is passed over or what is read in its place.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <sstream>

#include "common/description/text.h"
#include "common/description/vocabulary.h"
#include "smallest_scene.h"

namespace candela::description {
namespace {

struct Manual {
  const char* version;
  const char* category;
  const char* plugins;     // all have the parameters
  const char* parameters;  // name:element,element ...
};

// Without what is for polarization, for wavelengths, or for programs in place of files ('data', 'bitmap').
constexpr Manual kManuals[] = {
    // ---- 0.6 ----
    {"0.6.0", "shape", "cube sphere cylinder rectangle disk obj ply serialized instance hair heightfield",
     "toWorld:transform"},
    {"0.6.0", "shape", "cube sphere cylinder rectangle disk obj ply serialized heightfield",
     "flipNormals:boolean"},
    {"0.6.0", "shape", "sphere", "center:point radius:float"},
    {"0.6.0", "shape", "cylinder", "p0:point p1:point radius:float"},
    {"0.6.0", "shape", "obj ply serialized hair heightfield", "filename:string"},
    {"0.6.0", "shape", "obj ply serialized", "faceNormals:boolean maxSmoothAngle:float"},
    {"0.6.0", "shape", "obj",
     "flipTexCoords:boolean collapse:boolean loadMaterials:boolean shapeIndex:integer"},
    {"0.6.0", "shape", "ply", "srgb:boolean"},
    {"0.6.0", "shape", "serialized", "shapeIndex:integer"},
    {"0.6.0", "shape", "hair", "radius:float angleThreshold:float reduction:float"},
    {"0.6.0", "shape", "heightfield",
     "shadingNormals:boolean width:integer height:integer scale:float texture:texture"},
    {"0.6.0", "bsdf", "diffuse roughdiffuse",
     "reflectance:rgb,spectrum,srgb,texture diffuseReflectance:rgb,texture"},
    {"0.6.0", "bsdf", "roughdiffuse", "alpha:float,texture useFastApprox:boolean"},
    {"0.6.0", "bsdf", "dielectric thindielectric roughdielectric plastic roughplastic coating roughcoating",
     "intIOR:float,string extIOR:float,string specularReflectance:rgb,spectrum,texture"},
    {"0.6.0", "bsdf", "dielectric thindielectric roughdielectric",
     "specularTransmittance:rgb,spectrum,texture"},
    {"0.6.0", "bsdf", "roughdielectric roughconductor roughplastic roughcoating",
     "distribution:string alpha:float,texture sampleVisible:boolean"},
    {"0.6.0", "bsdf", "roughdielectric roughconductor", "alphaU:float,texture alphaV:float,texture"},
    {"0.6.0", "bsdf", "conductor roughconductor",
     "material:string eta:rgb,spectrum k:rgb,spectrum extEta:float,string "
     "specularReflectance:rgb,spectrum,texture"},
    {"0.6.0", "bsdf", "plastic roughplastic", "diffuseReflectance:rgb,spectrum,texture nonlinear:boolean"},
    {"0.6.0", "bsdf", "coating roughcoating", "thickness:float sigmaA:rgb,spectrum,texture"},
    {"0.6.0", "bsdf", "bumpmap", "texture:texture"},
    {"0.6.0", "bsdf", "phong",
     "exponent:float,texture specularReflectance:rgb,texture diffuseReflectance:rgb,texture"},
    {"0.6.0", "bsdf", "ward",
     "variant:string alphaU:float,texture alphaV:float,texture specularReflectance:rgb,texture "
     "diffuseReflectance:rgb,texture"},
    {"0.6.0", "bsdf", "mixturebsdf", "weights:string"},
    {"0.6.0", "bsdf", "blendbsdf", "weight:float,texture"},
    {"0.6.0", "bsdf", "mask", "opacity:rgb,spectrum,texture"},
    {"0.6.0", "bsdf", "difftrans", "transmittance:rgb,spectrum,texture"},
    {"0.6.0", "bsdf", "hk",
     "material:string sigmaS:rgb,texture sigmaA:rgb,texture sigmaT:rgb,texture albedo:rgb,texture "
     "thickness:float phase:phase"},
    {"0.6.0", "bsdf", "irawan", "filename:string repeatU:float repeatV:float kd:rgb"},
    {"0.6.0", "texture", "bitmap",
     "filename:string wrapMode:string wrapModeU:string wrapModeV:string gamma:float filterType:string "
     "maxAnisotropy:float cache:boolean channel:string"},
    {"0.6.0", "texture", "bitmap checkerboard gridtexture",
     "uoffset:float voffset:float uscale:float vscale:float"},
    {"0.6.0", "texture", "checkerboard gridtexture", "color0:rgb,spectrum color1:rgb,spectrum"},
    {"0.6.0", "texture", "gridtexture", "lineWidth:float"},
    {"0.6.0", "texture", "scale", "scale:float,rgb"},
    {"0.6.0", "texture", "wireframe", "interiorColor:rgb edgeColor:rgb lineWidth:float stepWidth:float"},
    {"0.6.0", "texture", "curvature", "curvature:string scale:float"},
    {"0.6.0", "medium", "homogeneous",
     "material:string sigmaA:rgb,spectrum sigmaS:rgb,spectrum sigmaT:rgb,spectrum albedo:rgb,spectrum "
     "scale:float phase:phase strategy:string"},
    {"0.6.0", "medium", "heterogeneous",
     "method:string density:volume albedo:volume orientation:volume scale:float phase:phase"},
    {"0.6.0", "phase", "hg", "g:float"},
    {"0.6.0", "phase", "microflake", "stddev:float"},
    {"0.6.0", "phase", "mixturephase", "weights:string"},
    {"0.6.0", "volume", "constvolume", "value:float,rgb"},
    {"0.6.0", "volume", "gridvolume",
     "filename:string sendData:boolean toWorld:transform min:point max:point"},
    {"0.6.0", "volume", "volcache",
     "blockSize:integer voxelWidth:float memoryLimit:integer toWorld:transform volume:volume"},
    {"0.6.0", "emitter", "point area spot directional collimated sky sun sunsky envmap constant projector",
     "samplingWeight:float"},
    {"0.6.0", "emitter", "point spot directional collimated sky sun sunsky envmap", "toWorld:transform"},
    {"0.6.0", "emitter", "point", "position:point"},
    {"0.6.0", "emitter", "point spot", "intensity:rgb,spectrum"},
    {"0.6.0", "emitter", "area constant", "radiance:rgb,spectrum"},
    {"0.6.0", "emitter", "spot", "cutoffAngle:float beamWidth:float texture:texture"},
    {"0.6.0", "emitter", "directional", "direction:vector irradiance:rgb,spectrum"},
    {"0.6.0", "emitter", "collimated", "power:rgb,spectrum"},
    {"0.6.0", "emitter", "sky sun sunsky",
     "turbidity:float year:integer month:integer day:integer hour:float minute:float second:float "
     "latitude:float longitude:float timezone:float sunDirection:vector resolution:integer"},
    {"0.6.0", "emitter", "sky sunsky", "albedo:rgb,spectrum stretch:float"},
    {"0.6.0", "emitter", "sky sun envmap", "scale:float"},
    {"0.6.0", "emitter", "sun sunsky", "sunRadiusScale:float"},
    {"0.6.0", "emitter", "sunsky", "sunScale:float skyScale:float"},
    {"0.6.0", "emitter", "envmap", "filename:string gamma:float cache:boolean"},
    {"0.6.0", "sensor",
     "perspective thinlens orthographic telecentric spherical radiancemeter fluencemeter perspective_rdist",
     "toWorld:transform shutterOpen:float shutterClose:float"},
    {"0.6.0", "sensor", "irradiancemeter", "shutterOpen:float shutterClose:float"},
    {"0.6.0", "sensor", "perspective thinlens perspective_rdist",
     "focalLength:string fov:float fovAxis:string nearClip:float farClip:float"},
    {"0.6.0", "sensor", "orthographic telecentric", "nearClip:float farClip:float"},
    {"0.6.0", "sensor", "thinlens telecentric", "apertureRadius:float focusDistance:float"},
    {"0.6.0", "sensor", "perspective_rdist", "kc:string"},
    {"0.6.0", "integrator", "ao", "shadingSamples:integer rayLength:float"},
    {"0.6.0", "integrator", "direct",
     "shadingSamples:integer emitterSamples:integer bsdfSamples:integer strictNormals:boolean "
     "hideEmitters:boolean"},
    {"0.6.0", "integrator", "path volpath_simple volpath",
     "maxDepth:integer rrDepth:integer strictNormals:boolean hideEmitters:boolean"},
    {"0.6.0", "integrator", "bdpt photonmapper ppm sppm pssmlt mlt erpt ptracer vpl", "maxDepth:integer"},
    {"0.6.0", "integrator", "bdpt photonmapper ppm sppm pssmlt erpt ptracer", "rrDepth:integer"},
    {"0.6.0", "integrator", "bdpt", "lightImage:boolean sampleDirect:boolean"},
    {"0.6.0", "integrator", "photonmapper",
     "directSamples:integer glossySamples:integer globalPhotons:integer causticPhotons:integer "
     "volumePhotons:integer globalLookupRadius:float causticLookupRadius:float lookupSize:integer "
     "granularity:integer hideEmitters:boolean"},
    {"0.6.0", "integrator", "ppm sppm",
     "photonCount:integer initialRadius:float alpha:float granularity:integer maxPasses:integer"},
    {"0.6.0", "integrator", "pssmlt mlt", "directSamples:integer luminanceSamples:integer twoStage:boolean"},
    {"0.6.0", "integrator", "pssmlt", "bidirectional:boolean pLarge:float"},
    {"0.6.0", "integrator", "mlt erpt",
     "bidirectionalMutation:boolean lensPerturbation:boolean multiChainPerturbation:boolean "
     "causticPerturbation:boolean manifoldPerturbation:boolean lambda:float"},
    {"0.6.0", "integrator", "erpt",
     "numChains:float maxChains:float chainLength:integer directSamples:integer"},
    {"0.6.0", "integrator", "ptracer", "granularity:integer bruteForce:boolean"},
    {"0.6.0", "integrator", "adaptive", "maxError:float pValue:float maxSampleFactor:integer"},
    {"0.6.0", "integrator", "vpl", "shadowMapResolution:integer clamping:float"},
    {"0.6.0", "integrator", "irrcache",
     "resolution:integer quality:float gradients:boolean clampNeighbor:boolean clampScreen:boolean "
     "overture:boolean qualityAdjustment:float indirectOnly:boolean debug:boolean"},
    {"0.6.0", "integrator", "field", "field:string undefined:float"},
    {"0.6.0", "sampler", "independent stratified ldsampler halton hammersley sobol", "sampleCount:integer"},
    {"0.6.0", "sampler", "stratified ldsampler", "dimension:integer"},
    {"0.6.0", "sampler", "halton hammersley sobol", "scramble:integer"},
    {"0.6.0", "film", "hdrfilm tiledhdrfilm ldrfilm mfilm",
     "width:integer height:integer cropOffsetX:integer cropOffsetY:integer cropWidth:integer "
     "cropHeight:integer fileFormat:string pixelFormat:string highQualityEdges:boolean rfilter:rfilter"},
    {"0.6.0", "film", "hdrfilm tiledhdrfilm", "componentFormat:string attachLog:boolean banner:boolean"},
    {"0.6.0", "film", "ldrfilm",
     "tonemapMethod:string gamma:float exposure:float key:float burn:float banner:boolean"},
    {"0.6.0", "film", "mfilm", "digits:integer variable:string"},
    {"0.6.0", "rfilter", "box tent", "radius:float"},
    {"0.6.0", "rfilter", "gaussian", "stddev:float"},
    {"0.6.0", "rfilter", "mitchell", "B:float C:float"},
    {"0.6.0", "rfilter", "lanczos", "lobes:integer"},
    // ---- 3 ----
    {"3.0.0", "shape",
     "cube sphere cylinder rectangle disk obj ply serialized bsplinecurve linearcurve sdfgrid ellipsoids "
     "ellipsoidsmesh instance",
     "to_world:transform"},
    {"3.0.0", "shape", "cube sphere cylinder rectangle disk obj ply serialized", "flip_normals:boolean"},
    {"3.0.0", "shape",
     "cube sphere cylinder rectangle disk obj ply serialized bsplinecurve linearcurve sdfgrid",
     "silhouette_sampling_weight:float"},
    {"3.0.0", "shape", "sphere", "center:point radius:float"},
    {"3.0.0", "shape", "cylinder", "p0:point p1:point radius:float"},
    {"3.0.0", "shape", "obj ply serialized bsplinecurve linearcurve sdfgrid ellipsoids ellipsoidsmesh",
     "filename:string"},
    {"3.0.0", "shape", "obj ply serialized", "face_normals:boolean"},
    {"3.0.0", "shape", "obj ply", "flip_tex_coords:boolean"},
    {"3.0.0", "shape", "serialized", "shape_index:integer"},
    {"3.0.0", "shape", "sdfgrid", "normals:string watertight:boolean"},
    {"3.0.0", "shape", "ellipsoids ellipsoidsmesh", "scale_factor:float extent:float shell:string"},
    {"3.0.0", "bsdf", "diffuse", "reflectance:rgb,spectrum,texture"},
    {"3.0.0", "bsdf", "dielectric thindielectric roughdielectric plastic roughplastic",
     "int_ior:float,string ext_ior:float,string"},
    {"3.0.0", "bsdf", "dielectric thindielectric roughdielectric plastic roughplastic pplastic",
     "specular_reflectance:rgb,spectrum,texture"},
    {"3.0.0", "bsdf", "dielectric thindielectric roughdielectric",
     "specular_transmittance:rgb,spectrum,texture"},
    {"3.0.0", "bsdf", "conductor roughconductor",
     "material:string eta:rgb,spectrum,texture k:rgb,spectrum,texture "
     "specular_reflectance:rgb,spectrum,texture"},
    {"3.0.0", "bsdf", "roughconductor roughdielectric roughplastic pplastic",
     "distribution:string alpha:float,texture sample_visible:boolean"},
    {"3.0.0", "bsdf", "roughconductor roughdielectric", "alpha_u:float,texture alpha_v:float,texture"},
    {"3.0.0", "bsdf", "pplastic", "alpha_u:float alpha_v:float int_ior:float,string ext_ior:float,string"},
    {"3.0.0", "bsdf", "plastic roughplastic", "nonlinear:boolean"},
    {"3.0.0", "bsdf", "plastic roughplastic pplastic", "diffuse_reflectance:rgb,spectrum,texture"},
    {"3.0.0", "bsdf", "principled principledthin",
     "base_color:rgb,spectrum,texture roughness:float,texture anisotropic:float,texture "
     "spec_trans:float,texture spec_tint:float,texture sheen:float,texture sheen_tint:float,texture "
     "flatness:float,texture eta:float diffuse_reflectance_sampling_rate:float"},
    {"3.0.0", "bsdf", "principled",
     "metallic:float,texture specular:float clearcoat:float,texture clearcoat_gloss:float,texture "
     "main_specular_sampling_rate:float clearcoat_sampling_rate:float"},
    {"3.0.0", "bsdf", "principledthin",
     "diff_trans:float,texture specular_reflectance_sampling_rate:float "
     "specular_transmittance_sampling_rate:float diffuse_transmittance_sampling_rate:float"},
    {"3.0.0", "bsdf", "measured", "filename:string"},
    {"3.0.0", "bsdf", "hair",
     "eumelanin:float pheomelanin:float sigma_a:rgb scale:float int_ior:float,string ext_ior:float,string "
     "longitudinal_roughness:float azimuthal_roughness:float scale_tilt:float"},
    {"3.0.0", "bsdf", "mask", "opacity:float,texture"},
    {"3.0.0", "bsdf", "blendbsdf", "weight:float,texture"},
    {"3.0.0", "bsdf", "bumpmap", "texture:texture scale:float"},
    {"3.0.0", "bsdf", "normalmap", "normalmap:texture"},
    {"3.0.0", "bsdf", "bumpmap normalmap", "flip_invalid_normals:boolean use_shadowing_function:boolean"},
    {"3.0.0", "texture", "bitmap",
     "filename:string filter_type:string wrap_mode:string format:string raw:boolean accel:boolean"},
    {"3.0.0", "texture", "bitmap checkerboard", "to_uv:transform"},
    {"3.0.0", "texture", "checkerboard", "color0:rgb,spectrum,texture color1:rgb,spectrum,texture"},
    {"3.0.0", "texture", "mesh_attribute", "name:string scale:float"},
    {"3.0.0", "texture", "volume", "volume:volume"},
    {"3.0.0", "texture", "rawconstant", "value:float,rgb,vector"},
    {"3.0.0", "medium", "homogeneous heterogeneous",
     "albedo:float,rgb,spectrum,volume scale:float sample_emitters:boolean phase:phase"},
    {"3.0.0", "medium", "homogeneous", "sigma_t:float,rgb,spectrum has_spectral_extinction:boolean"},
    {"3.0.0", "medium", "heterogeneous", "sigma_t:float,volume"},
    {"3.0.0", "phase", "hg", "g:float"},
    {"3.0.0", "phase", "blendphase", "weight:float,volume"},
    {"3.0.0", "phase", "sggx", "S:volume"},
    {"3.0.0", "phase", "tabphase", "values:string"},
    {"3.0.0", "volume", "constvolume", "value:float,rgb,spectrum"},
    {"3.0.0", "volume", "gridvolume",
     "filename:string use_grid_bbox:boolean to_world:transform wrap_mode:string filter_type:string "
     "raw:boolean "
     "accel:boolean"},
    {"3.0.0", "emitter", "point area spot directional envmap constant projector sunsky",
     "sampling_weight:float"},
    {"3.0.0", "emitter", "point spot directional envmap projector sunsky timed_sunsky", "to_world:transform"},
    {"3.0.0", "emitter", "point", "position:point"},
    {"3.0.0", "emitter", "point spot", "intensity:float,rgb,spectrum"},
    {"3.0.0", "emitter", "area", "radiance:float,rgb,spectrum,texture"},
    {"3.0.0", "emitter", "constant directionalarea", "radiance:float,rgb,spectrum"},
    {"3.0.0", "emitter", "spot", "cutoff_angle:float beam_width:float texture:texture"},
    {"3.0.0", "emitter", "directional", "direction:vector irradiance:float,rgb,spectrum"},
    {"3.0.0", "emitter", "envmap", "filename:string scale:float mis_compensation:boolean"},
    {"3.0.0", "emitter", "projector",
     "irradiance:rgb,spectrum,texture scale:float fov:float focal_length:string fov_axis:string"},
    {"3.0.0", "emitter", "sunsky",
     "turbidity:float albedo:rgb,spectrum latitude:float longitude:float timezone:float year:integer "
     "month:integer day:integer hour:float minute:float second:float sun_direction:vector sun_scale:float "
     "sky_scale:float sun_aperture:float"},
    {"3.0.0", "sensor", "perspective thinlens orthographic distant radiancemeter batch",
     "to_world:transform"},
    {"3.0.0", "sensor", "perspective thinlens orthographic radiancemeter irradiancemeter batch distant",
     "srf:spectrum,rgb"},
    {"3.0.0", "sensor", "perspective thinlens",
     "fov:float focal_length:string fov_axis:string near_clip:float far_clip:float "
     "principal_point_offset_x:float principal_point_offset_y:float"},
    {"3.0.0", "sensor", "perspective thinlens orthographic irradiancemeter distant",
     "shutter_open:float shutter_close:float"},
    {"3.0.0", "sensor", "orthographic", "near_clip:float far_clip:float"},
    {"3.0.0", "sensor", "thinlens", "aperture_radius:float focus_distance:float"},
    {"3.0.0", "sensor", "radiancemeter", "origin:point direction:vector"},
    {"3.0.0", "sensor", "distant", "direction:vector target:point"},
    {"3.0.0", "integrator", "direct",
     "shading_samples:integer emitter_samples:integer bsdf_samples:integer hide_emitters:boolean"},
    {"3.0.0", "integrator", "path volpath volpathmis ptracer",
     "max_depth:integer rr_depth:integer hide_emitters:boolean samples_per_pass:integer timeout:float "
     "block_size:integer"},
    {"3.0.0", "integrator", "volpathmis", "use_spectral_mis:boolean"},
    {"3.0.0", "integrator", "aov", "aovs:string integrator:integrator"},
    {"3.0.0", "integrator", "moment", "integrator:integrator"},
    {"3.0.0", "sampler", "independent stratified multijitter orthogonal ldsampler",
     "sample_count:integer seed:integer"},
    {"3.0.0", "sampler", "stratified multijitter orthogonal", "jitter:boolean"},
    {"3.0.0", "sampler", "orthogonal", "strength:integer"},
    {"3.0.0", "film", "hdrfilm",
     "width:integer height:integer file_format:string pixel_format:string component_format:string "
     "crop_offset_x:integer crop_offset_y:integer crop_width:integer crop_height:integer "
     "sample_border:boolean compensate:boolean rfilter:rfilter"},
    {"3.0.0", "rfilter", "box tent", "radius:float"},
    {"3.0.0", "rfilter", "gaussian", "stddev:float"},
    {"3.0.0", "rfilter", "mitchell", "A:float B:float C:float"},
    {"3.0.0", "rfilter", "lanczos", "lobes:integer"},
};

std::string element_of(const std::string& category, const std::string& name, const std::string& element) {
  const std::string named = "<" + element + " name='" + name + "' ";
  if (element == "boolean") return named + "value='true'/>";
  if (element == "integer")
    return named + "value='" + (name == "year" ? "2015" : name == "resolution" ? "64" : "2") + "'/>";
  if (element == "rgb") return named + "value='0.5 0.4 0.3'/>";
  if (element == "srgb") return named + "value='#808080'/>";
  if (element == "point" || element == "vector") return named + "x='0.1' y='1' z='0.2'/>";
  if (element == "transform") return named + "><scale value='2'/></transform>";
  if (element == "texture") return named + "type='checkerboard'/>";
  if (element == "volume") return named + "type='constvolume'/>";
  if (element == "phase") return named + "type='hg'/>";
  if (element == "rfilter") return named + "type='box'/>";
  if (element == "integrator") return named + "type='path'/>";
  if (element == "float" || element == "spectrum")
    return named + "value='" + (name == "turbidity" || name == "stretch" ? "1.5" : "0.5") + "'/>";
  // Strings.
  static const std::map<std::string, std::string> values = {
      {"filename", "mesh.obj"},  {"distribution", "ggx"},    {"int_ior", "water"},
      {"ext_ior", "air"},        {"ext_eta", "air"},         {"weights", "0.3, 0.6"},
      {"variant", "ward"},       {"wrap_mode", "clamp"},     {"wrap_mode_u", "clamp"},
      {"wrap_mode_v", "mirror"}, {"filter_type", "nearest"}, {"channel", "r"},
      {"focal_length", "35mm"},  {"fov_axis", "y"},          {"name", "vertex_color"},
      {"aovs", "d:depth"},       {"values", "0.2, 0.5, 1.0"}};
  const std::string snake = text::snake_case(name);
  if (snake == "material") return named + (category == "bsdf" ? "value='Au'/>" : "value='skin2'/>");
  const auto value = values.find(snake);
  return named + "value='" + (value == values.end() ? "x" : value->second) + "'/>";
}

enum class Outcome { understood, told, silent, refused };

struct Case {
  std::string version, category, plugin, parameter, element;
};

Outcome outcome_of(const Case& c, std::string& said) {
  std::string element = element_of(c.category, c.parameter, c.element);
  if (c.plugin == "hk" && c.parameter == "material") element = "<string name='material' value='skin2'/>";
  // Parameters that Mitsuba wants together.
  static const std::map<std::string, std::string> partner = {
      {"sigmaA", "<rgb name='sigmaS' value='1'/>"},
      {"sigmaS", "<rgb name='sigmaA' value='1'/>"},
  };
  if ((c.category == "medium" || c.plugin == "hk") && partner.contains(c.parameter))
    element += partner.at(c.parameter);
  if (c.plugin == "radiancemeter" && c.parameter == "origin")
    element += "<vector name='direction' value='0, 0, 1'/>";
  std::set<std::string> given = {c.parameter};
  if (c.version[0] == '3' && c.plugin == "thinlens" && c.parameter != "aperture_radius") {
    element += "<float name='aperture_radius' value='0.1'/>";
    given.insert("aperture_radius");
  }
  if (c.plugin == "heightfield" && c.parameter == "texture") given.insert("filename");
  const std::string body =
      smallest_scene(c.category, c.plugin, element + required_contents(c.category, c.plugin, given));
  const auto lenient = read_smallest(c.version, body, true);
  if (!lenient.ok()) {
    said = lenient.error().to_string();
    return Outcome::refused;
  }
  // Notes that the plugin has without the parameter say nothing of it, unless another plugin stands in.
  std::set<std::string> always;
  if (find_plugin(c.category, canonical_plugin(c.category, c.plugin)) != nullptr) {
    const auto bare = read_smallest(
        c.version, smallest_scene(c.category, c.plugin, required_contents(c.category, c.plugin)), true);
    if (bare.ok())
      for (const Note& note : bare->description.notes) always.insert(note.text);
  }
  const auto names_it = [&](const ReadScene& read) {
    for (const Note& note : read.description.notes)
      for (const std::string& name : {c.parameter, text::snake_case(c.parameter), c.plugin,
                                      std::string(canonical_plugin(c.category, c.plugin))})
        if (!always.contains(note.text) && note.text.find("'" + name + "'") != std::string::npos) {
          said = note.text;
          return true;
        }
    return false;
  };
  if (names_it(*lenient)) return Outcome::told;
  return read_smallest(c.version, body, false).ok() ? Outcome::understood : Outcome::silent;
}

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const Manual& manual : kManuals) {
    std::istringstream plugins(manual.plugins);
    for (std::string plugin; plugins >> plugin;) {
      std::istringstream parameters(manual.parameters);
      for (std::string parameter; parameters >> parameter;) {
        const std::size_t colon = parameter.find(':');
        std::istringstream elements(parameter.substr(colon + 1));
        for (std::string element; std::getline(elements, element, ',');)
          cases.push_back({manual.version, manual.category, plugin, parameter.substr(0, colon), element});
      }
    }
  }
  return cases;
}

// Parameters of plugins that Candela has, and that it does not follow: a warning tells of each. A parameter
// that is understood leaves the list; no other joins it.
const std::set<std::string> kTold = {
    // 0.6's own decoding of an environment's file; how an image is shown; a corner alone, whose window
    // leaves the film (of an mfilm, which is one pixel, a size too)
    "envmap gamma <float>",
    "hdrfilm cropOffsetX <integer>",
    "hdrfilm cropOffsetY <integer>",
    "hdrfilm crop_offset_x <integer>",
    "hdrfilm crop_offset_y <integer>",
    "ldrfilm burn <float>",
    "ldrfilm cropOffsetX <integer>",
    "ldrfilm cropOffsetY <integer>",
    "ldrfilm exposure <float>",
    "ldrfilm gamma <float>",
    "ldrfilm key <float>",
    "ldrfilm tonemapMethod <string>",
    "mfilm cropHeight <integer>",
    "mfilm cropOffsetX <integer>",
    "mfilm cropOffsetY <integer>",
    "mfilm cropWidth <integer>",
    "mfilm digits <integer>",
    "mfilm variable <string>",
    // fibers; Mitsuba 3's page, whose program reads B and C; roughness of layers
    "heterogeneous orientation <volume>",
    "mitchell A <float>",
    "roughcoating alpha <texture>",
    // what needs wavelengths
    "orthographic srf <rgb>",
    "orthographic srf <spectrum>",
    "perspective srf <rgb>",
    "perspective srf <spectrum>",
    "thinlens srf <rgb>",
    "thinlens srf <spectrum>",
};

// Claim: no parameter that the manuals document keeps a scene from being read with --lenient, and none is
// passed over without a word that names it or its plugin.
TEST(DescriptionParameters, EveryDocumentedParameterIsUnderstoodOrTold) {
  int understood = 0, told = 0;
  std::set<std::string> told_of_known;
  for (const Case& c : all_cases()) {
    std::string said;
    const Outcome outcome = outcome_of(c, said);
    const std::string name =
        c.version + " " + c.category + " " + c.plugin + " " + c.parameter + " <" + c.element + ">: ";
    EXPECT_NE(outcome, Outcome::refused) << name << said;
    EXPECT_NE(outcome, Outcome::silent) << name << "it is passed over without a word";
    if (outcome == Outcome::told &&
        find_plugin(c.category, canonical_plugin(c.category, c.plugin)) != nullptr)
      told_of_known.insert(c.plugin + " " + c.parameter + " <" + c.element + ">");
    understood += outcome == Outcome::understood;
    told += outcome == Outcome::told;
  }
  EXPECT_EQ(told_of_known, kTold);
  std::printf("%d documented parameters are understood, %d are told\n", understood, told);
  EXPECT_GE(understood, 850);
}

}  // namespace
}  // namespace candela::description
