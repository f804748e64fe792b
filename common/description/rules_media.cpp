// Media, phase functions and volumes, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {
namespace {

PropertyRule to_local(std::string_view doc) {
  return {.name = "to_world", .types = {transform}, .doc = doc};
}

std::vector<PropertyRule> medium_properties(std::string_view extinction) {
  return {{.name = "albedo",
           .types = {rgb},
           .doc = "fraction of the extinction that is scattering, or a <volume> of this name (default 0.75)",
           .minimum = 0,
           .maximum = 1},
          {.name = "sigma_t", .types = {rgb}, .doc = extinction, .minimum = 0},
          {.name = "scale", .types = {number}, .doc = "factor of sigma_t (default 1)", .minimum = 0},
          ignored("sample_emitters", {boolean}, "changes only noise"),
          ignored("has_spectral_extinction", {boolean}, "changes only noise")};
}

}  // namespace

void add_media(std::vector<PluginRule>& table) {
  table.push_back({.category = "medium",
                   .name = "homogeneous",
                   .properties = medium_properties("extinction per scene unit (default 1)"),
                   .child_categories = {"phase", "volume"},
                   .doc = "the same everywhere; bounded by shapes that name it `interior` or `exterior`"});
  table.push_back(
      {.category = "medium",
       .name = "heterogeneous",
       .properties = medium_properties("extinction per scene unit, or a <volume> of this name (default 1)"),
       .child_categories = {"phase", "volume"},
       .doc = "varies in space as its volumes do; a grid of sigma_t is empty beyond its box, turned with its "
              "to_world (Mitsuba: the box around that)"});
  table.push_back({.category = "phase",
                   .name = "isotropic",
                   .properties = {},
                   .child_categories = {},
                   .doc = "scatters evenly into all directions; a medium's default"});
  table.push_back({.category = "phase",
                   .name = "hg",
                   .properties = {{.name = "g",
                                   .types = {number},
                                   .doc = "mean cosine: above 0 scatters forward, below 0 back (default 0.8)",
                                   .minimum = -0.99999,
                                   .maximum = 0.99999}},
                   .child_categories = {},
                   .doc = "Henyey and Greenstein's"});
  table.push_back({.category = "phase",
                   .name = "rayleigh",
                   .properties = {},
                   .child_categories = {},
                   .doc = "scattering by particles much smaller than the wavelength, without polarization"});
  table.push_back(
      {.category = "phase",
       .name = "blendphase",
       .properties =
           {{.name = "weight",
             .types = {number},
             .required = true,
             .doc = "weight of the second; the first has the rest; a number, or a constvolume of this name",
             .minimum = 0,
             .maximum = 1}},
       .child_categories = {"phase"},
       .doc = "a mixture of two phase functions, which may be mixtures, of up to four in all; 0.6's "
              "`mixturephase` is read as such"});
  table.push_back({.category = "volume",
                   .name = "constvolume",
                   .properties = {{.name = "value", .types = {rgb}, .doc = "(default 1)", .minimum = 0},
                                  ignored("to_world", {transform}, "the value is the same everywhere")},
                   .child_categories = {},
                   .doc = "the same value everywhere"});
  table.push_back(
      {.category = "volume",
       .name = "gridvolume",
       .properties =
           {file("Mitsuba's .vol file, version 3: float32, float16 or uint8 (0 to 255 is 0 to 1), 1 or 3 "
                 "channels; or, if all machines have OpenVDB, a .vdb file: a grid of floats, doubles, halves "
                 "(1 channel) or vectors (3), in the box around its active voxels, at most 2^30 values, with "
                 "the background value elsewhere; or a .nvdb file of NanoVDB 32 with grids of floats, plain "
                 "or ZIP. OpenVDB is not made for files of strangers: trust a .vdb file less than a .vol"),
            {.name = "grid",
             .types = {string},
             .doc = "Candela's addition: name of the grid in a .vdb file (default: the only one, or density) "
                    "or a .nvdb file (default: the first)"},
            to_local("places the unit cube [0, 1]^3 that the grid fills (default identity)"),
            flag("use_grid_bbox",
                 "the grid fills the file's bounding box, before to_world (default false); that of a .vdb "
                 "file reaches half a voxel beyond its outermost active voxels; its transform may only scale "
                 "and move"),
            {.name = "offset",
             .types = {integer},
             .doc = "Candela's addition: start of the MakeNamedMedium directive in a file of a pbrt scene, "
                    "in bytes",
             .minimum = 0},
            {.name = "factor",
             .types = {rgb},
             .doc = "Candela's addition: factor of the values (default 1)",
             .minimum = 0},
            {.name = "filter_type",
             .types = {string},
             .values = {"trilinear", "nearest"},
             .doc = "interpolation between the centers of cells (default trilinear)"},
            {.name = "wrap_mode",
             .types = {string},
             .values = {"clamp", "repeat", "mirror", "zero"},
             .doc = "beyond the grid's outermost centers (default clamp); zero, as in pbrt, is Candela's "
                    "addition"},
            ignored("raw", {boolean}, "colors are linear here either way"),
            ignored("accel", {boolean}, "for GPUs only"),
            ignored("max_value", {number}, "the maximum is found in the data")},
       .child_categories = {},
       .doc = "values on a grid from a file; not negative"});
}

}  // namespace candela::description::rules
