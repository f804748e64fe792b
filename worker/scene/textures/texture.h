// Textures: colors and numbers that vary over a surface. A ColorTexture or FloatTexture is a small value: a
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
#include "worker/scene/surface_point.h"
#include "worker/scene/textures/image_decode.h"
#include "worker/scene/textures/scratch.h"
#include "worker/scene/textures/texel_image.h"

namespace candela::scene {

// d value / d u and d value / d v, of (u, v) before to_uv. Finite.
struct TextureGradient {
  Spectrum du, dv;
};

class Texture {
 public:
  virtual ~Texture() = default;
  virtual Spectrum eval(const SurfacePoint& at) const = 0;
  // The exact derivative of eval where it has one: a bilinear bitmap's within its cells. Zero for textures
  // that are constant by pieces (nearest texels, checkerboards), as in Mitsuba, and for `volume` and
  // `wireframe`.
  virtual TextureGradient gradient(const SurfacePoint& at) const = 0;
  virtual Spectrum maximum() const = 0;  // an upper bound of eval, per channel
  virtual Spectrum minimum() const = 0;  // a lower bound
};

struct ColorTexture {
  Spectrum constant;
  const Texture* texture = nullptr;  // null: the constant
  Spectrum eval(const SurfacePoint& at) const { return texture == nullptr ? constant : texture->eval(at); }
  // For a texture that reads (u, v) alone.
  Spectrum eval(Vec2 uv) const {
    if (texture == nullptr) return constant;
    SurfacePoint at;
    at.uv = uv;
    return texture->eval(at);
  }
  Spectrum maximum() const { return texture == nullptr ? constant : texture->maximum(); }
  Spectrum minimum() const { return texture == nullptr ? constant : texture->minimum(); }
  bool is_constant() const { return texture == nullptr; }
};

// A color texture in the place of a number counts by its luminance, as in Mitsuba.
struct FloatTexture {
  float constant = 0;
  const Texture* texture = nullptr;
  float eval(const SurfacePoint& at) const {
    return texture == nullptr ? constant : luminance(texture->eval(at));
  }
  float minimum() const { return texture == nullptr ? constant : luminance(texture->minimum()); }
  float maximum() const { return texture == nullptr ? constant : luminance(texture->maximum()); }
  // d value / d(u, v), of (u, v) before to_uv.
  Vec2 gradient(const SurfacePoint& at) const {
    if (texture == nullptr) return {};
    const TextureGradient g = texture->gradient(at);
    return {luminance(g.du), luminance(g.dv)};
  }
  bool is_constant() const { return texture == nullptr; }
};

struct Geometry;

class TextureStore {
 public:
  // `geometry`, which must outlive the textures: read by mesh_attribute and wireframe.
  explicit TextureStore(const description::FileSource& files, const TextureLimits& limits = {},
                        const Geometry* geometry = nullptr)
      : files_(&files), geometry_(geometry), scratch_(limits) {}

  // Builds what the slot `name` of `owner` holds: an rgb or number property, a texture child, or `otherwise`.
  // Errors name file, line and the slot.
  Result<ColorTexture> color(const description::Object& owner, std::string_view name, Spectrum otherwise);
  Result<FloatTexture> number(const description::Object& owner, std::string_view name, float otherwise);

  // A texture times a factor that is not negative.
  ColorTexture scaled(const ColorTexture& texture, float factor);

  // The texture `object` itself, in the place of a number.
  Result<FloatTexture> nested_number(const description::ObjectPtr& object);

  // One decoding per file and reading. `where` is the object that asks, for errors.
  Result<std::shared_ptr<const TexelImage>> image(const std::string& key, const ImageReading& reading,
                                                  const description::Location& where);

  // For other tables as large as images.
  Scratch& scratch() { return scratch_; }

  std::uint32_t texture_count() const { return static_cast<std::uint32_t>(textures_.size()); }
  // Bytes of decoded texels: in memory, and in the scratch file.
  std::uint64_t memory_bytes() const { return scratch_.memory_bytes(); }
  std::uint64_t file_bytes() const { return scratch_.file_bytes(); }

 private:
  Result<const Texture*> build(const description::ObjectPtr& object, int depth);
  Result<std::unique_ptr<const Texture>> build_bitmap(const description::Object& object);
  Result<ColorTexture> color_at_depth(const description::Object& owner, std::string_view name,
                                      Spectrum otherwise, int depth);
  Result<FloatTexture> number_at_depth(const description::Object& owner, std::string_view name,
                                       float otherwise, int depth);

  const description::FileSource* files_;
  const Geometry* geometry_;
  Scratch scratch_;
  std::map<std::pair<std::string, ImageReading>, std::shared_ptr<const TexelImage>> images_;
  std::map<description::ObjectPtr, std::unique_ptr<const Texture>>
      textures_;  // by the object they were built from
  std::vector<std::unique_ptr<const Texture>> scaled_;
};

}  // namespace candela::scene
