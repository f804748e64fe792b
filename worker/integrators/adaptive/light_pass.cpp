#include "worker/integrators/adaptive/light_pass.h"

namespace candela::integrators::merging {

CANDELA_LIGHT_PASS(nothing);
CANDELA_LIGHT_PASS(surfaces);
CANDELA_LIGHT_PASS(media);

}  // namespace candela::integrators::merging
