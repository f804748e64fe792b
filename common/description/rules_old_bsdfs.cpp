// Bsdfs of Mitsuba 0.6 that Mitsuba 3 lacks, from its documentation.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_old_bsdfs(std::vector<PluginRule>& table) {
  Plugins bsdfs(table, "bsdf");
  const PropertyRule thickness =
      value("thickness", {number}, "thickness of the layer, in the unit of the coefficients (default 1)", 0);
  const auto coefficient = [](std::string_view name, std::string_view doc) {
    return textured(non_negative_rgb(name, doc));
  };
  bsdfs.add("roughdiffuse", "0.6's model of Oren and Nayar 1994, one-sided",
            {reflectance("reflectance", "albedo of the facets (default 0.5)"),
             textured(value("alpha", {number}, "root mean square slope of the facets (default 0.2)", 0)),
             flag("use_fast_approx",
                  "leaves out light between facets: the short form of the model (default false)")});
  bsdfs.add("difftrans", "0.6's diffuse transmitter: light leaves the other side in all directions alike",
            {reflectance("transmittance", "fraction that passes (default 0.5)"),
             reflectance("reflectance",
                         "Candela's addition: fraction that is reflected (default 0); "
                         "if textures add up to more than 1, less passes")});
  bsdfs.add(
      "hk",
      "0.6's thin layer after Hanrahan and Krueger 1993: light scattered once, and light that passes "
      "straight on",
      {coefficient("sigma_s", "scattering; together with sigma_a"), coefficient("sigma_a", "absorption"),
       coefficient("sigma_t", "extinction, if sigma_s and sigma_a are absent (default 1)"),
       reflectance("albedo", "with sigma_t: the part that is scattered (default 0.75)"), thickness},
      {"phase"},
      "0.6 multiplies scattered light by the cosine of the viewer's direction again: its layer "
      "is darker and not reciprocal");
  const std::vector<PropertyRule> layer = {
      above(value("int_ior", {number, string}, "index of the layer, a number or a name (default bk7, 1.5046)",
                  0)),
      above(
          value("ext_ior", {number, string}, "index outside, a number or a name (default air, 1.000277)", 0)),
      thickness, coefficient("sigma_a", "absorption in the layer (default 0)"),
      reflectance("specular_reflectance", "scales the reflection of the layer (default 1)")};
  std::vector<PropertyRule> rough_layer = layer;
  rough_layer.push_back(
      choice("distribution", {"beckmann", "ggx"}, "microfacet distribution (default beckmann)"));
  rough_layer.push_back(positive("alpha", "roughness of the layer (default 0.1)"));
  rough_layer.push_back(
      flag("sample_visible", "samples visible normals only; changes only noise (default true)"));
  bsdfs.add("roughcoating",
            "0.6's rough layer on one opaque bsdf; light is refracted as by a smooth layer, "
            "and light that the layer reflects back down is lost",
            std::move(rough_layer), {"bsdf"});
  bsdfs.add("coating",
            "0.6's smooth layer on one opaque bsdf; light that the layer reflects back down is lost", layer,
            {"bsdf"});
}

}  // namespace candela::description::rules
