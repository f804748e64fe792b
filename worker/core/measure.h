// Changes of measure of densities. A direction of density p per solid angle meets a surface at distance d
// with the density p |cos| / d^2 per area; in a medium the hazard (per length) takes the cosine's place and
// the density is per volume. Operations are done in the order of the parameters: a caller that has the same
// factors in another order gets other last bits. The oracle (tests/unit/transport_reference.h) converts by
// itself: it shares nothing with what it checks.
#pragma once

namespace candela {

// Per area (or volume), from per solid angle. cosine: or hazard, where the direction arrives.
template <class T>
constexpr T solid_angle_to_area(T pdf_solid_angle, T cosine, T distance_squared) {
  return pdf_solid_angle * cosine / distance_squared;
}
// The same along an edge whose spread is known: 1 / d^2, times what weights count as its survival.
template <class T>
constexpr T solid_angle_to_area_by_spread(T pdf_solid_angle, T spread, T cosine) {
  return pdf_solid_angle * spread * cosine;
}
// Per solid angle, from per area.
template <class T>
constexpr T area_to_solid_angle(T pdf_area, T distance_squared, T cosine) {
  return pdf_area * distance_squared / cosine;
}
// Per solid angle, of a point uniform in `area` that is seen over a distance: a caller whose vector is not
// normalized has the cosine times the distance and needs no division more.
constexpr double uniform_area_to_solid_angle(double area, double distance_squared, double distance,
                                             double cosine_times_distance) {
  return distance_squared * distance / (cosine_times_distance * area);
}
// Per solid angle, of a direction whose place on a plane at unit depth is uniform in `area`. length_cubed: of
// the vector to that place.
constexpr double unit_plane_to_solid_angle(double area, double length_cubed) {
  return length_cubed / area;
}
// Per area across the direction (at unit distance), from per solid angle.
template <class T>
constexpr T solid_angle_to_perpendicular(T pdf_solid_angle, T distance_squared) {
  return pdf_solid_angle / distance_squared;
}
// Per projected solid angle, from per solid angle, and back.
template <class T>
constexpr T solid_angle_to_projected(T pdf_solid_angle, T cosine) {
  return pdf_solid_angle / cosine;
}

}  // namespace candela
