// Facts about a scene, found once after loading. Only a Plan draws conclusions from them.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace candela::scene {

// Place of a shape in the scene's files.
struct ShapePlace {
  std::string file;
  int line = 0;
  std::string id;  // may be empty
};

struct SceneFeatures {
  std::uint64_t triangles = 0;
  std::uint32_t spheres = 0, disks = 0, cylinders = 0;
  std::uint32_t instances = 0;  // of shapegroups, whose shapes are counted once
  std::uint32_t shapes = 0;
  std::uint64_t dropped_faces = 0;  // of meshes: without area, or with fewer than three corners
  std::map<std::string, std::uint32_t>
      bsdf_kinds;  // kind -> number of shapes wearing it (inside of composites)
  std::map<std::string, std::uint32_t> emitter_kinds;  // kind -> number
  std::uint32_t textures = 0;
  bool any_color = false;  // a spectrum that is not gray, or a picture, which may not be
  bool any_delta_bsdf = false;
  bool all_bsdfs_delta = false;
  bool any_rough_glossy = false;  // roughness below 0.2
  bool any_transmission = false;
  bool any_passthrough = false;     // some surface lets light pass straight on: null, mask, thin glass
  bool any_environment = false;     // constant or envmap
  float environment_variation = 0;  // the greatest of any environment's: see Environment::variation
  bool any_delta_emitter = false;   // point, directional
  bool any_area_emitter = false;
  bool any_mesh_emitter = false;  // an area emitter whose sampling chooses a triangle first
  bool any_rectangle_emitter = false;
  bool any_textured_emitter = false;  // an area emitter whose radiance varies
  float largest_area_emitter = 0;     // its extent: the diagonal of its bounding box
  std::uint32_t media = 0;
  bool any_scattering_medium = false;
  bool any_heterogeneous_medium = false;
  bool endless_medium = false;  // around the scene: no light from outside gets in
  // For the medium in which light scatters longest: the fraction of a walk's second moment that is left after
  // one more scattering, and what it is across in mean free paths (thick_medium.h).
  float lasting_fraction = 0, lasting_thickness = 0;
  bool any_black_bsdf = false;  // absorbs all: paths end there
  bool any_two_sided = false;
  bool finite_lens = false;  // camera rays depend on a point on the lens
  std::uint32_t emitters = 0, environments = 0;
  std::uint32_t infinite_emitters = 0;  // environments and directional: infinitely far away
  float radius = 0;                     // of the bounding sphere
  float largest_coordinate = 0;         // in magnitude, of the corners of the scene's bounding box
  float max_emitted_radiance = 0;       // luminance, a scale for films of scenes whose pilot finds no light
  // Pairs of shapes that let light through or bound media, and lie over each other in one plane; a few.
  std::vector<std::pair<ShapePlace, ShapePlace>> shared_faces;
  // The job has layers by light path expressions: its kernels are those that know letters.
  bool reads_letters = false;
  // One line for each edit of the job: what it does.
  std::vector<std::string> edits;
};

}  // namespace candela::scene
