// Statistics that a gather (technique/merge.h) may collect beside the sum: a policy, with
//   kCollects   false: nothing is computed, and nothing else is asked for
//   place(at)   optional: the eye path that is next is of this place on the film
//   begin()     an eye path is next
//   start(v, scale, per_path)
//               its vertex v is next
//   add(offset, value, factor, kernel)
//               a photon at v.hit.p + offset adds v.throughput * value * factor * kernel * per_path
//   end()       there are no more of the vertex
//   kReaches    true: photons up to reach(surface) are wanted too. Those beyond the radius come with a kernel
//               of 0
//   write(accumulators, x, y, weight, key, alone)
//               adds the path's statistics to a pixel, those of an eye path of this weight on the film: all
//               of them, or none and false, if an accumulator cannot hold its own. Any number of threads may
//               write at once; alone: no other thread writes to this pixel
// Statistics are of luminance, or of the three channels, relative to phi: what a merge adds before the
// kernel, over the area (surfaces) or volume (media) of the first radius r_1, so that phi has the unit of the
// film. Accumulators are in the order of the integrator's plan of work.
#pragma once

namespace candela::transport {

struct NoStatistics {
  static constexpr bool kCollects = false, kReaches = false;
};

}  // namespace candela::transport
