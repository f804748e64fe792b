// The wall clock of the processes of a farm, which can be set (clock_shift/).
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>

#include "tests/farm/farm.h"
#include "tests/paths.h"

namespace candela::farm {

class ShiftedClock {
 public:
  // Sets the clock of all processes that are started from now on.
  explicit ShiftedClock(Farm& farm) : file_(farm.folder() / "clock-shift") {
    std::ofstream(file_, std::ios::binary) << std::string(sizeof(std::int64_t), '\0');
    farm.add_environment("LD_PRELOAD", test::program_path("libclock_shift.so"));
    farm.add_environment("CANDELA_CLOCK_SHIFT", file_.string());
  }
  // To so many seconds from the true time.
  void set(std::int64_t seconds) const {
    std::fstream file(file_, std::ios::in | std::ios::out | std::ios::binary);
    file.write(reinterpret_cast<const char*>(&seconds), sizeof seconds);
  }

 private:
  std::filesystem::path file_;
};

}  // namespace candela::farm
