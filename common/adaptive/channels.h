// Accumulators of the integrators whose radius follows from tests: their names, channels and scales, and the
// channel of a photon.
//
// phi is what a merge adds to the film before the kernel (throughputs, BSDF, MIS weight, flux,
// one over the number of light paths), divided by pi r_1^2, for balls by 4/3 pi r_1^3, with the first radius
// r_1: its luminance, or for the F test of colors each of its three channels. phi has the unit of film
// values. y is the place of the photon relative to the gather point, in its tangent frame; r is the present
// radius of the pixel. Theory: Lin et al. 2023, section 5.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/film/accumulator.h"

namespace candela::adaptive {

// A disc has 2 annuli of 6 sectors, all of one area; a ball has 2 shells of 6 faces. Channel: ring * 6 +
// sector. Sectors s and (s + 3) % 6 are opposite.
inline constexpr int kSectorsPerRing = 6;
inline constexpr int kSectorChannels = 12;

// Sum of phi; kSectorChannels for each color, those of the first color first. One color is luminance, three
// are red, green and blue.
inline constexpr const char* kSectors = "fppm.sectors";
inline constexpr const char* kSquares = "fppm.squares";  // sum of phi^2 over all sectors, one for each color
inline constexpr int kColors = 3;
inline constexpr const char* kCounts = "cppm.counts";  // number of photons; kSectorChannels
// The sums of merges on surfaces. If media merge too, a second channel has the sums of merges in media, with
// 4/3 pi r_1^3 in place of pi r_1^2.
inline constexpr const char* kMoments = "appm.moments";      // sum of phi^2 k_r(y) pi r_1^2
inline constexpr const char* kLaplacian = "appm.laplacian";  // sum of phi D_h(y) pi r_1^4; signed
inline constexpr const char* kMeans = "appm.means";          // sum of phi k_r(y) pi r_1^2; surfaces alone

// The film's mean has 2^19 to 2^20 film units, so that phi summed over the photons of one iteration is about
// 2^16 units. kSquareShift less bits than twice as many are enough for squares.
inline constexpr int kSectorScaleOffset = -4;
inline constexpr int kSquareShift = 8;

// The scale of sums of phi. Squares have to have a valid scale as well.
inline int sector_scale(int film_scale_log2) {
  return std::clamp(film_scale_log2 + kSectorScaleOffset, (kSquareShift - film::kMaxScaleLog2) / 2,
                    (kSquareShift + film::kMaxScaleLog2) / 2);
}
inline int square_scale(int film_scale_log2) {
  return 2 * sector_scale(film_scale_log2) - kSquareShift;
}

inline film::AccumulatorSpec sectors_spec(int film_scale_log2, std::uint32_t colors = 1) {
  return {kSectors, colors * kSectorChannels, sector_scale(film_scale_log2),
          film::AccumulatorSpec::Per::epoch};
}
inline film::AccumulatorSpec squares_spec(int film_scale_log2, std::uint32_t colors = 1) {
  return {kSquares, colors, square_scale(film_scale_log2), film::AccumulatorSpec::Per::epoch};
}
inline film::AccumulatorSpec counts_spec() {
  return {kCounts, kSectorChannels, 0, film::AccumulatorSpec::Per::epoch};
}
inline film::AccumulatorSpec moments_spec(int film_scale_log2, bool media = false) {
  return {kMoments, media ? 2U : 1U, square_scale(film_scale_log2), film::AccumulatorSpec::Per::epoch};
}
inline film::AccumulatorSpec laplacian_spec(int film_scale_log2, bool media = false) {
  return {kLaplacian, media ? 2U : 1U, sector_scale(film_scale_log2), film::AccumulatorSpec::Per::epoch};
}
inline film::AccumulatorSpec means_spec(int film_scale_log2) {
  return {kMeans, 1, sector_scale(film_scale_log2), film::AccumulatorSpec::Per::epoch};
}

// The sector of angle 60 s to 60 (s + 1) degrees, from the first axis of the frame towards the second. The
// place opposite to (u, v) is in the opposite sector.
template <class Real>
int disc_sector_of(Real u, Real v) {  // without branches: loops over it become vector code
  constexpr auto kSqrt3 = static_cast<Real>(1.7320508075688772);
  const bool lower = (v < 0) | ((v == 0) & (u < 0));
  const Real a = lower ? -u : u, b = lower ? -v : v;
  return (lower ? 3 : 0) + (b < kSqrt3 * a ? 0 : 1) + (b > -kSqrt3 * a ? 0 : 1);
}

// A photon at (u, v) in the disc of this squared radius.
template <class Real>
int disc_channel_of(Real u, Real v, Real radius_squared) {
  const int annulus = 2 * (u * u + v * v) < radius_squared ? 0 : 1;
  return annulus * kSectorsPerRing + disc_sector_of(u, v);
}

// A photon at (x, y, z) in the ball of this radius: the sector is the face of the cube that the direction
// points at; opposite faces differ by 3.
inline int ball_channel(double x, double y, double z, double radius) {
  const double squared = x * x + y * y + z * z;
  // |p|^3 < r^3 / 2 without a root.
  const double cube = radius * radius * radius;
  const int shell = 4 * squared * squared * squared < cube * cube ? 0 : 1;
  const double ax = x < 0 ? -x : x, ay = y < 0 ? -y : y, az = z < 0 ? -z : z;
  const int axis = ax >= ay && ax >= az ? 0 : ay >= az ? 1 : 2;
  const double along = axis == 0 ? x : axis == 1 ? y : z;
  return shell * kSectorsPerRing + axis + (along < 0 ? 3 : 0);
}

}  // namespace candela::adaptive
