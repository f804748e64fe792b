// Linked into each test binary: tests take and give back films as renderers do, and are slow if every one is
// paged in anew.
#include "common/base/memory.h"

namespace {

[[maybe_unused]] const bool kept = [] {
  candela::keep_freed_memory();
  return true;
}();

}  // namespace
