// Keeps freed memory in the process.
#pragma once

namespace candela {

// Lets the process keep freed memory, up to 64 MiB at the end of each arena, and maps only blocks of 32 MiB
// and more apart. A renderer takes and gives back films of megabytes for each unit; by glibc's default each
// comes from the system anew, at a page fault for every 4 KiB (docs/decisions/062-freed-memory-stays.md).
// Call it first in main().
void keep_freed_memory();

}  // namespace candela
