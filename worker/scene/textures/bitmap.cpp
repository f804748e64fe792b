#include "worker/scene/textures/bitmap.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace candela::scene {
namespace {

// Texel coordinates as exact integers; a uv so large that its texel is unknown counts as 0.
std::int64_t to_integer(double v) {
  return std::abs(v) < 1e15 ? static_cast<std::int64_t>(v) : 0;
}

// For i outside of [0, size), and modes that have a texel there.
std::uint32_t wrap(std::int64_t i, std::uint32_t size, Wrap mode) {
  const auto n = static_cast<std::int64_t>(size);
  switch (mode) {
    case Wrap::repeat:
      i %= n;
      if (i < 0) i += n;
      break;
    case Wrap::mirror:
      i %= 2 * n;
      if (i < 0) i += 2 * n;
      if (i >= n) i = 2 * n - 1 - i;
      break;
    case Wrap::clamp:
    case Wrap::zero:
    case Wrap::one:
      i = i < 0 ? 0 : n - 1;
      break;
  }
  return static_cast<std::uint32_t>(i);
}

bool has_border(Wrap mode) {
  return mode == Wrap::zero || mode == Wrap::one;
}

}  // namespace

Bitmap::Bitmap(std::shared_ptr<const TexelImage> image, const Settings& settings)
    : image_(std::move(image)), settings_(settings), minimum_(image_->minimum), maximum_(image_->maximum) {
  for (const Wrap mode : {settings_.wrap_u, settings_.wrap_v}) {
    if (!has_border(mode)) continue;
    const float border = mode == Wrap::one ? 1 : 0;
    minimum_ = {std::min(minimum_.r, border), std::min(minimum_.g, border), std::min(minimum_.b, border)};
    maximum_ = {std::max(maximum_.r, border), std::max(maximum_.g, border), std::max(maximum_.b, border)};
  }
}

Spectrum Bitmap::texel(std::int64_t x, std::int64_t y) const {
  const bool inside_x = x >= 0 && x < image_->width;
  const bool inside_y = y >= 0 && y < image_->height;
  if (inside_x && inside_y) return image_->at(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
  // u decides first where both lie outside, as in 0.6.
  if (!inside_x && has_border(settings_.wrap_u)) return Spectrum(settings_.wrap_u == Wrap::one ? 1.0f : 0.0f);
  if (!inside_y && has_border(settings_.wrap_v)) return Spectrum(settings_.wrap_v == Wrap::one ? 1.0f : 0.0f);
  return image_->at(inside_x ? static_cast<std::uint32_t>(x) : wrap(x, image_->width, settings_.wrap_u),
                    inside_y ? static_cast<std::uint32_t>(y) : wrap(y, image_->height, settings_.wrap_v));
}

template <class F>
[[gnu::noinline]] auto Bitmap::with_texels_at_border(double x, double y, const F& f) const {
  const double fx = std::floor(x);
  const double fy = std::floor(y);
  const std::int64_t ix = to_integer(fx);
  const std::int64_t iy = to_integer(fy);
  const double span_x = x - fx;
  const double span_y = y - fy;
  // NaN coordinates (a mesh's own mistake) read the first texels.
  return f(texel(ix, iy), texel(ix + 1, iy), texel(ix, iy + 1), texel(ix + 1, iy + 1),
           span_x >= 0 && span_x <= 1 ? static_cast<float>(span_x) : 0.0f,
           span_y >= 0 && span_y <= 1 ? static_cast<float>(span_y) : 0.0f);
}

template <class F>
[[gnu::always_inline]] inline auto Bitmap::with_texels(Vec2 uv, const F& f) const {
  const TexelImage& image = *image_;
  const auto width = static_cast<std::int32_t>(image.width);
  const auto height = static_cast<std::int32_t>(image.height);
  const double x = static_cast<double>(uv.x) * width - 0.5;
  const double y = static_cast<double>(uv.y) * height - 0.5;
  // Most lookups are inside, where all is simple: few instructions let several lookups wait for memory
  // together.
  if (!(x >= 0 && y >= 0 && x < width - 1 && y < height - 1)) return with_texels_at_border(x, y, f);
  const auto ix = static_cast<std::int32_t>(x);
  const auto iy = static_cast<std::int32_t>(y);
  const auto wx = static_cast<float>(x - ix);
  const auto wy = static_cast<float>(y - iy);
  const std::size_t left = TexelImage::column(static_cast<std::uint32_t>(ix));
  const std::size_t right = TexelImage::column(static_cast<std::uint32_t>(ix) + 1);
  const std::size_t top = image.row(static_cast<std::uint32_t>(iy));
  const std::size_t bottom = image.row(static_cast<std::uint32_t>(iy) + 1);
  const auto four = [&]<TexelFormat format>() {
    return f(image.texel_as<format>(top + left), image.texel_as<format>(top + right),
             image.texel_as<format>(bottom + left), image.texel_as<format>(bottom + right), wx, wy);
  };
  switch (image.format) {
    case TexelFormat::gray8:
      return four.template operator()<TexelFormat::gray8>();
    case TexelFormat::rgb8:
      return four.template operator()<TexelFormat::rgb8>();
    case TexelFormat::gray32:
      return four.template operator()<TexelFormat::gray32>();
    case TexelFormat::rgb32:
      break;
  }
  return four.template operator()<TexelFormat::rgb32>();
}

Spectrum Bitmap::eval(const SurfacePoint& at) const {
  const Vec2 uv = settings_.to_uv(at.uv);
  if (settings_.nearest) {
    return texel(to_integer(std::floor(static_cast<double>(uv.x) * image_->width)),
                 to_integer(std::floor(static_cast<double>(uv.y) * image_->height)));
  }
  return with_texels(uv, [](Spectrum a, Spectrum b, Spectrum c, Spectrum d, float wx, float wy) {
    const Spectrum top = a * (1 - wx) + b * wx;
    const Spectrum bottom = c * (1 - wx) + d * wx;
    return top * (1 - wy) + bottom * wy;
  });
}

TextureGradient Bitmap::gradient(const SurfacePoint& at) const {
  if (settings_.nearest) return {};
  return with_texels(
      settings_.to_uv(at.uv), [&](Spectrum a, Spectrum b, Spectrum c, Spectrum d, double wx, double wy) {
        const auto channel = [&](float Spectrum::*i) {
          const double t[4] = {a.*i, b.*i, c.*i, d.*i};
          return settings_.to_uv.gradient(image_->width * ((1 - wy) * (t[1] - t[0]) + wy * (t[3] - t[2])),
                                          image_->height * ((1 - wx) * (t[2] - t[0]) + wx * (t[3] - t[1])));
        };
        const Vec2 red = channel(&Spectrum::r);
        const Vec2 green = channel(&Spectrum::g);
        const Vec2 blue = channel(&Spectrum::b);
        return TextureGradient{{red.x, green.x, blue.x}, {red.y, green.y, blue.y}};
      });
}

}  // namespace candela::scene
