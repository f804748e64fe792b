// Report of a run of sweeps, as CSV for programs and as the tables of docs/numerics.md.
#pragma once

#include <string>
#include <vector>

#include "tests/stress/run.h"

namespace candela::stress {

std::string csv(const std::vector<Point>& points);
// Reads what csv() wrote, several outputs one after the other. Throws on anything else.
std::vector<Point> read_csv(const std::string& text);

// Values of the short form at which an integrator must stay within and reject nothing.
struct Limit {
  std::string sweep, integrator;
  std::vector<double> values;  // empty: none that is decided in the time
};
// The values of the short form that were within for each sweep and integrator, without a rejection, in at
// most so many CPU seconds; as text, a line each, and back.
std::string limits_text(const std::vector<Sweep>& sweeps, const std::vector<Point>& points,
                        double most_seconds);
std::vector<Limit> read_limits(const std::string& text);

// Range of each sweep within which each integrator stays, and what was rejected on the way.
std::string markdown(const std::vector<Sweep>& sweeps, const std::vector<Point>& points);

// One cell of the first table: the values around the benign end at which all points are within, and why they
// end there. `points` of one sweep and integrator.
std::string reach(const Sweep& sweep, const std::vector<Point>& points);

}  // namespace candela::stress
