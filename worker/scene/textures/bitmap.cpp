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

Bitmap::Cell Bitmap::cell(Vec2 uv) const {
  const double x = static_cast<double>(uv.x) * image_->width - 0.5;
  const double y = static_cast<double>(uv.y) * image_->height - 0.5;
  const double fx = std::floor(x);
  const double fy = std::floor(y);
  const std::int64_t ix = to_integer(fx);
  const std::int64_t iy = to_integer(fy);
  const double span_x = x - fx;
  const double span_y = y - fy;
  // NaN coordinates (a mesh's own mistake) read the first texels.
  const float wx = span_x >= 0 && span_x <= 1 ? static_cast<float>(span_x) : 0.0f;
  const float wy = span_y >= 0 && span_y <= 1 ? static_cast<float>(span_y) : 0.0f;
  if (ix >= 0 && iy >= 0 && ix + 1 < image_->width && iy + 1 < image_->height) {
    const auto ux = static_cast<std::uint32_t>(ix);
    const auto uy = static_cast<std::uint32_t>(iy);
    const std::size_t left = TexelImage::column(ux);
    const std::size_t right = TexelImage::column(ux + 1);
    const std::size_t top = image_->row(uy);
    const std::size_t bottom = image_->row(uy + 1);
    return {{image_->texel(top + left), image_->texel(top + right), image_->texel(bottom + left),
             image_->texel(bottom + right)},
            wx,
            wy};
  }
  return {{texel(ix, iy), texel(ix + 1, iy), texel(ix, iy + 1), texel(ix + 1, iy + 1)}, wx, wy};
}

Spectrum Bitmap::eval(Vec2 uv) const {
  uv = settings_.to_uv(uv);
  if (settings_.nearest) {
    return texel(to_integer(std::floor(static_cast<double>(uv.x) * image_->width)),
                 to_integer(std::floor(static_cast<double>(uv.y) * image_->height)));
  }
  const Cell c = cell(uv);
  const Spectrum top = c.texels[0] * (1 - c.wx) + c.texels[1] * c.wx;
  const Spectrum bottom = c.texels[2] * (1 - c.wx) + c.texels[3] * c.wx;
  return top * (1 - c.wy) + bottom * c.wy;
}

TextureGradient Bitmap::gradient(Vec2 uv) const {
  if (settings_.nearest) return {};
  const Cell c = cell(settings_.to_uv(uv));
  const auto channel = [&](float Spectrum::*i) {
    const double t[4] = {c.texels[0].*i, c.texels[1].*i, c.texels[2].*i, c.texels[3].*i};
    const double wx = c.wx;
    const double wy = c.wy;
    return settings_.to_uv.gradient(image_->width * ((1 - wy) * (t[1] - t[0]) + wy * (t[3] - t[2])),
                                    image_->height * ((1 - wx) * (t[2] - t[0]) + wx * (t[3] - t[1])));
  };
  const Vec2 r = channel(&Spectrum::r);
  const Vec2 g = channel(&Spectrum::g);
  const Vec2 b = channel(&Spectrum::b);
  return {{r.x, g.x, b.x}, {r.y, g.y, b.y}};
}

}  // namespace candela::scene
