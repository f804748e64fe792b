#include <gmock/gmock.h>

#include "tests/proofs/proofs.h"

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  return candela::proofs::run_tests();
}
