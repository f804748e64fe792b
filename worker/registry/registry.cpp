// The table of integrators of the programs. This file is a library of its own and defines registry() alone,
// so that a program with another definition of registry() among its objects links without it.
#include "worker/integrators/registry.h"

namespace candela::integrators {

const std::vector<IntegratorEntry>& registry() {
  static const std::vector<IntegratorEntry> entries = product_integrators();
  return entries;
}

}  // namespace candela::integrators
