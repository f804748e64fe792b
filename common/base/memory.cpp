#include "common/base/memory.h"

#include <malloc.h>

namespace candela {

void keep_freed_memory() {
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the largest that glibc takes
  ::mallopt(M_TRIM_THRESHOLD, 64 << 20);
}

}  // namespace candela
