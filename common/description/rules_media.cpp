// Media, phase functions and volumes, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {
namespace {

std::vector<PropertyRule> medium_properties(std::string_view extinction) {
  return {
      value("albedo", {rgb},
            "fraction of the extinction that is scattering, or a <volume> of this name (default 0.75)", 0, 1),
      non_negative_rgb("sigma_t", extinction), value("scale", {number}, "factor of sigma_t (default 1)", 0),
      ignored("sample_emitters", {boolean}, "changes only noise"),
      ignored("has_spectral_extinction", {boolean}, "changes only noise")};
}

}  // namespace

void add_media(std::vector<PluginRule>& table) {
  Plugins media(table, "medium", {"phase", "volume"}), phases(table, "phase"), volumes(table, "volume");
  media.add("homogeneous", "the same everywhere; bounded by shapes that name it `interior` or `exterior`",
            medium_properties("extinction per scene unit (default 1)"), {"phase", "volume"});
  media.add("heterogeneous",
            "varies in space as its volumes do; a grid of sigma_t is empty beyond its box, turned with its "
            "to_world (Mitsuba: the box around that)",
            medium_properties("extinction per scene unit, or a <volume> of this name (default 1)"),
            {"phase", "volume"});
  phases.add("isotropic", "scatters evenly into all directions; a medium's default", {});
  phases.add("hg", "Henyey and Greenstein's",
             {value("g", {number}, "mean cosine: above 0 scatters forward, below 0 back (default 0.8)",
                    -0.99999, 0.99999)});
  phases.add("rayleigh", "scattering by particles much smaller than the wavelength, without polarization",
             {});
  phases.add(
      "blendphase",
      "a mixture of two phase functions, which may be mixtures, of up to four in all; 0.6's "
      "`mixturephase` is read as such",
      {required(value("weight", {number},
                      "weight of the second; the first has the rest; a number, or a constvolume of this name",
                      0, 1))},
      {"phase"});
  volumes.add("constvolume", "the same value everywhere",
              {non_negative_rgb("value", "(default 1)"),
               ignored("to_world", {transform}, "the value is the same everywhere")});
  volumes.add(
      "gridvolume", "values on a grid from a file; not negative",
      {file("Mitsuba's .vol file, version 3: float32, float16 or uint8 (0 to 255 is 0 to 1), 1 or 3 "
            "channels; or, if all machines have OpenVDB, a .vdb file: a grid of floats, doubles, halves "
            "(1 channel) or vectors (3), in the box around its active voxels, at most 2^30 values, with "
            "the background value elsewhere; or a .nvdb file of NanoVDB 32 with grids of floats, plain "
            "or ZIP. OpenVDB is not made for files of strangers: trust a .vdb file less than a .vol"),
       value("grid", {string},
             "Candela's addition: name of the grid in a .vdb file (default: the only one, or density) "
             "or a .nvdb file (default: the first)"),
       to_world("places the unit cube [0, 1]^3 that the grid fills (default identity)"),
       flag("use_grid_bbox",
            "the grid fills the file's bounding box, before to_world (default false); that of a .vdb "
            "file reaches half a voxel beyond its outermost active voxels; its transform may only scale "
            "and move"),
       value("offset", {integer},
             "Candela's addition: start of the MakeNamedMedium directive in a file of a pbrt scene, "
             "in bytes",
             0),
       non_negative_rgb("factor", "Candela's addition: factor of the values (default 1)"),
       choice("filter_type", {"trilinear", "nearest"},
              "interpolation between the centers of cells (default trilinear)"),
       choice("wrap_mode", {"clamp", "repeat", "mirror", "zero"},
              "beyond the grid's outermost centers (default clamp); zero, as in pbrt, is Candela's "
              "addition"),
       ignored("raw", {boolean}, "colors are linear here either way"),
       ignored("accel", {boolean}, "for GPUs only"),
       ignored("max_value", {number}, "the maximum is found in the data")});
}

}  // namespace candela::description::rules
