// Image files as the renderer reads them.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "worker/core/math.h"
#include "worker/scene/textures/image_decode.h"

namespace candela::test {

inline scene::TexelImage decode(const std::string& bytes, const std::string& name,
                                const scene::ImageReading& reading = {}) {
  scene::Scratch scratch({});
  auto image = scene::decode_image(bytes, name, reading, scratch);
  EXPECT_TRUE(image.ok()) << name << ": " << image.error().to_string();
  return image.ok() ? std::move(image).value() : scene::TexelImage{};
}

// Empty if the image can be read.
inline std::string error_of(const std::string& bytes, const std::string& name,
                            const scene::ImageReading& reading = {}) {
  scene::Scratch scratch({});
  const auto image = scene::decode_image(bytes, name, reading, scratch);
  return image.ok() ? "" : image.error().to_string();
}

inline float from_srgb(double v) {
  return static_cast<float>(v <= 0.04045 ? v / 12.92 : math::pow((v + 0.055) / 1.055, 2.4));
}

}  // namespace candela::test
