// A sweep makes one hazard of light transport worse step by step, and says what must hold at every step: a
// known value of parts of the image, or the same image as at the sweep's benign end. Which integrators are
// run through it is part of the sweep; how far each must get in the tests is in limits.txt.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/job/job.h"

namespace candela::stress {

// The mean over a rectangle of the film and over the three channels.
struct Quantity {
  std::string name;
  std::uint32_t x = 0, y = 0, width = 0, height = 0;  // pixels
  // Absent: the value at the sweep's benign end, batch by batch with the same seeds.
  std::optional<double> expected;
  double share = 1;  // of the sweep's tolerance: parts of the image may have more
};

// A render for one value of the parameter.
struct Shot {
  std::string body;                          // of the scene element
  std::map<std::string, std::string> files;  // that it refers to: name -> bytes
  std::uint32_t width = 16, height = 16;
  SettingsMap settings;                // each integrator takes those that it has
  std::uint64_t first = 0;             // iteration index within a half
  std::vector<Quantity> quantities{};  // empty: the whole image and its quarters, as at the benign end
};

struct Claim {
  std::string integrator;
  SettingsMap settings{};        // beside those of the shot
  std::uint64_t iterations = 0;  // of a batch in the first stage; 0: the sweep's
};

struct Excuse {
  std::string integrator, why;  // the sweep is not run through it
};

struct Sweep {
  std::string name;
  std::string hazard;     // in the words of the list in docs/numerics.md
  std::string parameter;  // what is swept, with its unit
  std::string holds;      // what must hold
  std::vector<double> values;
  double benign = 0;         // one of the values: from here on "how far" is counted, both ways
  std::vector<double> thin;  // of the values, those of the short form
  double tolerance = 0.02;   // relative
  double floor = 0;          // absolute, added to it
  std::uint64_t iterations = 8;
  std::function<Shot(double)> shot;
  std::vector<Claim> claims;
  std::vector<Excuse> excuses;
};

// Every sweep there is, in the order of the report.
std::vector<Sweep> all_sweeps();
// Throws for an unknown name.
const Sweep& find_sweep(const std::vector<Sweep>& sweeps, const std::string& name);

// The image and, with twice its tolerance, its quarters, all with one expected value.
std::vector<Quantity> uniform_quantities(std::uint32_t width, std::uint32_t height,
                                         std::optional<double> expected);
// Claims of all integrators named, over all values.
std::vector<Claim> claims_of(const std::vector<std::string>& integrators);

}  // namespace candela::stress
