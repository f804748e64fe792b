// Bsdfs, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_bsdfs(std::vector<PluginRule>& table) {
  const auto index_of_refraction = [](std::string_view name, std::string_view doc) {
    return PropertyRule{
        .name = name, .types = {number, string}, .doc = doc, .minimum = 0, .above_minimum = true};
  };
  const PropertyRule specular = reflectance("specular_reflectance", "scales the reflection (default 1)");
  const PropertyRule eta =
      textured(non_negative_rgb("eta", "real part of the index of refraction (default 0)"));
  const PropertyRule k =
      textured(non_negative_rgb("k", "imaginary part of the index of refraction (default 1)"));
  const PropertyRule material = {.name = "material",
                                 .types = {string},
                                 .doc =
                                     "a metal by name (see below) in place of eta and k; none: a "
                                     "perfect mirror (default none; before version 2 Cu)"};
  table.push_back({.category = "bsdf",
                   .name = "diffuse",
                   .properties = {reflectance("reflectance", "albedo (default 0.5)")},
                   .child_categories = {},
                   .doc = "Lambertian, one-sided"});
  table.push_back(
      {.category = "bsdf",
       .name = "dielectric",
       .properties = {index_of_refraction("int_ior",
                                          "index inside, a number or a name (default bk7, 1.5046)"),
                      index_of_refraction("ext_ior",
                                          "index outside, a number or a name (default air, 1.000277)"),
                      specular, reflectance("specular_transmittance", "scales the transmission (default 1)")},
       .child_categories = {},
       .doc = "smooth glass; the side the normal points to is outside"});
  table.push_back({.category = "bsdf",
                   .name = "conductor",
                   .properties = {eta, k, material, specular},
                   .child_categories = {},
                   .doc = "smooth metal, one-sided; without parameters a perfect mirror"});
  table.push_back(
      {.category = "bsdf",
       .name = "roughconductor",
       .properties =
           {{.name = "distribution",
             .types = {string},
             .values = {"beckmann", "ggx"},
             .doc = "microfacet distribution (default beckmann)"},
            textured(positive("alpha",
                              "roughness along both axes; Beckmann: root mean square slope (default 0.1)")),
            textured(positive("alpha_u",
                              "roughness along the tangent; only together with alpha_v, without alpha")),
            textured(positive("alpha_v",
                              "roughness along the bitangent; only together with alpha_u, without alpha")),
            eta,
            k,
            material,
            specular,
            flag("sample_visible", "sample visible normals only: noise, not the mean (default true)")},
       .child_categories = {},
       .doc = "rough metal after Walter et al. 2007, one-sided"});
  table.push_back({.category = "bsdf",
                   .name = "null",
                   .properties = {},
                   .child_categories = {},
                   .doc = "lets all light pass straight on; bounds a medium"});
  table.push_back({.category = "bsdf",
                   .name = "mask",
                   .properties = {textured({.name = "opacity",
                                            .types = {number},
                                            .doc = "fraction of the light that meets the bsdf (default 0.5)",
                                            .minimum = 0,
                                            .maximum = 1})},
                   .child_categories = {"bsdf"},
                   .doc = "one bsdf, and what its opacity leaves passes straight on"});
  table.push_back({.category = "bsdf",
                   .name = "blendbsdf",
                   .properties = {textured({.name = "weight",
                                            .types = {number},
                                            .doc = "of the second bsdf; the first has the rest (default 0.5)",
                                            .minimum = 0,
                                            .maximum = 1})},
                   .child_categories = {"bsdf"},
                   .doc = "two bsdfs mixed by a weight"});
  table.push_back({.category = "bsdf",
                   .name = "twosided",
                   .properties = {},
                   .child_categories = {"bsdf"},
                   .doc = "one opaque bsdf for both sides, or two: front, then back"});
}

}  // namespace candela::description::rules
