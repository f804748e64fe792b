// Textures without images, and the store that owns all textures. Meanings are Mitsuba 3's.
#include "worker/scene/textures/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "worker/scene/media/volume.h"
#include "worker/scene/textures/bitmap.h"
#include "worker/scene/textures/mesh_textures.h"
#include "worker/scene/textures/uv_transform.h"

namespace candela::scene {
namespace {

class Checkerboard final : public Texture {
 public:
  Checkerboard(ColorTexture color0, ColorTexture color1, const UvTransform& to_uv)
      : color0_(color0), color1_(color1), to_uv_(to_uv) {}

  Spectrum eval(const SurfacePoint& at) const override {
    const Vec2 t = to_uv_(at.uv);
    const bool x = t.x - std::floor(t.x) > 0.5f;
    const bool y = t.y - std::floor(t.y) > 0.5f;
    return (x == y ? color0_ : color1_).eval(at);
  }
  TextureGradient gradient(const SurfacePoint& /*at*/) const override { return {}; }
  Spectrum maximum() const override { return max(color0_.maximum(), color1_.maximum()); }
  Spectrum minimum() const override { return min(color0_.minimum(), color1_.minimum()); }

 private:
  ColorTexture color0_, color1_;
  UvTransform to_uv_;
};

// Lines where u or v is an integer, with line_width to both sides.
class GridLines final : public Texture {
 public:
  GridLines(ColorTexture between, ColorTexture lines, double width, const UvTransform& to_uv)
      : between_(between), lines_(lines), width_(width), to_uv_(to_uv) {}

  Spectrum eval(const SurfacePoint& at) const override {
    const Vec2 t = to_uv_(at.uv);
    const auto distance = [](float x) {
      const double fraction = static_cast<double>(x) - std::floor(static_cast<double>(x));
      return std::min(fraction, 1 - fraction);
    };
    return (distance(t.x) < width_ || distance(t.y) < width_ ? lines_ : between_).eval(at);
  }
  TextureGradient gradient(const SurfacePoint& /*at*/) const override { return {}; }
  Spectrum maximum() const override { return max(between_.maximum(), lines_.maximum()); }
  Spectrum minimum() const override { return min(between_.minimum(), lines_.minimum()); }

 private:
  ColorTexture between_, lines_;
  double width_;
  UvTransform to_uv_;
};

// A volume where the surface is in the world.
class VolumeTexture final : public Texture {
 public:
  explicit VolumeTexture(Volume volume) : volume_(std::move(volume)), maximum_(volume_.maximum()) {}
  Spectrum eval(const SurfacePoint& at) const override { return volume_.eval(Vec3d(at.p)); }
  TextureGradient gradient(const SurfacePoint& /*at*/) const override { return {}; }
  Spectrum maximum() const override { return maximum_; }
  Spectrum minimum() const override { return volume_.grid == nullptr ? volume_.constant : Spectrum(); }

 private:
  Volume volume_;
  Spectrum maximum_;
};

// The same value everywhere.
class RawConstant final : public Texture {
 public:
  explicit RawConstant(Spectrum value) : value_(value) {}
  Spectrum eval(const SurfacePoint& /*at*/) const override { return value_; }
  TextureGradient gradient(const SurfacePoint& /*at*/) const override { return {}; }
  Spectrum maximum() const override { return value_; }
  Spectrum minimum() const override { return value_; }

 private:
  Spectrum value_;
};

// A texture times a constant.
class Scale final : public Texture {
 public:
  Scale(const Texture& nested, Spectrum factor) : nested_(nested), factor_(factor) {}
  Spectrum eval(const SurfacePoint& at) const override { return nested_.eval(at) * factor_; }
  TextureGradient gradient(const SurfacePoint& at) const override {
    const TextureGradient g = nested_.gradient(at);
    return {finite(g.du * factor_), finite(g.dv * factor_)};
  }
  Spectrum maximum() const override { return nested_.maximum() * factor_; }
  Spectrum minimum() const override { return nested_.minimum() * factor_; }
  const Texture& nested() const { return nested_; }

