// Bitmap, checkerboard and scaled textures and the store that owns them. Meanings are Mitsuba 3's.
#include "worker/scene/textures/texture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace candela::scene {
namespace {

// The upper left 2 x 3 part of to_uv that acts on (u, v, 1). Mitsuba takes the upper left 3 x 3 block of a 4
// x 4 matrix as the affine map of the plane, and the XML's translate and scale write a 4 x 4 one, whose
// translation is in the last column.
struct UvTransform {
  double m[2][3] = {{1, 0, 0}, {0, 1, 0}};
  bool identity = true;

  Vec2 operator()(Vec2 uv) const {
    if (identity) return uv;
    return {static_cast<float>(m[0][0] * uv.x + m[0][1] * uv.y + m[0][2]),
            static_cast<float>(m[1][0] * uv.x + m[1][1] * uv.y + m[1][2])};
  }
  // The chain rule: from derivatives by the transformed coordinates to those by (u, v).
  Vec2 gradient(double dx, double dy) const {
    return {finite(m[0][0] * dx + m[1][0] * dy), finite(m[0][1] * dx + m[1][1] * dy)};
  }
  static float finite(double v) {
    constexpr double largest = std::numeric_limits<float>::max();
    return static_cast<float>(std::clamp(v, -largest, largest));
  }
  static UvTransform from(const description::Object& object) {
    UvTransform t;
    if (object.find("to_uv") == nullptr) return t;
    const description::Mat4 a = object.get_transform("to_uv");
    t.identity = false;
    for (std::size_t row = 0; row < 2; ++row) {
      t.m[row][0] = a[4 * row];
      t.m[row][1] = a[4 * row + 1];
      t.m[row][2] = a[4 * row + 3];
    }
    return t;
  }
};

enum class Wrap { repeat, mirror, clamp };

// Texel coordinates as exact integers; a uv so large that its texel is unknown counts as 0.
std::int64_t to_integer(double v) {
  return std::abs(v) < 1e15 ? static_cast<std::int64_t>(v) : 0;
}

std::uint32_t wrap(std::int64_t i, std::uint32_t size, Wrap mode) {
  const auto n = static_cast<std::int64_t>(size);
  if (i >= 0 && i < n) return static_cast<std::uint32_t>(i);
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
      i = i < 0 ? 0 : n - 1;
      break;
  }
  return static_cast<std::uint32_t>(i);
}

class Bitmap final : public Texture {
 public:
  Bitmap(std::shared_ptr<const TexelImage> image, bool nearest, Wrap mode, const UvTransform& to_uv)
      : image_(std::move(image)), to_uv_(to_uv), wrap_(mode), nearest_(nearest) {
    minimum_ = maximum_ = image_->at(0, 0);
    for (std::uint32_t y = 0; y < image_->height; ++y) {
      for (std::uint32_t x = 0; x < image_->width; ++x) {
        const Spectrum s = image_->at(x, y);
        minimum_ = {std::min(minimum_.r, s.r), std::min(minimum_.g, s.g), std::min(minimum_.b, s.b)};
        maximum_ = {std::max(maximum_.r, s.r), std::max(maximum_.g, s.g), std::max(maximum_.b, s.b)};
      }
    }
  }

  Spectrum eval(Vec2 uv) const override {
    uv = to_uv_(uv);
    if (nearest_) {
      return texel(to_integer(std::floor(static_cast<double>(uv.x) * image_->width)),
                   to_integer(std::floor(static_cast<double>(uv.y) * image_->height)));
    }
    const Cell c = cell(uv);
    const Spectrum top = c.texels[0] * (1 - c.wx) + c.texels[1] * c.wx;
    const Spectrum bottom = c.texels[2] * (1 - c.wx) + c.texels[3] * c.wx;
    return top * (1 - c.wy) + bottom * c.wy;
  }
  TextureGradient gradient(Vec2 uv) const override {
    if (nearest_) return {};
    const Cell c = cell(to_uv_(uv));
    const auto channel = [&](float Spectrum::*i) {
      const double t[4] = {c.texels[0].*i, c.texels[1].*i, c.texels[2].*i, c.texels[3].*i};
      const double wx = c.wx;
      const double wy = c.wy;
      return to_uv_.gradient(image_->width * ((1 - wy) * (t[1] - t[0]) + wy * (t[3] - t[2])),
                             image_->height * ((1 - wx) * (t[2] - t[0]) + wx * (t[3] - t[1])));
    };
    const Vec2 r = channel(&Spectrum::r);
    const Vec2 g = channel(&Spectrum::g);
    const Vec2 b = channel(&Spectrum::b);
    return {{r.x, g.x, b.x}, {r.y, g.y, b.y}};
  }
  Spectrum maximum() const override { return maximum_; }
  Spectrum minimum() const override { return minimum_; }

