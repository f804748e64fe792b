#include "tests/farm/checked_master.h"

int main(int argc, char** argv) {
  return candela::farm::run_checked_master(argc, argv);
}
