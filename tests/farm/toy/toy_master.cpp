#include "master/program/run_master.h"

int main(int argc, char** argv) {
  return candela::master::run_master(argc, argv);
}
