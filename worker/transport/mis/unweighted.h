// The policy of walks whose vertices are not weighted: each path is found in one way. Their vertices carry
// nothing, and nothing is computed.
#pragma once

namespace candela::transport {

struct NoBlock {
  struct Densities {};
};

struct Unweighted {
  static constexpr bool kWeighs = false, kMergesBeams = false;
  using Block = NoBlock;
  struct Departure {};
  static double raise(double /*ratio*/) { return 0; }
};

}  // namespace candela::transport
