#include "worker/integrators/bdpt/mollified.h"

#include "worker/integrators/bdpt/run_kernel.h"

namespace candela::integrators::bdpt {
namespace {

class MollifyingSink : public FilmSink {
 public:
  using FilmSink::FilmSink;

  void mollified_eye(const transport::Contribution& light, std::uint32_t s, std::uint32_t t) {
    eye(light, s, t);
    add_mollified(light, s, t);
  }
  void mollified_light(const transport::Contribution& light_found, std::uint32_t s, std::uint32_t t,
                       transport::FilmPosition at, std::uint64_t key) {
    light(light_found, s, t, at, key, nullptr, nullptr);
    splat_mollified(light_found, at, key);
  }
};

template <class MisT, bool kL>
struct MollifiedConfig
    : estimators::BidirectionalConfig<transport::EdgeContent::media, MisT, MollifyingSink, kL> {
  static constexpr bool kMollifies = true;
};

}  // namespace

Run mollified_run_for(transport::MisHeuristic heuristic) {
  using transport::MisHeuristic;
  switch (heuristic) {
    case MisHeuristic::balance:
      return &run_kernel<MollifiedConfig<transport::Balance, false>>;
    case MisHeuristic::power:
      return &run_kernel<MollifiedConfig<transport::Power, false>>;
    case MisHeuristic::maximum:
    case MisHeuristic::cutoff:
      break;
  }
  return &run_kernel<MollifiedConfig<transport::Balance, true>>;
}

}  // namespace candela::integrators::bdpt
