#include "worker/integrators/integrator.h"

#include <array>
#include <string_view>

namespace candela::integrators {

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
