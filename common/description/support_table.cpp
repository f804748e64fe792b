// docs/scenes.md, written from the vocabulary: the page cannot say anything else than the loader does.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "common/description/conductors.h"
#include "common/description/media_presets.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr std::string_view introduction = R"(# Scenes

<!-- Generated from common/description/vocabulary.cpp by support_table_markdown(); a test compares the two. -->

Candela reads Mitsuba XML and [pbrt's scenes](pbrt.md). Plugins and parameters mean what Mitsuba documents; this page
lists those that Candela knows. Anything else is an error that names the file, the line and the nearest known name,
except for [what is passed over](#what-is-passed-over).

## The file

- `<scene version="3.0.0">` is read as Mitsuba 3's. With a version before 2 (`version="0.6.0"`) it is read as 0.6's
  ([differences](#where-mitsubas-versions-differ)), and names are translated:
  - `toWorld`, `intIOR`, `sampleCount` become `to_world`, `int_ior`, `sample_count`; `wrapModeU` and `wrapModeV`
    `wrap_mode`; the filters `ewa` and `trilinear` `bilinear`; the distributions `phong` and `as` `beckmann`; a
    `mixturebsdf` `blendbsdf`s;
  - `uscale`, `uoffset` and their like become a `to_uv` transform that looks up at `uv * scale + offset`;
  - `sigmaA` and `sigmaS` become `sigma_t` and `albedo`, a medium's volume `density` its `sigma_t`, `densityMultiplier`
    its `scale`; a homogeneous medium's `material` becomes measured coefficients;
  - grids fill the bounding box of their file, or the box from `min` to `max`; the `scale` of a `sunsky` is that of both
    parts; `extEta` divides the `eta` and `k` of conductors.
- If a parameter or a texture is given twice, the later one counts, with a warning.
- Values: `<boolean>`, `<integer>`, `<float>`, `<string>`, `<point>` and `<vector>` (`x`, `y`, `z`, or `value`), `<rgb>`
  (linear Rec.709: one or three numbers; `#rrggbb` is decoded from sRGB, before version 2 it is linear), `<srgb>`.
- Spectra become linear Rec.709 when the scene is read, as in Mitsuba's RGB variants: `<spectrum value="0.5"/>`,
  `<spectrum value="400:0.1, 500:0.2"/>` (nanometers and value, linear between them, zero outside),
  `<spectrum filename="x.spd"/>` (lines of the same two numbers), `<spectrum type="..."/>` (see below; a texture's type is
  that texture) and 0.6's `<blackbody temperature="5000K" scale="1"/>`. Inside an emitter a spectrum is weighed by the
  CIE 1931 observer, so a density of 1 has luminance 1; elsewhere also by D65, so a flat one is neutral. Negative
  components become 0, reflectances above 1 become 1. One number inside an emitter is light of equal power at all
  wavelengths, which is not white; before version 2 it is a multiple of white.
- `<transform>` holds `<translate>`, `<rotate>` (degrees), `<scale>`, `<lookat>` and `<matrix>` (16 or 9 numbers, row by
  row); each acts after those before it. A transform must be affine and invertible.
- `<default name="spp" value="16"/>` gives `$spp` a value unless the command line does (`-D spp=64`). Every attribute may
  hold parameters; the longest known name counts; `\$` is a dollar sign. A `-D` that the scene does not use is an error.
- `<ref id="..."/>` uses an object of any place in the scene; `<alias id="..." as="..."/>` gives an object above it
  another id. `<include filename="..."/>` inserts another scene file, or one object.
- Files are searched in the folders of `<path value="..."/>` (the last one first), then in the main scene file's folder,
  then in the folder of the included file that names them. All must be there when a job is submitted.
- A surface without a `<bsdf>` is `diffuse`. An emitter `area` at the top of the scene glows in the shapes that refer to it.
- A scene without an integrator has `direct` before version 2, later `path`, with a warning. The integrator `direct` is
  `path` with a `max_depth` of 2. If an unknown integrator holds another one (`aov`, `moment`), that one runs; the `aovs`
  of `aov` become [AOVs](aovs.md), unless `--aov` says otherwise. `lpe` and `edits` are ours: the integrator inside them
  runs, with [layers](layers.md) or [edits](edits.md). The films `ldrfilm` and `mfilm` are read as `hdrfilm`.

## Where Mitsuba's versions differ

| what | before version 2, as 0.6 | from version 2, as 2 and 3 |
|---|---|---|
| `roughplastic` | light that masking keeps in the coat comes out later: white stays white | it is lost: white is 0.98, 0.93, 0.88 and 0.74 at ggx, `alpha` 0.05, 0.1, 0.15 and 0.3 |
| `conductor`, `roughconductor` without parameters | copper | a perfect mirror |
| `bumpmap`, `normalmap` | the normal is tilted | as Mitsuba 3.7: invalid normals are flipped, facets shadow |
| `homogeneous` | missing coefficients are those of `material` (default `skin1`), 100 times the values per millimeter, as 0.6's program has it, against its manual; the medium's `g` reduces the scattering | albedo 0.75, sigma_t 1 |
| media around the camera | begin at the camera | begin at the near plane |
| colors of `ply` vertices | sRGB | sRGB if integers |
| `#rrggbb` in `<rgb>` | linear | sRGB |
| one number in an emitter's `<spectrum>` | white | equal power, which is not white |
| several sensors | the last | the first |
| no integrator | `direct` | `path` |
| no emitter | a `sunsky` at scale 2 with a sun 15 times as wide (below the horizon dark, unlike 0.6) | black |
| unknown parameters of known plugins | passed over | errors |

In all files, though the programs differ: `ewa` and `trilinear` do not blur with distance (0.6 does); values of a
`gridvolume` are at the centers of cells, as in 3 (0.6: at the corners); a colored `opacity` counts by its luminance (0.6:
by channel); the mean reflectance inside `plastic` is exact (2 and 3: a fit, within 0.2 %); a `to_world` that scales does
not change the cone of a `spot`, as in 3.

## What is passed over

`render`, `plan` and `submit` warn of each thing that is passed over, once, with file, line, count and the nearest known
name; `check` lists them. `check` also warns of pictures that differ from Mitsuba's and of scenes without any light, and
lists up to 20 errors of a scene's text. Known parameters still need legal values, unless `--lenient` mends them.

- With `--integrator NAME` the scene's `<integrator>` may be of any type and hold anything. NAME takes over its parameters
  and those of integrators nested in it, if it has the same name and can use the value; the outermost and first value
  counts. A bad value of a parameter that this page lists for the scene's own integrator is an error; AOVs that Candela
  lacks are passed over.
- In a file before version 2 an unknown parameter of a known plugin is passed over, as in Mitsuba 0.6. Parameters that
  change what 0.6 renders and that Candela lacks (a medium's `orientation`) are errors.
- With `--lenient` unknown parameters, textures for unknown parameters, and unknown elements with their content are passed
  over in every file. Known elements at a wrong place stay errors.

## What stands in with `--lenient`

Each replacement is a warning that names both plugins. Without `--lenient` it is an error, except with a star: there the
picture is Mitsuba's but for polarization or a width next to none.

| unknown | read as |
|---|---|
| a plugin's name in other capitals (`Rectangle`) | that plugin |
| a name that begins with a known one (`roughconductor_heitz`) | the known one |
| a misspelled name (`roughplastc`; of shapes, emitters and volumes by one letter in four at most) | the known one, if it holds as many bsdfs |
| `disneybsdf`, `disneymetal`, `disneyglass`, `disneyclearcoat` | `principled` |
| `simplemicrofacet`, `approxmicrofacet`, `pplastic` * | `roughplastic` |
| `polarizer` *, `circular`; `retarder` | `thindielectric` of index 1 that passes half; `null` |
| a bsdf that holds one bsdf; two | the one inside (`mask` of opacity 1); `blendbsdf` |
| `measured`, `hair`, `irawan`, any other bsdf | `diffuse` of 0.5 unless it names a color |
| a film; sampler; filter | `hdrfilm`; `independent`; `gaussian` |
| `collimated` * | `spot`, half a degree wide, of the same power |
| `radiancemeter` * | `orthographic`, 2e-4 wide |
| any other sensor | `perspective` (`telecentric`: `orthographic`) |
| a texture | `rawconstant` of 0.5 |
| `microflake` * | `isotropic`, as in 0.6 without a field of orientations |
| `tabphase` | `hg` of the same mean cosine |
| another phase function; a medium | `isotropic`; `homogeneous` |
| an integrator | `path` (`photonmapper`, `upm`: `ppm`; `erpt`: `mmlt`) |
| a `point`, `spot`, ... inside a shape | the same beside the shape, in its frame |
| a shape, emitter or volume | nothing: it is left out |
| a parameter under a near name (`toWorld`, `baseColor`, `density` of a medium) | that parameter, if its value fits |
| `$spp`, `$resx`, `$max_depth` and their like without a value | 16, 768, -1: the usual value |
| a `<rotate>` without an axis | no rotation |
| a number out of bounds, or at an excluded bound; a `beam_width` beyond its `cutoff_angle` | the nearest one within; colors are scaled |
| a `far_clip` that is not beyond `near_clip` | the default |
| a `spot`, `projector` or `goniometric` whose `to_world` shears or stretches | the light with its place and axis |
| an object without a type | one of an unknown type |
| a string for a number, a fraction for an integer | the number, the nearest integer |
| another value that no rule accepts, a texture for a parameter that takes none | the default |
| a crop window that is not within the film | the whole film |
| `<animation>` | its first transform |
| a bump or normal map directly in another | the outer one |

A replaced plugin keeps the parameters, textures and children that the new one accepts.

## Meshes and images

The content of a file, not its name, tells its kind (images; TGA alone by name). A file whose name ends in `.gz` is
unpacked, the scene file too. Damaged files are errors that name the file and the line or byte. A mesh without area is left
out with a warning, with its lamp, and so are the instances of a group that is left without a shape.

| file | read |
|---|---|
| `obj` | triangles and polygons; negative indices count back; smoothing, lines, curves, `w` and vertex colors are passed over; a normal that is no finite number counts as missing; v is flipped unless `flip_tex_coords` is false; materials: see below |
| `ply` | text and binary of both byte orders, all types of numbers; `vertex_indices` or `vertex_index` of any length; `nx ny nz`; `u v`, `s t`, `texture_u texture_v`, `texture_s texture_t`; attributes of vertices and faces, one number or three: `r g b` or `red green blue` (*color*), or neighbors such as `flow_x flow_y flow_z` (*flow*; also `_r _g _b`, `_0 _1 _2`, `_1 _2 _3`), integers as fractions of their largest value, decoded from sRGB; other elements are passed over, and texture coordinates of faces (a warning) |
| `serialized` | versions 3 and 4, single and double precision, `shape_index`; vertex colors are the attribute *color*, tangents are refused |
| OpenEXR | half and float, by scanlines or tiles; the data window of the first part that has `R G B`, or else of the first; other primaries than Rec.709's (`chromaticities`) are converted; `R G B` in capital or small letters, or one channel of any name, as gray; alpha apart; other channels beside `R G B` are passed over; luminance and chroma, layers alone and integers are refused |
| PNG | 1 to 16 bits, gray, palette, colors, with alpha or without; sRGB, 16 bits too, as in Mitsuba 3; `gAMA`, `cHRM` and profiles play no part |
| JPEG | gray and color, sRGB; CMYK is refused |
| Radiance HDR, PFM | linear; PFM of both byte orders, times its scale |
| TIFF, TGA, BMP, PNM | 8 bits and, of TIFF and PNM, 16: sRGB; floats of TIFF: linear |

An image is turned upright as its header says (TIFF, OpenEXR, Exif in JPEG and PNG, the eight ways of Radiance HDR).
*Differs*: Mitsuba shows JPEG and PNG as they are stored. `raw` and `gamma` of a `bitmap` replace the decoding. Alpha
multiplies nothing: colors are as stored. NaN, infinite and negative values are errors.

A polygon that turns one way is a fan around its first corner; others are cut by their ears in the plane of their normal
(Mitsuba makes fans of all).

In a file before version 2 the parts of an `obj`, which begin at each `g` and `usemtl`, have the bsdfs that the shape holds
under the names of their materials (`<bsdf name="Glass" ...>`; one without a name is for all; the last that fits counts), or
those of the file's `mtllib`: `Kd`, `Ks`, `Ns`, `d`, `map_Kd`, `map_Ks`, `map_d`, `bump` and `illum` as 0.6 reads them
(colors are sRGB). If a library or an image is missing, a warning says so and 0.6's gray or black takes its place. From
version 2 on materials are passed over with a warning, unless `collapse` or `load_materials` asks for them. `shape_index`
counts parts from 0; a part begins at each `o`, too. *Differs*: 0.6 takes its last part for the one before.

A `to_world` that mirrors turns no shape inside out. *Differs*: mirrored meshes without vertex normals turn in Mitsuba up to
3.9.1 (0.6's `serialized` does not), spheres and cylinders do in Mitsuba 3.

## Limits

Elements are nested at most 64 deep, includes 64, objects (with references followed) 128; a scene has at most 10 000 includes,
1 GiB of XML, and 256 MiB in one file. XML is UTF-8. An object's parameters are given again at most 256 times.

Reading a scene takes at most `--scene-memory` (half of the memory that the process may have): a scene that needs more is
refused at the place where it would need it. An instance costs about 1 KB, whatever its group holds; a triangle about
200 bytes. Textures have a limit of their own, `--texture-memory`.

## Plugins

`candela check SCENE` prints what this page says of a scene's own plugins and parameters. *Ignored* parameters are accepted
because scenes have them, and change nothing in the picture. *Differs*: the picture is not Mitsuba's.
)";

std::string types_of(const PropertyRule& rule) {
  std::string result;
  for (const PropertyType type : rule.types)
    result += fmt::format("{}{}", result.empty() ? "" : ", ", name(type));
  if (!rule.textured) return result;
  return result.empty() ? "texture" : result + ", texture";
}

std::string bounds_of(const PropertyRule& rule) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (rule.minimum > -infinity && rule.maximum < infinity)
    return fmt::format("in {}{}, {}]", rule.above_minimum ? '(' : '[', rule.minimum, rule.maximum);
  if (rule.minimum > -infinity)
    return fmt::format("{} {}", rule.above_minimum ? "above" : "at least", rule.minimum);
  return rule.maximum < infinity ? fmt::format("at most {}", rule.maximum) : "";
}

// The text of a rule, without the parameter's name. An ignored parameter has no type in it.
std::string meaning_of(const PropertyRule& rule) {
  std::string result = !rule.ignored          ? fmt::format(" ({}): ", types_of(rule))
                       : rule.differs.empty() ? ": "
                                              : ": *ignored*: ";
  result += rule.doc;
  if (rule.required) result += "; required";
  if (!rule.values.empty()) {
    std::string values;
    for (const std::string_view value : rule.values)
      values += fmt::format("{}`{}`", values.empty() ? "" : ", ", value);
    result += fmt::format("; {}", values);
  }
  if (!rule.only.empty()) result += fmt::format("; only `{}` for now", rule.only);
  if (const std::string bounds = bounds_of(rule); !rule.ignored && !bounds.empty())
    result += fmt::format("; {}", bounds);
  if (!rule.differs.empty()) result += fmt::format("; *differs*: {}", rule.differs);
  return result;
}

// A line of the page: parameters of one meaning.
struct Line {
  bool ignored;
  std::string meaning;
  std::vector<std::string_view> names;
};
using Lines = std::vector<Line>;

void add(Lines& lines, const PropertyRule& rule) {
  const std::string meaning = meaning_of(rule);
  const bool ignored = rule.ignored && rule.differs.empty();
  const auto same = std::ranges::find_if(
      lines, [&](const Line& line) { return line.ignored == ignored && line.meaning == meaning; });
  if (same != lines.end())
    same->names.push_back(rule.name);
  else
    lines.push_back({.ignored = ignored, .meaning = meaning, .names = {rule.name}});
}

std::string quoted(std::span<const std::string_view> names) {
  std::string result;
  for (const std::string_view name : names) result += fmt::format("{}`{}`", result.empty() ? "" : ", ", name);
  return result;
}

// A list of what counts, then one item of what is ignored.
std::string markdown(const Lines& lines) {
  std::string result, ignored;
  for (const Line& line : lines) {
    const std::string text = quoted(line.names) + line.meaning;
    if (line.ignored)
      ignored += fmt::format("{}{}", ignored.empty() ? "" : "; ", text);
    else
      result += fmt::format("- {}\n", text);
  }
  if (!ignored.empty()) result += fmt::format("- *Ignored*: {}\n", ignored);
  return result.empty() ? "" : "\n" + result;
}

// Parameters that at least three plugins of a category have with one meaning stand once, before the plugins.
class SharedParameters {
 public:
  explicit SharedParameters(std::span<const PluginRule> category) {
    std::map<std::pair<std::string_view, std::string>, std::size_t> counts;
    for (const PluginRule& plugin : category)
      for (const PropertyRule& rule : plugin.properties) ++counts[{rule.name, meaning_of(rule)}];
    std::map<std::string_view, std::size_t> most;
    for (const auto& [key, count] : counts) most[key.first] = std::max(most[key.first], count);
    for (const PluginRule& plugin : category)
      for (const PropertyRule& rule : plugin.properties) {
        const std::string meaning = meaning_of(rule);
        const std::size_t count = counts[{rule.name, meaning}];
        if (count < 3 || count < most[rule.name] || !meanings_.emplace(rule.name, meaning).second) continue;
        add(count == category.size() ? of_all_ : of_some_, rule);
        if (count == category.size()) all_.insert(rule.name);
      }
  }

  bool has(const PropertyRule& rule) const {
    const auto found = meanings_.find(rule.name);
    return found != meanings_.end() && found->second == meaning_of(rule);
  }
  bool has_of_all(const PropertyRule& rule) const { return has(rule) && all_.contains(rule.name); }

  std::string markdown_of_all() const { return markdown(of_all_); }
  std::string markdown_of_some() const { return markdown(of_some_); }

 private:
  std::map<std::string_view, std::string> meanings_;
  std::set<std::string_view> all_;
  Lines of_all_, of_some_;
};

std::string markdown(std::span<const PluginRule> category) {
  const SharedParameters shared(category);
  std::string page = fmt::format("\n### {}\n", category.front().category);
  if (const std::string text = shared.markdown_of_all(); !text.empty())
    page += fmt::format("\nEvery {} has:\n{}", category.front().category, text);
  if (const std::string text = shared.markdown_of_some(); !text.empty())
    page += fmt::format("\nParameters of several; each plugin names its own after *also*:\n{}", text);
  // Plugins of one text, such as samplers, stand together.
  std::vector<std::pair<std::vector<std::string_view>, std::string>> plugins;
  for (const PluginRule& plugin : category) {
    Lines own;
    std::vector<std::string_view> also;
    for (const PropertyRule& rule : plugin.properties) {
      if (!shared.has(rule))
        add(own, rule);
      else if (!shared.has_of_all(rule))
        also.push_back(rule.name);
    }
    std::string text = fmt::format("{}.\n", plugin.doc);
    if (!plugin.differs.empty()) text += fmt::format("*Differs* from Mitsuba: {}.\n", plugin.differs);
    if (!also.empty()) text += fmt::format("*Also*: {}.\n", quoted(also));
    text += markdown(own);
    const auto same = std::ranges::find(plugins, text, [](const auto& entry) { return entry.second; });
    if (same != plugins.end())
      same->first.push_back(plugin.name);
    else
      plugins.push_back({{plugin.name}, text});
  }
  for (const auto& [names, text] : plugins) page += fmt::format("\n**{}**: {}", quoted(names), text);
  return page;
}

}  // namespace

std::string support_table_markdown() {
  std::string page(introduction);
  const auto other = [](const PluginRule& a, const PluginRule& b) { return a.category != b.category; };
  for (auto rest = vocabulary(); !rest.empty();) {
    const auto end = std::ranges::adjacent_find(rest, other);
    const std::size_t size =
        end == rest.end() ? rest.size() : static_cast<std::size_t>(end - rest.begin()) + 1;
    if (rest.front().category != "scene") page += markdown(rest.first(size));
    rest = rest.subspan(size);
  }
  page += "\n## Indices of refraction by name\n\n";
  std::string names;
  for (const std::string_view index : index_of_refraction_names())
    names += fmt::format("{}{} ({})", names.empty() ? "" : ", ", index, *named_index_of_refraction(index));
  page += names +
          ".\n\n## Conductors by name\n\nMeasured indices of refraction, integrated as Mitsuba's RGB "
          "variants do: ";
  names.clear();
  for (const std::string& conductor : conductor_names())
    names += fmt::format("{}{}", names.empty() ? "" : ", ", conductor);
  page += names +
          ".\n\n## Media by name\n\nBefore version 2, of Jensen et al. 2001 and, from "
          "lowfat milk on, of Narasimhan et al. 2006, whose scattering is reduced by the mean cosine, as in "
          "0.6: ";
  names.clear();
  for (const std::string_view medium : medium_names())
    names += fmt::format("{}{}", names.empty() ? "" : ", ", medium);
  return page + names + ".\n";
}

}  // namespace candela::description
