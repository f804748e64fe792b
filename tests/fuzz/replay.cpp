// Gives each fuzz target its seeds once: fuzz_seeds FOLDER, with one folder of seeds for each target. A
// target that breaks a promise aborts; a seed takes at most five seconds.
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#define TARGET(name) extern "C" int name(const std::uint8_t* data, std::size_t size);
#include "targets.inc"
#undef TARGET

namespace {

struct Target {
  std::string name;
  int (*run)(const std::uint8_t* data, std::size_t size);
};

const std::vector<Target> kTargets = {
#define TARGET(name) {#name, &(name)},
#include "targets.inc"
#undef TARGET
};

constexpr unsigned kSeconds = 5;

}  // namespace

int main(int argc, char** argv) {
  namespace fs = std::filesystem;
  if (argc != 2) {
    std::fprintf(stderr, "usage: fuzz_seeds FOLDER\n");
    return 2;
  }
  for (const Target& target : kTargets) {
    const fs::path folder = fs::path(argv[1]) / target.name.substr(std::string("fuzz_").size());
    std::vector<fs::path> seeds;
    for (const auto& entry : fs::directory_iterator(folder)) seeds.push_back(entry.path());
    std::sort(seeds.begin(), seeds.end());
    std::printf("%s: %zu seeds\n", target.name.c_str(), seeds.size());
    if (seeds.empty()) return 1;
    for (const fs::path& seed : seeds) {
      std::ifstream file(seed, std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(file), {}};
      std::printf("  %s, %zu bytes\n", seed.filename().c_str(), bytes.size());
      std::fflush(stdout);  // the last line names the seed that ended the program
      ::alarm(kSeconds);
      target.run(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    }
  }
  ::alarm(0);
  return 0;
}
