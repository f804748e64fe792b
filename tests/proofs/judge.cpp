#include "tests/proofs/judge.h"

#include <fstream>
#include <sstream>
#include <stdexcept>

#include "common/base/hash.h"
#include "tests/paths.h"

namespace candela::proofs {
namespace {

constexpr const char* kArithmetic[] = {
    "tests/statistical/batch_means.h",   "tests/statistical/block_tests.cpp",
    "tests/statistical/block_tests.h",   "tests/statistical/extrapolation.h",
    "tests/statistical/image_tests.cpp", "tests/statistical/image_tests.h",
    "tests/statistical/moments.h",       "tests/statistical/quantiles.cpp",
    "tests/statistical/quantiles.h",     "tests/stress/run.cpp",
    "tests/stress/verdict.cpp",          "tests/stress/verdict.h"};

std::string text_of(const std::string& file) {
  std::ifstream in(test::source_path(file));
  if (!in) throw std::runtime_error(file + ": cannot be read; tests/proofs/judge.cpp names it");
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

}  // namespace

std::string judge_digest(const std::string& test_file) {
  Sha256 hash;
  // __FILE__ may be absolute, or relative to the folder of the build.
  const auto below = test_file.rfind("tests/");
  if (below == test_file.npos) throw std::runtime_error(test_file + ": not below tests/");
  hash.update(text_of(test_file.substr(below)));
  for (const char* file : kArithmetic) hash.update(text_of(file));
  return hash.finish_hex().substr(0, 16);
}

}  // namespace candela::proofs
