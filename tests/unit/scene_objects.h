// Descriptions of objects without a scene file, and the images that they name.
#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/description/object.h"
#include "worker/core/vec.h"

namespace candela::test {

using description::Object;
using description::Property;
using description::PropertyType;

class MemoryFiles final : public description::FileSource {
 public:
  std::map<std::string, std::string> files;
  mutable int opened = 0;
  Result<Bytes> open(const std::string& key) const override {
    ++opened;
    const auto found = files.find(key);
    if (found == files.end()) return input_error("no file '" + key + "'");
    return Bytes{nullptr, found->second};
  }
};

// Rows of PFM run from the bottom; texels[0] is the top left one.
inline std::string pfm(std::uint32_t width, std::uint32_t height, const std::vector<Spectrum>& texels) {
  std::string out = "PF\n" + std::to_string(width) + " " + std::to_string(height) + "\n-1.0\n";
  for (std::uint32_t row = 0; row < height; ++row) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const Spectrum s = texels[(height - 1 - row) * width + x];
      const float rgb[3] = {s.r, s.g, s.b};
      char bytes[12];
      std::memcpy(bytes, rgb, 12);
      out.append(bytes, 12);
    }
  }
  return out;
}
inline std::string ppm(std::uint32_t width, std::uint32_t height, const std::vector<int>& rgb) {
  std::string out = "P6\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n";
  for (const int v : rgb) out.push_back(static_cast<char>(v));
  return out;
}

inline Property text(const std::string& name, const std::string& value) {
  return {name, PropertyType::string, value, {"scene.xml", 7}};
}
inline Property number(const std::string& name, double value) {
  return {name, PropertyType::number, value, {"scene.xml", 8}};
}
inline Property flag(const std::string& name, bool value) {
  return {name, PropertyType::boolean, value, {"scene.xml", 8}};
}
inline Property rgb(const std::string& name, double r, double g, double b) {
  return {name, PropertyType::rgb, description::Rgb{{r, g, b}}, {"scene.xml", 9}};
}
inline Property matrix(const std::string& name, const description::Mat4& m) {
  return {name, PropertyType::transform, m, {"scene.xml", 10}};
}
inline std::shared_ptr<Object> object(const std::string& category, const std::string& plugin,
                                      std::vector<Property> properties) {
  auto o = std::make_shared<Object>();
  o->category = category;
  o->plugin = plugin;
  o->where = {"scene.xml", 5};
  o->properties = std::move(properties);
  return o;
}

}  // namespace candela::test
