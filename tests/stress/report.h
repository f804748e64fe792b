// What a run of sweeps says, as CSV for programs and as the tables of docs/numerics.md.
#pragma once

#include <string>
#include <vector>

#include "tests/stress/run.h"

namespace candela::stress {

std::string csv(const std::vector<Point>& points);
// How far along each sweep each integrator stays within, and what was rejected on the way.
std::string markdown(const std::vector<Sweep>& sweeps, const std::vector<Point>& points);

// One cell of the first table: the values around the benign end at which all points are within, and why it
// ends there. `points` of one sweep and integrator.
std::string reach(const Sweep& sweep, const std::vector<Point>& points);

}  // namespace candela::stress
