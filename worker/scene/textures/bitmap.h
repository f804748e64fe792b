// Lookups in an image: bilinear between texel centers or the nearest texel, with what lies outside of [0, 1]
// chosen for u and v apart.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "worker/scene/textures/texel_image.h"
#include "worker/scene/textures/texture.h"
#include "worker/scene/textures/uv_transform.h"

namespace candela::scene {

// Lookup outside of the image. zero and one are Mitsuba 0.6's: texels there have that value.
enum class Wrap : std::uint8_t { repeat, mirror, clamp, zero, one };

class Bitmap final : public Texture {
 public:
  struct Settings {
    bool nearest = false;
    Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
    UvTransform to_uv;
  };
  Bitmap(std::shared_ptr<const TexelImage> image, const Settings& settings);

  Spectrum eval(const SurfacePoint& at) const override;
  TextureGradient gradient(const SurfacePoint& at) const override;
  Spectrum maximum() const override { return maximum_; }
  Spectrum minimum() const override { return minimum_; }
  const TexelImage& image() const { return *image_; }

 private:
  // f(upper left, upper right, lower left, lower right, weight of the right ones, weight of the lower ones)
  // of the texels around a place (transformed coordinates).
  template <class F>
  auto with_texels(Vec2 uv, const F& f) const;
  template <class F>
  auto with_texels_at_border(double x, double y, const F& f) const;
  Spectrum texel(std::int64_t x, std::int64_t y) const;

  std::shared_ptr<const TexelImage> image_;
  Settings settings_;
  Spectrum minimum_, maximum_;
};

// Width and height of the image that the texture shows; nothing where it shows none.
std::optional<std::array<std::uint32_t, 2>> size_of(const Texture* texture);

// Width over height of that image; 1 where there is none.
double aspect_of(const Texture* texture);

}  // namespace candela::scene
