// The scene readers on any bytes, read as XML of Mitsuba. scene_input.h says how files lie in one input.
#include "scene_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  candela::fuzz::read_both_ways(candela::fuzz::files_of(data, size, "scene.xml"), "scene.xml");
  return 0;
}
