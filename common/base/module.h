// Modules: shared objects with the parts that bring heavy libraries. A program loads one when it first needs
// it, for loading them takes longer than most commands run.
#pragma once

#include "common/base/result.h"

namespace candela {

// The function of that name in the module `name` (candela-NAME.so), which lies beside the program, in
// ../lib/candela, or where the dynamic linker looks (LD_LIBRARY_PATH). A number at a function's end changes
// with what it takes and gives. The module stays loaded. Fails where it is missing, cannot be loaded, or is
// of another version.
Result<void*> load_from_module(const char* name, const char* function);

// Fails if the module is not there; loads nothing.
Result<void> check_module(const char* name);

}  // namespace candela
