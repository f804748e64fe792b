// The program candela-worker: one worker process, from its command line to its exit code.
#pragma once

namespace candela::worker {

// To be called from main() alone: blocks signals in the calling thread.
int run_worker(int argc, char** argv);

}  // namespace candela::worker
