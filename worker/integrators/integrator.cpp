#include "worker/integrators/integrator.h"

#include <array>
#include <string_view>

namespace candela::integrators {

Result<void> ChainIntegrator::run(const UnitContext& /*context*/, const Unit& /*unit*/,
                                  film::UnitFilm& /*film*/, const RunContext& /*run*/) const {
  return internal_error("a job of Markov chains has no iterations");
}

std::string Plan::to_text() const {
  std::string text;
  constexpr std::array<std::string_view, 3> kKinds = {"use  ", "skip ", "note "};  // PlanItem::Kind
  for (const PlanItem& item : items) {
    text += kKinds[static_cast<std::size_t>(item.kind)];
    text += item.technique + ": " + item.reason + '\n';
  }
  return text;
}

}  // namespace candela::integrators
