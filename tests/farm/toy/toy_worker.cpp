#include "worker/program/run_worker.h"

int main(int argc, char** argv) {
  return candela::worker::run_worker(argc, argv);
}
