#include "worker/loaders/pbrt_cloud.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace candela::loaders {
namespace {

// Ken Perlin's permutation of 0 to 255.
constexpr std::array<std::uint8_t, 256> kPermutation = {
    151, 160, 137, 91,  90,  15,  131, 13,  201, 95,  96,  53,  194, 233, 7,   225, 140, 36,  103, 30,
    69,  142, 8,   99,  37,  240, 21,  10,  23,  190, 6,   148, 247, 120, 234, 75,  0,   26,  197, 62,
    94,  252, 219, 203, 117, 35,  11,  32,  57,  177, 33,  88,  237, 149, 56,  87,  174, 20,  125, 136,
    171, 168, 68,  175, 74,  165, 71,  134, 139, 48,  27,  166, 77,  146, 158, 231, 83,  111, 229, 122,
    60,  211, 133, 230, 220, 105, 92,  41,  55,  46,  245, 40,  244, 102, 143, 54,  65,  25,  63,  161,
    1,   216, 80,  73,  209, 76,  132, 187, 208, 89,  18,  169, 200, 196, 135, 130, 116, 188, 159, 86,
    164, 100, 109, 198, 173, 186, 3,   64,  52,  217, 226, 250, 124, 123, 5,   202, 38,  147, 118, 126,
    255, 82,  85,  212, 207, 206, 59,  227, 47,  16,  58,  17,  182, 189, 28,  42,  223, 183, 170, 213,
    119, 248, 152, 2,   44,  154, 163, 70,  221, 153, 101, 155, 167, 43,  172, 9,   129, 22,  39,  253,
    19,  98,  108, 110, 79,  113, 224, 232, 178, 185, 112, 104, 218, 246, 97,  228, 251, 34,  242, 193,
    238, 210, 144, 12,  191, 179, 162, 241, 81,  51,  145, 235, 249, 14,  239, 107, 49,  192, 214, 31,
    181, 199, 106, 157, 184, 84,  204, 176, 115, 121, 50,  45,  127, 4,   150, 254, 138, 236, 205, 93,
    222, 114, 67,  29,  24,  72,  243, 141, 128, 195, 78,  66,  215, 61,  156, 180};

std::uint8_t permuted(std::uint32_t i) {
  return kPermutation[i & 255];
}

// The gradient of a corner of the lattice times the way from there.
float corner(std::uint32_t x, std::uint32_t y, std::uint32_t z, Vec3 d) {
  const std::uint32_t hash = permuted(permuted(permuted(x) + y) + z) & 15;
  const float u = hash < 8 || hash == 12 || hash == 13 ? d.x : d.y;
  const float v = hash < 4 || hash == 12 || hash == 13 ? d.y : d.z;
  return ((hash & 1) != 0 ? -u : u) + ((hash & 2) != 0 ? -v : v);
}

float smooth(float t) {
  return t * t * t * (t * (6 * t - 15) + 10);
}

float lerp(float t, float a, float b) {
  return (1 - t) * a + t * b;
}

// By forward differences, as pbrt has them.
Vec3 noise_slope(Vec3 p) {
  constexpr float kStep = 0.01f;
  const float here = gradient_noise(p);
  return Vec3{gradient_noise(p + Vec3{kStep, 0, 0}) - here, gradient_noise(p + Vec3{0, kStep, 0}) - here,
              gradient_noise(p + Vec3{0, 0, kStep}) - here} /
         kStep;
}

}  // namespace

float gradient_noise(Vec3 p) {
  // Beyond this, floats are whole numbers and the noise is 0.
  constexpr float kLargest = 0x1p24f;
  std::array<std::uint32_t, 3> i{};
  std::array<float, 3> way{};
  for (int k = 0; k < 3; ++k) {
    const float x = std::clamp(p[k], -kLargest, kLargest), whole = std::floor(x);
    i[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(static_cast<std::int32_t>(whole));
    way[static_cast<std::size_t>(k)] = x - whole;
  }
  const Vec3 d{way[0], way[1], way[2]};
  const auto along_x = [&](std::uint32_t y, std::uint32_t z) {
    const float dy = d.y - static_cast<float>(y), dz = d.z - static_cast<float>(z);
    return lerp(smooth(d.x), corner(i[0], i[1] + y, i[2] + z, {d.x, dy, dz}),
                corner(i[0] + 1, i[1] + y, i[2] + z, {d.x - 1, dy, dz}));
  };
  const float wy = smooth(d.y);
  return lerp(smooth(d.z), lerp(wy, along_x(0, 0), along_x(1, 0)), lerp(wy, along_x(0, 1), along_x(1, 1)));
}

float PbrtCloud::at(Vec3 p) const {
  Vec3 q = p * frequency;
  if (wispiness > 0) {
    float step = 0.05f * wispiness, lattice = 10;
    for (int i = 0; i < 2; ++i) {
      q = q + noise_slope(q * lattice) * step;
      step *= 0.5f;
      lattice *= 1.99f;
    }
  }
  float sum = 0, weight = 0.5f, lattice = 1;
  for (int i = 0; i < 5; ++i) {
    sum += weight * gradient_noise(q * lattice);
    weight *= 0.5f;
    lattice *= 1.99f;
  }
  const float thinned = std::clamp((1 - p.y) * 4.5f * density * sum, 0.0f, 1.0f);
  return std::clamp(thinned + 2 * std::max(0.0f, 0.5f - p.y), 0.0f, 1.0f);
}

}  // namespace candela::loaders
