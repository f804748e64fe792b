// Media, phase functions and volumes, from Mitsuba's documentation: what is here is what Candela renders.
#include "common/description/rules.h"

namespace candela::description::rules {

void add_media(std::vector<PluginRule>& /*table*/) {}

}  // namespace candela::description::rules
