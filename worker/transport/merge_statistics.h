// What a gather (technique/merge.h) may collect of its merges beside their sum: a policy, with
//   kCollects                 false: nothing is computed
//   begin()                   an eye path is next
//   start(v, scale, per_path) its vertex v is next
//   add(offset, value, factor)  a photon at v.hit.p + offset adds value * factor * kernel * per_path to
//                               v.throughput
//   write(...)                of the path, to the accumulators of its pixel
#pragma once

namespace candela::transport {

struct NoStatistics {
  static constexpr bool kCollects = false;
};

}  // namespace candela::transport