 private:
  // The four texels around a place (transformed coordinates), rows from the top, and the place among them.
  struct Cell {
    Spectrum texels[4];
    float wx, wy;
  };
  Cell cell(Vec2 uv) const {
    const double x = static_cast<double>(uv.x) * image_->width - 0.5;
    const double y = static_cast<double>(uv.y) * image_->height - 0.5;
    const double fx = std::floor(x);
    const double fy = std::floor(y);
    const std::int64_t ix = to_integer(fx);
    const std::int64_t iy = to_integer(fy);
    const double span_x = x - fx;
    const double span_y = y - fy;
    // NaN coordinates (a mesh's own mistake) read the first texels.
    return {{texel(ix, iy), texel(ix + 1, iy), texel(ix, iy + 1), texel(ix + 1, iy + 1)},
            span_x >= 0 && span_x <= 1 ? static_cast<float>(span_x) : 0.0f,
            span_y >= 0 && span_y <= 1 ? static_cast<float>(span_y) : 0.0f};
  }
  Spectrum texel(std::int64_t x, std::int64_t y) const {
    return image_->at(wrap(x, image_->width, wrap_), wrap(y, image_->height, wrap_));
  }

  std::shared_ptr<const TexelImage> image_;
  UvTransform to_uv_;
  Spectrum minimum_, maximum_;
  Wrap wrap_;
  bool nearest_;
};

class Checkerboard final : public Texture {
 public:
  Checkerboard(ColorTexture color0, ColorTexture color1, const UvTransform& to_uv)
      : color0_(color0), color1_(color1), to_uv_(to_uv) {}

  Spectrum eval(Vec2 uv) const override {
    const Vec2 t = to_uv_(uv);
    const bool x = t.x - std::floor(t.x) > 0.5f;
    const bool y = t.y - std::floor(t.y) > 0.5f;
    return (x == y ? color0_ : color1_).eval(uv);
  }
  TextureGradient gradient(Vec2 /*uv*/) const override { return {}; }
  Spectrum maximum() const override {
    const Spectrum a = color0_.maximum();
    const Spectrum b = color1_.maximum();
    return {std::max(a.r, b.r), std::max(a.g, b.g), std::max(a.b, b.b)};
  }
  Spectrum minimum() const override {
    const Spectrum a = color0_.minimum();
    const Spectrum b = color1_.minimum();
    return {std::min(a.r, b.r), std::min(a.g, b.g), std::min(a.b, b.b)};
  }

 private:
  ColorTexture color0_, color1_;
  UvTransform to_uv_;
};

// A texture times a constant.
class Scale final : public Texture {
 public:
  Scale(const Texture& nested, Spectrum factor) : nested_(nested), factor_(factor) {}
  Spectrum eval(Vec2 uv) const override { return nested_.eval(uv) * factor_; }
  TextureGradient gradient(Vec2 uv) const override {
    const TextureGradient g = nested_.gradient(uv);
    return {finite(g.du * factor_), finite(g.dv * factor_)};
  }
  Spectrum maximum() const override { return nested_.maximum() * factor_; }
  Spectrum minimum() const override { return nested_.minimum() * factor_; }

 private:
  static Spectrum finite(Spectrum s) {
    constexpr float largest = std::numeric_limits<float>::max();
    return {std::clamp(s.r, -largest, largest), std::clamp(s.g, -largest, largest),
            std::clamp(s.b, -largest, largest)};
  }

  const Texture& nested_;
  Spectrum factor_;
};

Error located(std::string message, const description::Object& object, std::string_view property) {
  description::Location where = object.where;
  if (const description::Property* p = object.find(property)) where = p->where;
  return input_error(std::move(message)).at(where.file, where.line).with_field(std::string(property));
}

constexpr int kMaxNesting = 16;

}  // namespace

Result<std::shared_ptr<const TexelImage>> TextureStore::image(const std::string& key, bool raw,
                                                              const description::Location& where) {
  auto& slot = images_[{key, raw}];
  if (slot) return slot;
  auto bytes = files_->open(key);
  if (!bytes.ok()) {
    Error error = std::move(bytes).error();
    if (!error.file.empty()) return error;
    return std::move(error).at(where.file, where.line);
  }
  auto decoded = decode_image(bytes->view, key, raw);
  if (!decoded.ok()) {
    // The reader edits the scene: say where it is named, and which file it is.
    Error error = std::move(decoded).error();
    error.message = "'" + key + "': " + error.message;
    return std::move(error).at(where.file, where.line);
  }
  slot = std::make_shared<const TexelImage>(std::move(decoded).value());
  return slot;
}

