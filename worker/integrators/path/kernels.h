// The kernels of kernel.h by what a plan decided.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "worker/integrators/path/kernel.h"

namespace candela::integrators::path {

template <class SamplerT>
using RadianceFunction = Spectrum (*)(const scene::Scene&, const Limits&, Ray, SamplerT&, film::Tallies&);

template <class SamplerT, std::size_t... I>
constexpr auto make_kernels(std::index_sequence<I...> /*numbers*/) {
  return std::array<RadianceFunction<SamplerT>, sizeof...(I)>{
      &radiance<(I & 1) != 0, (I & 2) != 0, (I & 4) != 0, (I & 8) != 0, static_cast<Between>(I >> 4),
                scene::Scene, SamplerT>...};
}

template <class SamplerT>
RadianceFunction<SamplerT> kernel_for(const Techniques& t) {
  static constexpr auto kKernels = make_kernels<SamplerT>(std::make_index_sequence<48>{});
  return kKernels[std::size_t{t.next_event} | std::size_t{t.hit_emitters} << 1 |
                  std::size_t{t.environment} << 2 | std::size_t{t.weigh} << 3 |
                  static_cast<std::size_t>(t.between) << 4];
}

}  // namespace candela::integrators::path
