// Textures: colours and numbers that vary over a surface. A ColorTexture or FloatTexture is a small value: a
// constant, or a reference into the TextureStore of the scene, which owns every image and must outlive it.
//
// Conventions are Mitsuba 3's: (u, v) = (0, 0) is the top left corner of the image (mesh loaders flip v where
// their format asks for it), `to_uv` is applied to (u, v) first.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"

namespace candela::scene {

// d value / d u and d value / d v, of (u, v) before to_uv. Finite.
struct TextureGradient {
  Spectrum du, dv;
};

class Texture {
 public:
  virtual ~Texture() = default;
  virtual Spectrum eval(Vec2 uv) const = 0;
  // The exact derivative of eval where it has one: a bilinear bitmap's within its cells; zero for what is
  // constant by pieces (nearest texels, checkerboards), as in Mitsuba.
  virtual TextureGradient gradient(Vec2 uv) const = 0;
  virtual Spectrum maximum() const = 0;  // an upper bound of eval, per channel
  virtual Spectrum minimum() const = 0;  // a lower bound
};

struct ColorTexture {
  Spectrum constant;
  const Texture* texture = nullptr;  // null: the constant
  Spectrum eval(Vec2 uv) const { return texture == nullptr ? constant : texture->eval(uv); }
  Spectrum maximum() const { return texture == nullptr ? constant : texture->maximum(); }
  Spectrum minimum() const { return texture == nullptr ? constant : texture->minimum(); }
  bool is_constant() const { return texture == nullptr; }
};

// A colour texture in the place of a number counts by its luminance, as in Mitsuba.
struct FloatTexture {
  float constant = 0;
  const Texture* texture = nullptr;
  float eval(Vec2 uv) const { return texture == nullptr ? constant : luminance(texture->eval(uv)); }
  float minimum() const { return texture == nullptr ? constant : luminance(texture->minimum()); }
  // d value / d(u, v), of (u, v) before to_uv.
  Vec2 gradient(Vec2 uv) const {
    if (texture == nullptr) return {};
    const TextureGradient g = texture->gradient(uv);
    return {luminance(g.du), luminance(g.dv)};
  }
  bool is_constant() const { return texture == nullptr; }
};

// A decoded image: linear Rec.709, rows from the top. 8-bit files keep their bytes and a table, others are
// floats.
struct TexelImage {
  std::string file;
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> bytes;  // width * height * 4 (r, g, b, unused), or empty
  std::vector<float> floats;        // width * height * 3, or empty
  std::vector<float> table;         // 256 linear values of a byte
  Spectrum at(std::uint32_t x, std::uint32_t y) const {
    const std::size_t i = static_cast<std::size_t>(y) * width + x;
    if (!bytes.empty()) return {table[bytes[4 * i]], table[bytes[4 * i + 1]], table[bytes[4 * i + 2]]};
    return {floats[3 * i], floats[3 * i + 1], floats[3 * i + 2]};
  }
};

// Decodes image bytes: OpenEXR, PNG, JPEG, Radiance HDR, TIFF, BMP, TGA, PNM/PFM, told by content. `raw`:
// integers are taken as linear, else as sRGB. One channel fills three; alpha is left out. Errors name `file`:
// not decodable, larger than 32768 pixels a side or 2^28 in all, NaN, infinite or negative values.
Result<TexelImage> decode_image(std::string_view encoded, const std::string& file, bool raw);

class TextureStore {
 public:
  explicit TextureStore(const description::FileSource& files) : files_(&files) {}

  // What the slot `name` of `owner` holds: an rgb or number property, a texture child, or `otherwise`. Errors
  // name file, line and the slot.
  Result<ColorTexture> color(const description::Object& owner, std::string_view name, Spectrum otherwise);
  Result<FloatTexture> number(const description::Object& owner, std::string_view name, float otherwise);

  // One decoding per file and interpretation. `where` is the object that asks, for errors.
  Result<std::shared_ptr<const TexelImage>> image(const std::string& key, bool raw,
                                                  const description::Location& where);

  std::uint32_t texture_count() const { return static_cast<std::uint32_t>(textures_.size()); }
  std::uint64_t image_bytes() const;

 private:
  Result<const Texture*> build(const description::ObjectPtr& object, int depth);
  Result<ColorTexture> color_at_depth(const description::Object& owner, std::string_view name,
                                      Spectrum otherwise, int depth);

  const description::FileSource* files_;
  std::map<std::pair<std::string, bool>, std::shared_ptr<const TexelImage>> images_;
  std::map<description::ObjectPtr, std::unique_ptr<const Texture>>
      textures_;  // by the object they were built from
};

}  // namespace candela::scene
