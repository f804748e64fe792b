#include "common/base/memory.h"
#include "worker/program/run_worker.h"

int main(int argc, char** argv) {
  candela::keep_freed_memory();
  return candela::worker::run_worker(argc, argv);
}