 private:
  static Spectrum finite(Spectrum s) {
    constexpr float largest = std::numeric_limits<float>::max();
    return {std::clamp(s.r, -largest, largest), std::clamp(s.g, -largest, largest),
            std::clamp(s.b, -largest, largest)};
  }

  const Texture& nested_;
  Spectrum factor_;
};

// Two textures mixed by a third, at most `most`. Amounts above 1 go on beyond the second, so that a mix of
// black and a texture is their product with the amount. `root`: the square root of that.
class Mix final : public Texture {
 public:
  Mix(ColorTexture color0, ColorTexture color1, FloatTexture amount, float most, bool root)
      : color0_(color0), color1_(color1), amount_(amount), most_(most), root_(root) {
    // Kept, for bounds of mixes in mixes ask for each other's many times.
    minimum_ = result(corner(false));
    maximum_ = result(corner(true));
  }

  Spectrum eval(const SurfacePoint& at) const override {
    return result(mixed(color0_.eval(at), color1_.eval(at), amount_.eval(at)));
  }
  TextureGradient gradient(const SurfacePoint& at) const override {
    const Spectrum a = color0_.eval(at), b = color1_.eval(at);
    const float t = amount_.eval(at);
    const TextureGradient ga = gradient_of(color0_, at), gb = gradient_of(color1_, at);
    const Vec2 gt = amount_.gradient(at);
    const Spectrum value = mixed(a, b, t);
    const Spectrum across = b + a * -1.0f;
    return {slope(value, mixed(ga.du, gb.du, t) + across * gt.x),
            slope(value, mixed(ga.dv, gb.dv, t) + across * gt.y)};
  }
  Spectrum maximum() const override { return maximum_; }
  Spectrum minimum() const override { return minimum_; }

 private:
  static Spectrum mixed(Spectrum a, Spectrum b, float t) { return a * (1 - t) + b * t; }
  static TextureGradient gradient_of(const ColorTexture& color, const SurfacePoint& at) {
    return color.texture == nullptr ? TextureGradient{} : color.texture->gradient(at);
  }
  float clamp(float value) const { return std::clamp(value, 0.0f, most_); }
  float result(float value) const { return root_ ? std::sqrt(clamp(value)) : clamp(value); }
  Spectrum result(Spectrum s) const { return {result(s.r), result(s.g), result(s.b)}; }
  // Flat where the value is clamped.
  float slope(float value, float gradient) const {
    constexpr float largest = std::numeric_limits<float>::max();
    if (!(value >= 0 && value <= most_)) return 0;
    if (root_) gradient = value > 0 ? gradient / (2 * std::sqrt(value)) : 0;
    return std::clamp(gradient, -largest, largest);
  }
  Spectrum slope(Spectrum value, Spectrum gradient) const {
    return {slope(value.r, gradient.r), slope(value.g, gradient.g), slope(value.b, gradient.b)};
  }
  // The mix is linear in each of its parts, so that its bounds are among those of the parts.
  Spectrum corner(bool largest) const {
    std::optional<Spectrum> bound;
    const std::array<Spectrum, 2> as = {color0_.minimum(), color0_.maximum()};
    const std::array<Spectrum, 2> bs = {color1_.minimum(), color1_.maximum()};
    const std::array<float, 2> ts = {amount_.minimum(), amount_.maximum()};
    for (const Spectrum& a : as)
      for (const Spectrum& b : bs)
        for (const float t : ts) {
          const Spectrum value = mixed(a, b, t);
          if (!bound) bound = value;
          const auto pick = [&](float x, float y) { return largest ? std::max(x, y) : std::min(x, y); };
          bound = Spectrum{pick(bound->r, value.r), pick(bound->g, value.g), pick(bound->b, value.b)};
        }
    return *bound;
  }

