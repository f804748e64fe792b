// Renders a golden film and hashes its integers.
//
// Unless a setting of its line says otherwise, a film has 48 x 32 pixels, the seed 1, one thread, and the
// reconstruction filter that the scene asks for; merging begins with the radius 0.003 (radius=0: with the
// product's default); an integrator of iterations renders 4 of them, 2 of each
// half, and one with epochs 12; a job of Markov chains has 8 chains, 400 bootstrap samples, and 2 rounds of
// one mutation per pixel.
//
// The hash is over
// * the film's size, layers and scale, which the pilot decides, and the layers' names;
// * for iterations, of each half: the sums of all pixels and layers;
// * for iterations with epochs, the states that were decided;
// * for chains: the plan, b0 and b with their standard errors and numbers of samples, the sums of both
//   layers, and the counts and sums of each chain's record;
// * the sample counts of eye samples, light paths, and rejected samples by cause.
//
// The hash leaves out the count of rays: code that traces a shadow ray earlier, later or not at all may give
// the same film. It leaves out the bytes of a chain's state, whose format may change with the code; what the
// state holds decides the sums of the next round. Doubles are hashed by their bits.
#pragma once

#include <string>

#include "tests/golden/film_table.h"

namespace candela::golden {

// A scene or a setting that cannot be used throws.
std::string film_hash(const GoldenFilm& film);

}  // namespace candela::golden
