#include "tests/stress/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <sstream>
#include <stdexcept>

#include "tests/stress/scenes.h"

namespace candela::stress {
namespace {

// Cells of a line of the table of points: those before the counts of rejects, all.
constexpr std::size_t kFirstRejected = 14, kCells = kFirstRejected + film::kRejectCauses + 2;

std::string value_text(double value) {
  return fmt::format("{:.6g}", value);
}

// Beyond `index` in direction `step`: why the run of points within ends, or nothing at the sweep's end.
std::string end_of(const Sweep& sweep, const std::map<double, Verdict>& verdicts, int index, int step) {
  const int next = index + step;
  if (next < 0 || next >= static_cast<int>(sweep.values.size())) return "";
  const double value = sweep.values[static_cast<std::size_t>(next)];
  const auto found = verdicts.find(value);
  if (found == verdicts.end()) return "";
  return fmt::format("{} {}", found->second == Verdict::broken ? "**broken**" : "noise", value_text(value));
}

Verdict verdict_of(const std::string& word) {
  for (const Verdict v : {Verdict::within, Verdict::undecided, Verdict::broken})
    if (word == name(v)) return v;
  throw std::invalid_argument("verdict");
}

double real(const std::string& cell) {
  std::size_t end = 0;
  const double value = std::stod(cell, &end);
  if (end != cell.size()) throw std::invalid_argument(cell);
  return value;
}
std::uint64_t count(const std::string& cell) {
  std::size_t end = 0;
  const std::uint64_t value = std::stoull(cell, &end);
  if (end != cell.size() || cell[0] == '-') throw std::invalid_argument(cell);
  return value;
}

Point point_of(const std::vector<std::string>& cells) {
  Point p;
  p.sweep = cells[0];
  p.integrator = cells[1];
  p.value = real(cells[2]);
  p.verdict = verdict_of(cells[3]);
  p.quantity = cells[4];
  p.measured = real(cells[5]);
  p.expected = real(cells[6]);
  p.deviation = real(cells[7]);
  p.stderr_of_deviation = real(cells[8]);
  p.tolerance = real(cells[9]);
  p.iterations = count(cells[10]);
  p.sample_counts.rays = count(cells[11]);
  p.sample_counts.eye_samples = count(cells[12]);
  p.sample_counts.light_paths = count(cells[13]);
  for (std::size_t c = 0; c < film::kRejectCauses; ++c)
    p.sample_counts.rejected[c] = count(cells[kFirstRejected + c]);
  p.seconds = real(cells[kFirstRejected + film::kRejectCauses]);
  p.refusal = cells[kFirstRejected + film::kRejectCauses + 1];
  return p;
}

}  // namespace

std::string csv(const std::vector<Point>& points) {
  std::string text =
      "sweep,integrator,value,verdict,quantity,measured,expected,deviation,stderr,tolerance,iterations,rays,"
      "eye_samples,light_paths,";
  for (int c = 0; c < film::kRejectCauses; ++c)
    text += fmt::format("rejected_{},", name(static_cast<film::RejectCause>(c)));
  text += "cpu_seconds,refusal\n";
  for (const Point& p : points) {
    std::string refusal = p.refusal;
    for (char& c : refusal)
      if (c == ',' || c == '\n' || c == '"') c = ';';
    text += fmt::format("{},{},{},{},{},{:.9g},{:.9g},{:.4g},{:.4g},{:.4g},{},{},{},{},{},{:.3f},{}\n",
                        p.sweep, p.integrator, p.value, name(p.verdict), p.quantity, p.measured, p.expected,
                        p.deviation, p.stderr_of_deviation, p.tolerance, p.iterations, p.sample_counts.rays,
                        p.sample_counts.eye_samples, p.sample_counts.light_paths,
                        fmt::join(p.sample_counts.rejected, ","), p.seconds, refusal);
  }
  return text;
}

std::vector<Point> read_csv(const std::string& text) {
  std::vector<Point> points;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("sweep,")) continue;
    std::vector<std::string> cells;
    std::istringstream row(line + ",");
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    if (cells.size() != kCells) throw std::runtime_error("not a line of a table of points: " + line);
    try {
      points.push_back(point_of(cells));
    } catch (const std::logic_error&) {  // of a number that is none, or too large
      throw std::runtime_error("not a line of a table of points: " + line);
    }
  }
  return points;
}