  ColorTexture color0_, color1_;
  FloatTexture amount_;
  float most_;
  bool root_;
  Spectrum minimum_, maximum_;
};

// The mean of the three channels, as gray.
class MeanOfChannels final : public Texture {
 public:
  explicit MeanOfChannels(std::unique_ptr<const Texture> nested) : nested_(std::move(nested)) {}
  Spectrum eval(const SurfacePoint& at) const override { return mean(nested_->eval(at)); }
  TextureGradient gradient(const SurfacePoint& at) const override {
    const TextureGradient g = nested_->gradient(at);
    return {mean(g.du), mean(g.dv)};
  }
  Spectrum maximum() const override { return mean(nested_->maximum()); }
  Spectrum minimum() const override { return mean(nested_->minimum()); }

 private:
  static Spectrum mean(Spectrum s) {
    return s.r == s.g && s.g == s.b ? s : Spectrum(s.r / 3 + s.g / 3 + s.b / 3);
  }
  std::unique_ptr<const Texture> nested_;
};

Error located(std::string message, const description::Object& object, std::string_view property) {
  description::Location where = object.where;
  if (const description::Property* p = object.find(property)) where = p->where;
  return input_error(std::move(message)).at(where.file, where.line).with_field(std::string(property));
}

// Colors and numbers of a scene are not negative; attributes of meshes may be.
Result<void> check_sign(const Texture& texture, const description::Object& owner, std::string_view name) {
  if (texture.minimum().min_component() < 0) return located("the texture has negative values", owner, name);
  return {};
}

constexpr int kMaxNesting = 16;

constexpr std::pair<std::string_view, Wrap> kWrapModes[] = {{"repeat", Wrap::repeat},
                                                            {"mirror", Wrap::mirror},
                                                            {"clamp", Wrap::clamp},
                                                            {"zero", Wrap::zero},
                                                            {"one", Wrap::one}};

}  // namespace

std::optional<std::array<std::uint32_t, 2>> size_of(const Texture* texture) {
  while (const auto* scale = dynamic_cast<const Scale*>(texture)) texture = &scale->nested();
  const auto* bitmap = dynamic_cast<const Bitmap*>(texture);
  if (bitmap == nullptr) return std::nullopt;
  return std::array{bitmap->image().width, bitmap->image().height};
}

double aspect_of(const Texture* texture) {
  const auto size = size_of(texture);
  return size ? static_cast<double>((*size)[0]) / static_cast<double>((*size)[1]) : 1;
}

Result<std::shared_ptr<const TexelImage>> TextureStore::image(const std::string& key,
                                                              const ImageReading& reading,
                                                              const description::Location& where) {
  auto& slot = images_[{key, reading}];
  if (slot) return slot;
  auto bytes = files_->open(key);
  if (!bytes.ok()) {
    Error error = std::move(bytes).error();
    if (!error.file.empty()) return error;
    return std::move(error).at(where.file, where.line);
  }
  auto decoded = decode_image(bytes->view, key, reading, scratch_);
  if (!decoded.ok()) {
    // The reader edits the scene: say where it is named, and which file it is.
    Error error = std::move(decoded).error();
    error.message = "'" + key + "': " + error.message;
    return std::move(error).at(where.file, where.line);
  }
  slot = std::make_shared<const TexelImage>(std::move(decoded).value());
  return slot;
}

Result<std::unique_ptr<const Texture>> TextureStore::build_bitmap(const description::Object& object) {
  const std::string file = object.get_string("filename", "");
  if (file.empty()) return located("a bitmap texture needs a file", object, "filename");
  Bitmap::Settings settings;
  const std::string filter = object.get_string("filter_type", "bilinear");
  if (filter != "bilinear" && filter != "nearest") {
    return located("unknown filter_type '" + filter + "'; known: bilinear, nearest", object, "filter_type");
  }
  settings.nearest = filter == "nearest";
  const std::string both = object.get_string("wrap_mode", "repeat");
  for (auto [name, mode] :
       {std::pair("wrap_mode_u", &settings.wrap_u), std::pair("wrap_mode_v", &settings.wrap_v)}) {
    const std::string text = object.get_string(name, both);
    const auto known = std::find_if(std::begin(kWrapModes), std::end(kWrapModes),
                                    [&](const auto& entry) { return entry.first == text; });
    if (known == std::end(kWrapModes)) {
      return located("unknown wrap mode '" + text + "'; known: repeat, mirror, clamp, zero, one", object,
                     object.find(name) != nullptr ? name : "wrap_mode");
    }
    *mode = known->second;
  }
  settings.to_uv = UvTransform::from(object);

  ImageReading reading;
  if (object.get_bool("raw", false)) reading.encoding = ImageReading::Encoding::linear;
  if (object.find("gamma") != nullptr) {
    const double gamma = object.get_number("gamma", 0);
    if (object.find("raw") != nullptr) return located("give either raw or gamma, not both", object, "gamma");
    if (!(gamma > 0) && gamma != 0 && gamma != -1)
      return located("gamma is above 0, or -1 for sRGB, or 0 for what the file means", object, "gamma");
    reading.encoding = gamma == 0    ? ImageReading::Encoding::file
                       : gamma == -1 ? ImageReading::Encoding::srgb
                       : gamma == 1  ? ImageReading::Encoding::linear
                                     : ImageReading::Encoding::power;
    if (reading.encoding == ImageReading::Encoding::power) reading.gamma = gamma;
  }
  reading.channel = object.get_string("channel", "");
  const bool as_number = reading.channel == "number";
  if (!reading.channel.empty() && !as_number &&
      (reading.channel.size() != 1 ||
       std::string_view("rgba").find(reading.channel) == std::string_view::npos))
    return located("unknown channel '" + reading.channel + "'; known: r, g, b, a, number", object, "channel");
  const description::Property* named = object.find("filename");
  CANDELA_ASSIGN(auto texels, image(file, reading, named != nullptr ? named->where : object.where));
  const bool is_gray = texels->format == TexelFormat::gray8 || texels->format == TexelFormat::gray32;
  std::unique_ptr<const Texture> bitmap = std::make_unique<Bitmap>(std::move(texels), settings);
  if (as_number && !is_gray) bitmap = std::make_unique<MeanOfChannels>(std::move(bitmap));
  return bitmap;
}

Result<const Texture*> TextureStore::build(const description::ObjectPtr& object, int depth) {
  if (const auto found = textures_.find(object); found != textures_.end()) return found->second.get();
  if (depth > kMaxNesting) {
    return located("textures are nested more than 16 deep", *object, "");
  }
  constexpr std::uint64_t kBytes = 256;  // of a texture, without its texels
  CANDELA_TRY(files_->budget().charge(kBytes, object->where, "textures"));
  std::unique_ptr<const Texture> texture;
  if (object->plugin == "bitmap") {
    CANDELA_ASSIGN(texture, build_bitmap(*object));
  } else if (object->plugin == "checkerboard") {
    CANDELA_ASSIGN(const ColorTexture color0, color_at_depth(*object, "color0", Spectrum(0.4f), depth + 1));
    CANDELA_ASSIGN(const ColorTexture color1, color_at_depth(*object, "color1", Spectrum(0.2f), depth + 1));
    texture = std::make_unique<Checkerboard>(color0, color1, UvTransform::from(*object));
  } else if (object->plugin == "mix") {
    CANDELA_ASSIGN(const ColorTexture color0, color_at_depth(*object, "color0", Spectrum(0.0f), depth + 1));
    CANDELA_ASSIGN(const ColorTexture color1, color_at_depth(*object, "color1", Spectrum(1.0f), depth + 1));
    CANDELA_ASSIGN(const FloatTexture amount, number_at_depth(*object, "amount", 0.5f, depth + 1));
    const double most = object->get_number("maximum", std::numeric_limits<float>::max());
    texture = std::make_unique<Mix>(
        color0, color1, amount, static_cast<float>(std::min<double>(most, std::numeric_limits<float>::max())),
        object->get_bool("root", false));
    const Spectrum bound = texture->maximum();
    for (const float component : {bound.r, bound.g, bound.b})
      if (!std::isfinite(component)) return located("the mixed texture is finite", *object, "color1");
  } else if (object->plugin == "rawconstant") {
    const description::Property* given = object->find("value");
    const bool is_vector = given != nullptr && (given->type == description::PropertyType::vector ||
                                                given->type == description::PropertyType::point);
    const auto rgb = is_vector ? std::nullopt : object->get_rgb("value");
    const auto value = rgb ? rgb->value : object->get_vec3("value", {1, 1, 1});
    const Spectrum constant = {static_cast<float>(value[0]), static_cast<float>(value[1]),
                               static_cast<float>(value[2])};
    for (const float c : {constant.r, constant.g, constant.b}) {
      if (!(c >= 0 && c <= std::numeric_limits<float>::max()))
        return located("the value is finite and not negative", *object, "value");
    }
    texture = std::make_unique<RawConstant>(constant);
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
  } else if (object->plugin == "gridtexture") {
    CANDELA_ASSIGN(const ColorTexture color0, color_at_depth(*object, "color0", Spectrum(0.2f), depth + 1));
    CANDELA_ASSIGN(const ColorTexture color1, color_at_depth(*object, "color1", Spectrum(0.4f), depth + 1));
    texture = std::make_unique<GridLines>(color0, color1, object->get_number("line_width", 0.01),
                                          UvTransform::from(*object));
  } else if (object->plugin == "volume") {
    CANDELA_ASSIGN(Volume volume, Volume::build(*object, "volume", 0.75, *files_));
    texture = std::make_unique<VolumeTexture>(std::move(volume));
  } else if (object->plugin == "wireframe" && geometry_ != nullptr) {
    CANDELA_ASSIGN(const ColorTexture interior,
                   color_at_depth(*object, "interior_color", Spectrum(0.5f), depth + 1));
    CANDELA_ASSIGN(const ColorTexture edges,
                   color_at_depth(*object, "edge_color", Spectrum(0.1f), depth + 1));
    texture = wireframe(*object, interior, edges, *geometry_);
  } else if (object->plugin == "mesh_attribute" && geometry_ != nullptr) {
    CANDELA_ASSIGN(texture, mesh_attribute(*object, *geometry_));
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
    CANDELA_TRY(check_sign(*result.texture, owner, name));
    return result;
  }
  if (const auto rgb = owner.get_rgb(name)) {
    const auto& v = rgb->value;
    result.constant = {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
    for (const double c : v) {
      if (!std::isfinite(static_cast<float>(c)) || c < 0) {
        return located("a color is finite and not negative", owner, name);
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
  return number_at_depth(owner, name, otherwise, 0);
}

Result<FloatTexture> TextureStore::number_at_depth(const description::Object& owner, std::string_view name,
                                                   float otherwise, int depth) {
  FloatTexture result;
  result.constant = otherwise;
  if (const description::Child* child = owner.find_child(name); child != nullptr) {
    CANDELA_ASSIGN(result.texture, build(child->object, depth));
    CANDELA_TRY(check_sign(*result.texture, owner, name));
    return result;
  }
  if (owner.find(name) != nullptr) {
    result.constant = static_cast<float>(owner.get_number(name, static_cast<double>(otherwise)));
    if (!std::isfinite(result.constant)) return located("the number is too large", owner, name);
  }
  return result;
}

ColorTexture TextureStore::scaled(const ColorTexture& texture, float factor) {
  if (texture.is_constant()) return {texture.constant * factor, nullptr};
  scaled_.push_back(std::make_unique<Scale>(*texture.texture, Spectrum(factor)));
  return {{}, scaled_.back().get()};
}

Result<FloatTexture> TextureStore::nested_number(const description::ObjectPtr& object) {
  FloatTexture result;
  CANDELA_ASSIGN(result.texture, build(object, 0));
  return result;
}

}  // namespace candela::scene
