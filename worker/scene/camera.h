// The camera as light paths see it.
//
// Film positions are in pixels, (0, 0) the top left corner. A pixel's value is the integral over film
// positions of its normalized filter f times the radiance along the ray of that position, averaged over the
// lens: camera_ray with weight 1. Importance is normalized so that light paths measure the same: a path
// vertex of throughput T (flux / pdf of the light path so far) connected to the camera adds
//   T * bsdf * |cos at the vertex| * importance / pdf_solid_angle * f(film position - pixel center)
// divided by the number of light paths. So importance is W_e of [Veach 1997, Sec. 8.3.2] with the film
// measured in pixels: pixels^2 / (m^2 sr), with the cosine at the lens divided out as Veach does.
#pragma once

#include "worker/core/vec.h"

namespace candela::scene {

// A lens point chosen as seen from a reference point.
struct CameraSample {
  Vec3 wi;  // unit, world, from the reference towards the lens
  Vec3 p;   // on the lens; orthographic: on the near plane
  Vec3 ng;  // unit, of the lens, towards the scene
  float film_x = 0, film_y = 0;
  // Arriving along -wi. A pinhole (delta_position): importance / r^2 in the limit of a small lens; an
  // orthographic camera (delta_direction): pixels^2 per m^2 across the view direction.
  float importance = 0;
  float pdf_solid_angle = 0;  // of wi at the reference; 1 where delta: there is but one choice
  float cosine = 0;           // between ng and -wi; 1 for an orthographic camera
  bool delta_position = false, delta_direction = false;
  Ray shadow_ray;  // from the offset reference, ends just before the near plane
};

// Density with which camera_ray chooses a given ray if film positions are uniform over the film of width *
// height pixels. (One ray a pixel: times width * height.)
struct CameraDensity {
  Vec3 p;  // where the ray leaves the lens (orthographic: the near plane)
  float film_x = 0, film_y = 0;
  float pdf_area = 0;         // of the lens point; 1, discrete, where delta_position.
                              // Orthographic: of the point across the view direction
  float pdf_solid_angle = 0;  // of the direction given the lens point; 1, discrete, where delta_direction
  float importance = 0;  // W_e as above; meaningless for a pinhole, whose lens nothing hits by chance, where
                         // it is pixels^2 / sr
  float cosine = 0;      // between the ray and the lens' normal; 1 for an orthographic camera
  bool delta_position = false, delta_direction = false;
};

}  // namespace candela::scene
