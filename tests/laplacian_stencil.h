// The stencil of the plug-in bandwidth, written out.
#pragma once

namespace candela::adaptive {

// D_h(y) pi h^4 of the five-point stencil of constant kernels for y = (u, v): the number of the four shifted
// discs that y is in, minus 4 if it is in the middle one. 0 for |y| > 2 h.
inline int laplacian_stencil(double u, double v, double h) {
  const auto inside = [&](double cu, double cv) {
    const double du = u - cu, dv = v - cv;
    return du * du + dv * dv < h * h ? 1 : 0;
  };
  return inside(h, 0) + inside(-h, 0) + inside(0, h) + inside(0, -h) - 4 * inside(0, 0);
}

}  // namespace candela::adaptive