std::uint64_t TextureStore::image_bytes() const {
  std::uint64_t bytes = 0;
  for (const auto& [key, image] : images_) {
    if (image) bytes += image->bytes.size() + image->floats.size() * sizeof(float);
  }
  return bytes;
}

Result<const Texture*> TextureStore::build(const description::ObjectPtr& object, int depth) {
  if (const auto found = textures_.find(object); found != textures_.end()) return found->second.get();
  if (depth > kMaxNesting) {
    return located("textures are nested more than 16 deep", *object, "");
  }
  std::unique_ptr<const Texture> texture;
  if (object->plugin == "bitmap") {
    const std::string file = object->get_string("filename", "");
    if (file.empty()) return located("a bitmap texture needs a file", *object, "filename");
    const std::string filter = object->get_string("filter_type", "bilinear");
    if (filter != "bilinear" && filter != "nearest") {
      return located("unknown filter_type '" + filter + "'; known: bilinear, nearest", *object,
                     "filter_type");
    }
    const std::string mode = object->get_string("wrap_mode", "repeat");
    if (mode != "repeat" && mode != "mirror" && mode != "clamp") {
      return located("unknown wrap_mode '" + mode + "'; known: repeat, mirror, clamp", *object, "wrap_mode");
    }
    const description::Property* named = object->find("filename");
    CANDELA_ASSIGN(auto texels, image(file, object->get_bool("raw", false),
                                      named != nullptr ? named->where : object->where));
    texture = std::make_unique<Bitmap>(std::move(texels), filter == "nearest",
                                       mode == "repeat"   ? Wrap::repeat
                                       : mode == "mirror" ? Wrap::mirror
                                                          : Wrap::clamp,
                                       UvTransform::from(*object));
  } else if (object->plugin == "checkerboard") {
    CANDELA_ASSIGN(const ColorTexture color0, color_at_depth(*object, "color0", Spectrum(0.4f), depth + 1));
    CANDELA_ASSIGN(const ColorTexture color1, color_at_depth(*object, "color1", Spectrum(0.2f), depth + 1));
    texture = std::make_unique<Checkerboard>(color0, color1, UvTransform::from(*object));
  } else if (object->plugin == "scale") {
    const auto nested = object->children_of("texture");
    if (nested.size() != 1) return located("a scale texture holds one texture", *object, "");
    CANDELA_ASSIGN(const Texture* inner, build(nested[0], depth + 1));
    const auto rgb = object->get_rgb("scale");
    const auto value = rgb ? rgb->value : description::Vec3{1, 1, 1};
    const Spectrum factor = {static_cast<float>(value[0]), static_cast<float>(value[1]),
                             static_cast<float>(value[2])};
    const Spectrum most = inner->maximum() * factor;
    for (const float bound : {factor.r, factor.g, factor.b, most.r, most.g, most.b}) {
      if (!(bound >= 0 && bound <= std::numeric_limits<float>::max()))
        return located("the scaled texture is finite and not negative", *object, "scale");
    }
    texture = std::make_unique<Scale>(*inner, factor);
  } else {
    return located("the texture plugin '" + object->plugin + "' is not supported", *object, "");
  }
  const Texture* result = texture.get();
  textures_.emplace(object, std::move(texture));
  return result;
}

Result<ColorTexture> TextureStore::color_at_depth(const description::Object& owner, std::string_view name,
                                                  Spectrum otherwise, int depth) {
  ColorTexture result;
  result.constant = otherwise;
  if (const description::Child* child = owner.find_child(name); child != nullptr) {
    CANDELA_ASSIGN(result.texture, build(child->object, depth));
    return result;
  }
  if (const auto rgb = owner.get_rgb(name)) {
    const auto& v = rgb->value;
    result.constant = {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
    for (const double c : v) {
      if (!std::isfinite(static_cast<float>(c)) || c < 0) {
        return located("a colour is finite and not negative", owner, name);
      }
    }
  }
  return result;
}

Result<ColorTexture> TextureStore::color(const description::Object& owner, std::string_view name,
                                         Spectrum otherwise) {
  return color_at_depth(owner, name, otherwise, 0);
}

Result<FloatTexture> TextureStore::number(const description::Object& owner, std::string_view name,
                                          float otherwise) {
  FloatTexture result;
  result.constant = otherwise;
  if (const description::Child* child = owner.find_child(name); child != nullptr) {
    CANDELA_ASSIGN(result.texture, build(child->object, 0));
    return result;
  }
  if (owner.find(name) != nullptr) {
    result.constant = static_cast<float>(owner.get_number(name, static_cast<double>(otherwise)));
    if (!std::isfinite(result.constant)) return located("the number is too large", owner, name);
  }
  return result;
}

}  // namespace candela::scene