std::string limits_text(const std::vector<Sweep>& sweeps, const std::vector<Point>& points,
                        double most_seconds) {
  std::string text;
  for (const Sweep& sweep : sweeps) {
    for (const Claim& claim : sweep.claims) {
      text += fmt::format("{} {}", sweep.name, claim.integrator);
      for (const double value : sweep.thin)
        for (const Point& p : points)
          if (p.sweep == sweep.name && p.integrator == claim.integrator && p.value == value &&
              p.verdict == Verdict::within && p.rejected() == 0 && p.seconds <= most_seconds)
            text += fmt::format(" {}", value);
      text.append("\n");
    }
  }
  return text;
}

std::vector<Limit> read_limits(const std::string& text) {
  std::vector<Limit> limits;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    Limit limit;
    words >> limit.sweep >> limit.integrator;
    for (std::string word; words >> word;) limit.values.push_back(std::stod(word));
    limits.push_back(limit);
  }
  return limits;
}

std::string reach(const Sweep& sweep, const std::vector<Point>& points) {
  std::map<double, Verdict> verdicts;
  for (const Point& p : points) verdicts[p.value] = p.verdict;
  const auto within = [&](int i) {
    const auto found = verdicts.find(sweep.values[static_cast<std::size_t>(i)]);
    return found != verdicts.end() && found->second == Verdict::within;
  };
  const int size = static_cast<int>(sweep.values.size());
  const int benign = static_cast<int>(std::find(sweep.values.begin(), sweep.values.end(), sweep.benign) -
                                      sweep.values.begin());
  // If the benign end itself is not within, begins at the nearest value that is.
  int from = -1;
  for (int i = 0; i < size; ++i)
    if (within(i) && (from < 0 || std::abs(i - benign) < std::abs(from - benign))) from = i;
  if (from < 0) {
    const bool broken = std::any_of(points.begin(), points.end(),
                                    [](const Point& p) { return p.verdict == Verdict::broken; });
    return broken ? "none: **broken**" : "none: noise";
  }
  int low = from, high = from;
  while (low > 0 && within(low - 1)) --low;
  while (high + 1 < size && within(high + 1)) ++high;
  if (low == 0 && high == size - 1) return "all";
  const std::string before = end_of(sweep, verdicts, low, -1), after = end_of(sweep, verdicts, high, 1);
  std::string text = low == high ? value_text(sweep.values[static_cast<std::size_t>(low)])
                                 : value_text(sweep.values[static_cast<std::size_t>(low)]) + " to " +
                                       value_text(sweep.values[static_cast<std::size_t>(high)]);
  for (const std::string& end : {before, after})
    if (!end.empty()) text += "; " + end;
  return text;
}

std::string markdown(const std::vector<Sweep>& sweeps, const std::vector<Point>& points) {
  std::string text = "| sweep | values |";
  for (const auto& integrator : kEveryone) text += fmt::format(" `{}` |", integrator);
  text += "\n|---|---|";
  for (std::size_t i = 0; i < kEveryone.size(); ++i) text += "---|";
  text += "\n";
  for (const Sweep& sweep : sweeps) {
    std::string row = fmt::format("| `{}` | {} … {} |", sweep.name, value_text(sweep.values.front()),
                                  value_text(sweep.values.back()));
    bool any = false;
    for (const auto& integrator : kEveryone) {
      std::vector<Point> own;
      for (const Point& p : points)
        if (p.sweep == sweep.name && p.integrator == integrator) own.push_back(p);
      any |= !own.empty();
      row += fmt::format(" {} |", own.empty() ? "-" : reach(sweep, own));
    }
    if (any) text.append(row).append("\n");
  }
  text += "\nSamples rejected, of all points above (those without any are left out):\n\n";
  text += "| sweep | integrator | value | nan | infinite | negative | saturated | statistics | rays |\n";
  text += "|---|---|---|---|---|---|---|---|---|\n";
  std::uint64_t rejected = 0, samples = 0;
  for (const Point& p : points) {
    const std::uint64_t of = p.sample_counts.rays;
    samples += of;
    rejected += p.rejected();
    if (p.rejected() == 0) continue;
    text += fmt::format("| `{}` | `{}` | {} | {} | {} |\n", p.sweep, p.integrator, value_text(p.value),
                        fmt::join(p.sample_counts.rejected, " | "), of);
  }
  text += fmt::format("\n{} points, {} rays, {} samples rejected.\n", points.size(), samples, rejected);
  return text;
}

}  // namespace candela::stress
