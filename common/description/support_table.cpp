// docs/scenes.md, written from the vocabulary: the page cannot say anything else than the loader does.
#include <fmt/format.h>

#include "common/description/conductors.h"
#include "common/description/media_presets.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr std::string_view introduction = R"(# Scenes

<!-- Generated from common/description/vocabulary.cpp by support_table_markdown(); a test compares the two. -->

Candela reads Mitsuba XML, and [pbrt's scenes](pbrt.md). What a plugin or a parameter means is what Mitsuba documents; this page lists what is
understood. Anything else is an error that names the file, the line and the nearest known name, except as the section
*What is passed over* says.

## The file

- `<scene version="3.0.0">` is read in the spelling of Mitsuba 3. With a version before 2 (`version="0.6.0"`) names are
  translated: `toWorld`, `intIOR`, `sampleCount` become `to_world`, `int_ior`, `sample_count`; `uscale`, `uoffset` and
  their like become a `to_uv` transform that looks up at `uv * scale + offset`; `wrapModeU` and `wrapModeV` become
  `wrap_mode`; the filters `ewa` and `trilinear` become `bilinear`; a `mixturebsdf` becomes
  `blendbsdf`s; `sigmaA` and `sigmaS` become `sigma_t` and `albedo`, a medium's volume `density` its `sigma_t`, and
  `densityMultiplier` its `scale`; a homogeneous medium's `material` becomes measured coefficients; the microfacet
  distributions `phong` and `as` become `beckmann`; grids fill the bounding box of their file, or the box from
  `min` to `max`; the `scale` of a `sunsky` is that of both parts; `extEta` divides the `eta` and `k` of conductors.
- A file means what the Mitsuba of its version does; the section *Where Mitsuba's versions differ* has the list. Of a parameter
  that is given twice the later value counts, with a warning, a texture's too.
- Values: `<boolean>`, `<integer>`, `<float>`, `<string>`, `<point>` and `<vector>` (`x`, `y`, `z`, or `value`), `<rgb>`
  (linear Rec.709: one or three numbers; `#rrggbb` is decoded from sRGB, before version 2 it is linear), `<srgb>` (decoded
  from sRGB).
- Spectra become linear Rec.709 when the scene is read, as in Mitsuba's RGB variants: `<spectrum value="0.5"/>`,
  `<spectrum value="400:0.1, 500:0.2"/>` (nanometres and value, linear between them, zero outside),
  `<spectrum filename="x.spd"/>` (lines of the same two numbers), `<spectrum type="..."/>` (see below) and 0.6's
  `<blackbody temperature="5000K" scale="1"/>`. Inside an emitter a spectrum is weighed by the CIE 1931 observer, so that a
  density of 1 has luminance 1; elsewhere also by D65, so that a flat one is neutral. Negative components become 0, and
  reflectances above 1 become 1. One number inside an emitter is light of the same power at all wavelengths, which is not
  white; in a file before version 2 it is a multiple of white.
- `<transform>` holds `<translate>`, `<rotate>` (degrees), `<scale>`, `<lookat>` and `<matrix>` (16 or 9 numbers, row by
  row); each acts after those before it. A transform must be affine and invertible.
- `<default name="spp" value="16"/>` gives `$spp` a value unless the command line does (`-D spp=64`). Every attribute may
  hold parameters; the longest known name counts; `\$` is a dollar sign. A `-D` that the scene does not use is an error.
- `<ref id="..."/>` uses an object defined anywhere in the scene; `<alias id="..." as="..."/>` gives one that is defined
  above another id.
- `<include filename="..."/>` puts the content of another scene file here, or one object.
- Files are looked for in the folders named by `<path value="..."/>` (the last one first), then in the main scene file's
  folder, then in the folder of the included file that names them. All of them must be there when a job is submitted.
- A surface without a `<bsdf>` is `diffuse`. An emitter `area` at the top of the scene glows in the shapes that refer to it.
- A `<spectrum>` whose type is a texture is that texture.
- A scene without an integrator has `direct` before version 2, later `path`, with a warning.
- The integrator `direct` is `path` with a `max_depth` of 2. Of an integrator that Candela lacks and that holds another one
  (`aov`, `moment`) the one inside runs; the `aovs` of `aov` become layers beside its image, unless `--aov` says otherwise
  (`aovs.md`). The films `ldrfilm` and `mfilm` are read as `hdrfilm`.

## Where Mitsuba's versions differ

| what | before version 2, as 0.6 | from version 2, as 2 and 3 |
|---|---|---|
| `roughplastic` | light that masking keeps from leaving the coat comes out later: white stays white | it is lost: white is 0.98, 0.93, 0.88 and 0.74 at ggx, `alpha` 0.05, 0.1, 0.15 and 0.3 |
| `conductor`, `roughconductor` without parameters | copper | a perfect mirror |
| `bumpmap`, `normalmap` | the normal is tilted, no more | as Mitsuba 3.7: invalid normals are flipped, facets shadow |
| `homogeneous` | lacking coefficients are those of `material` (default `skin1`), 100 times the values per millimeter, as 0.6's program has it, against its manual; the medium's `g` reduces the scattering | albedo 0.75, sigma_t 1 |
| media around the camera | begin at the camera | begin at the near plane |
| colors of `ply` vertices | sRGB | sRGB if integers |
| `#rrggbb` in `<rgb>` | linear | sRGB |
| one number in an emitter's `<spectrum>` | white | equal power, which is not white |
| several sensors | the last | the first |
| no integrator | `direct` | `path` |
| no emitter | a `sunsky` at scale 2 with a sun 15 times as wide (0.6 goes on below the horizon, here it is dark) | black |
| unknown parameters of known plugins | passed over | errors |

Read alike in all files, though the programs differ: `ewa` and `trilinear` textures (0.6 blurs with distance); values of a
`gridvolume` (0.6 has them at the corners of cells, here and in 3 they are in the centers); a colored `opacity` (0.6 masks by
channel, here its luminance); the mean reflectance inside `plastic` (2 and 3 have a fit, within 0.2 %); a `spot` whose `to_world`
scales (0.6's cone changes, here and in 3 it does not). Alike in all three programs, and here: `dielectric`,
`thindielectric`, `roughdielectric`, roughness and `sample_visible`, `phong`, `ward` and `roughdiffuse` (0.6 alone), the
orientation of `envmap`, `directional`, `flip_normals`, crop windows, `fov_axis`, near and far planes, filters and their
widths, the sign of `g`, a medium's `scale`.

## What is passed over

What is passed over is told: by `render`, `plan` and `submit` as warnings with file, line and the nearest known name, each once
with its number, and by `check` in its list. So is what else `check` warns of: a picture that differs from Mitsuba's, and a scene
without any light. `check` lists all errors of a scene's text, up to 20. Values of parameters that are understood stay checked; `--lenient`
mends some, as the next section says.

- With `--integrator NAME` the scene's `<integrator>` may be of any type and hold anything. Of its parameters, and of those of
  integrators nested in it, NAME takes over what it has by the same name and can use, such as `max_depth` (`maxDepth` before
  version 2); the outermost and first value counts. A bad value of a parameter that this page lists for the scene's own
  integrator is an error; AOVs that Candela lacks are passed over. `check` warns of the other integrator, the other commands print a note.
- In a file before version 2 an unknown parameter of a known plugin is passed over, as in Mitsuba 0.6. Parameters that change
  what 0.6 renders and that Candela lacks (a medium's `orientation`) stay errors.
- With `--lenient` unknown parameters, textures for unknown parameters, and unknown elements with all that is in them are passed
  over in every file; unknown plugins are replaced as the next section says. Known elements at a wrong place stay errors.

## What stands in with `--lenient`

Each replacement is a warning that names both plugins. Without `--lenient` it is an error, but for those with a star: they give
Mitsuba's picture but for polarization or for a width next to none, so they stand in always.

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
| an integrator | `path` (`photonmapper`, `upm`: `ppm`; `mlt`, `erpt`: `mmlt`) |
| a `point`, `spot`, ... inside a shape | the same beside the shape, in its frame |
| a shape, emitter or volume | nothing: it is left out |
| a parameter under a near name (`toWorld`, `baseColor`, `density` of a medium) | that parameter, if its value fits |
| `$spp`, `$resx`, `$max_depth` and their like without a value | 16, 768, -1: the usual value |
| a `<rotate>` without an axis | no rotation |
| a number out of bounds, or at a bound that is excluded; a `beam_width` beyond its `cutoff_angle` | the nearest one within; colors are scaled |
| a `far_clip` that is not beyond `near_clip` | the default |
| a `spot`, `projector` or `goniometric` whose `to_world` shears or stretches | the light with its place and axis |
| an object without a type | one of an unknown type |
| a string for a number, a fraction for an integer | the number, the nearest integer |
| another value that no rule accepts, a texture for a parameter that takes none | the default |
| a crop window that is not within the film | the whole film |
| `<animation>` | its first transform |
| a bump or normal map directly in another | the outer one |

A replaced plugin keeps the parameters, textures and children that the new one has and accepts; the others are passed over.

## Meshes and images

What a file is, its content says, not its name (of images; TGA alone by name). A file whose name ends in `.gz` is unpacked,
the scene file too. Damaged and lying files are errors that name the file and the line or byte. A mesh of which no face has an
area is left out with a warning, with its lamp, and so are the instances of a group that is left without a shape.

| file | read |
|---|---|
| `obj` | polygons, concave ones too, are cut into triangles, negative indices count back; smoothing, lines, curves, `w` and vertex colors are passed over; a normal that is no finite number is as none; v is flipped unless `flip_tex_coords` is false; materials: see below |
| `ply` | text and binary of both byte orders, all types of numbers; `vertex_indices` or `vertex_index` of any length, polygons as of `obj`; `nx ny nz`; `u v`, `s t`, `texture_u texture_v`, `texture_s texture_t`; attributes of vertices and faces, one number or three: `r g b` or `red green blue` (*color*), or neighbors such as `flow_x flow_y flow_z` (*flow*; also `_r _g _b`, `_0 _1 _2`, `_1 _2 _3`), integers as fractions of their largest value, decoded from sRGB; other elements are passed over, and texture coordinates of faces (a warning) |
| `serialized` | versions 3 and 4, single and double precision, `shape_index`; vertex colors are the attribute *color*, tangents are refused |
| OpenEXR | half and float, by scanlines or tiles, the data window of the first part that has `R G B`, or else of the first; other primaries than Rec.709's (`chromaticities`) are converted, as in Mitsuba; `R G B` in capital or small letters, or one channel of any name, as gray; alpha apart; other channels beside `R G B` are passed over; luminance and chroma, layers alone and integers are refused |
| PNG | 1 to 16 bits, gray, palette, colors, with alpha or without; sRGB, 16 bits too, as in Mitsuba 3; `gAMA`, `cHRM` and profiles play no part |
| JPEG | gray and color, sRGB; four inks (CMYK) are refused |
| Radiance HDR, PFM | linear; PFM of both byte orders, times its scale |
| TIFF, TGA, BMP, PNM | 8 bits and, of TIFF and PNM, 16: sRGB; floats of TIFF: linear |

An image is turned upright as its header says: the orientation of TIFF, OpenEXR and of the Exif data in JPEG and PNG, and the
resolution of Radiance HDR in its eight ways. *Differs*: Mitsuba shows JPEG and PNG as they are stored.

`raw` and `gamma` of a `bitmap` replace that decoding. Alpha multiplies nothing: colors are as stored. NaN, infinite and
negative values are errors.

A polygon of an `obj` or `ply` that turns one way stays a fan around its first corner; others are cut by their ears in the plane
of their normal, holes at the ends of bridges too (Mitsuba makes fans of all).

In a file before version 2 the parts of an `obj`, which begin at each `g` and `usemtl`, have the bsdfs that the shape holds under
the names of their materials (`<bsdf name="Glass" ...>`; one without a name is for all; the last that fits counts), or those of
the file's `mtllib`: `Kd`, `Ks`, `Ns`, `d`, `map_Kd`, `map_Ks`, `map_d`, `bump` and `illum` as 0.6 reads them (colors are sRGB).
A library or an image that is not there is told; 0.6's gray and black take its place. From version 2 on materials are passed
over with a warning, as in Mitsuba, unless `collapse` or `load_materials` asks for them. `shape_index` counts parts from 0; a
part begins at each `o`, too. *Differs*: 0.6 takes its last part for the one before.

A `to_world` that mirrors turns no shape inside out: the front stays where it is in the file. *Differs*: mirrored meshes without
vertex normals turn in Mitsuba up to 3.9.1 (0.6's `serialized` does not), spheres and cylinders do in Mitsuba 3.

## Limits

Elements are nested at most 64 deep, includes 64, objects (with references followed) 128; a scene has at most 10 000 includes,
1 GiB of XML, and 256 MiB in one file. XML is UTF-8. An object's parameters are given again at most 256 times.

Reading a scene, of XML or of pbrt, takes memory up to `--scene-memory` (half of the memory that the process may have): a scene
that needs more is refused before the memory is taken, at the place where it would be. An instance costs about 1 KB, whatever
its group holds; a triangle about 200 bytes. Textures have a limit of their own, `--texture-memory`.

## Plugins

`candela check SCENE` tells of a scene's own plugins and parameters what of this page concerns them.

Parameters marked *ignored* are accepted because scenes have them, and change nothing in the picture. What is marked
*differs* gives another picture than Mitsuba's.
)";

// Table cells hold no bars.
std::string cell(std::string_view text) {
  std::string result;
  for (const char c : text) result += c == '|' ? std::string("\\|") : std::string(1, c);
  return result;
}

std::string types_of(const PropertyRule& rule) {
  std::string result;
  for (const PropertyType type : rule.types)
    result += fmt::format("{}{}", result.empty() ? "" : ", ", name(type));
  if (!rule.textured) return result;
  return result.empty() ? "texture" : result + ", texture";
}

std::string bounds_of(const PropertyRule& rule) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::string result;
  if (rule.minimum > -infinity)
    result = fmt::format("{} {}", rule.above_minimum ? "above" : "at least", rule.minimum);
  if (rule.maximum < infinity)
    result += fmt::format("{}at most {}", result.empty() ? "" : ", ", rule.maximum);
  return result;
}

std::string meaning_of(const PropertyRule& rule) {
  std::string result = rule.ignored ? "*ignored*: " : "";
  result += rule.doc;
  if (rule.required) result += "; required";
  if (!rule.values.empty()) {
    std::string values;
    for (const std::string_view value : rule.values)
      values += fmt::format("{}`{}`", values.empty() ? "" : ", ", value);
    result += fmt::format("; {}", values);
  }
  if (!rule.only.empty()) result += fmt::format("; only `{}` for now", rule.only);
  if (const std::string bounds = bounds_of(rule); !bounds.empty()) result += fmt::format("; {}", bounds);
  if (!rule.differs.empty()) result += fmt::format("; *differs*: {}", rule.differs);
  return result;
}

}  // namespace

std::string support_table_markdown() {
  std::string page(introduction);
  std::string_view category;
  for (const PluginRule& plugin : vocabulary()) {
    if (plugin.category == "scene") continue;
    if (plugin.category != category) page += fmt::format("\n### {}\n", plugin.category);
    category = plugin.category;
    page += fmt::format("\n**`{}`**: {}.\n", plugin.name, plugin.doc);
    if (!plugin.differs.empty()) page += fmt::format("*Differs* from Mitsuba: {}.\n", plugin.differs);
    if (plugin.properties.empty()) continue;
    page += "\n| parameter | type | meaning |\n|---|---|---|\n";
    for (const PropertyRule& rule : plugin.properties)
      page += fmt::format("| `{}` | {} | {} |\n", rule.name, types_of(rule), cell(meaning_of(rule)));
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
