#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "client/doctor/checks.h"
#include "client/values.h"
#include "common/base/version.h"

namespace candela::client {
namespace {

constexpr double kClockWarning = 5, kClockBroken = 300;  // seconds

double unix_seconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Diagnosis broken(const char* name, const Error& error) {
  Diagnosis check{name, Diagnosis::State::broken, error.to_string(), error.mend};
  if (!error.mend.empty()) {
    Error plain = error;
    plain.mend.clear();
    check.text = plain.to_string();
  }
  check.text = printable(check.text);
  check.mend = printable(check.mend);
  return check;
}

Diagnosis check_workers(FarmClient& farm) {
  const auto answer = farm.list_workers();
  if (!answer) return broken("workers", answer.error());
  unsigned fit = 0, threads = 0;
  std::string trouble;
  for (const v1::WorkerStatus& w : answer->workers()) {
    if (w.state() == "idle" || w.state() == "busy") {
      ++fit;
      threads += w.threads();
    } else if (w.state() == "set-aside" || w.state() == "lost" || w.state() == "stuck") {
      trouble += fmt::format("; {} is {}{}{}", printable(w.name()), printable(w.state()),
                             w.message().empty() ? "" : ": ", printable(w.message()));
    }
  }
  Diagnosis check{
      "workers", Diagnosis::State::ok, fmt::format("{} at work, {} threads{}", fit, threads, trouble), {}};
  if (fit == 0) {
    check.state = Diagnosis::State::warning;
    check.mend = "start one: candela-worker --master HOST:PORT";
  } else if (!trouble.empty()) {
    check.state = Diagnosis::State::warning;
    check.mend = "see candela workers and candela events";
  }
  return check;
}

}  // namespace

Diagnosis check_clock(double ahead_seconds, double uncertain_seconds) {
  const double off = std::max(0.0, std::abs(ahead_seconds) - uncertain_seconds);
  Diagnosis check{"clock",
                  Diagnosis::State::ok,
                  fmt::format("the master's is {:.3f} s {} ours (+- {:.3f} s)", std::abs(ahead_seconds),
                              ahead_seconds < 0 ? "behind" : "ahead of", uncertain_seconds),
                  {}};
  if (off <= kClockWarning) return check;
  check.state = off > kClockBroken ? Diagnosis::State::broken : Diagnosis::State::warning;
  check.mend =
      "synchronize the clocks of both machines (chrony, systemd-timesyncd): certificates and logs go by them";
  return check;
}

std::vector<Diagnosis> check_farm(const ConnectionOptions& connection) {
  auto farm = FarmClient::create(connection);
  if (!farm) return {broken("master", farm.error())};
  // The first call connects; the second measures.
  if (const auto first = (*farm)->check_server(); !first) return {broken("master", first.error())};
  const double begin = unix_seconds();
  const auto info = (*farm)->check_server();
  const double end = unix_seconds();
  if (!info) return {broken("master", info.error())};

  std::vector<Diagnosis> checks;
  Diagnosis master{"master",
                   Diagnosis::State::ok,
                   fmt::format("{}: candela {}, build {}, answers in {:.1f} ms", printable(connection.master),
                               printable(info->version()), printable(info->build_id()), 1000 * (end - begin)),
                   {}};
  if (info->build_id() != build_id()) {
    master.state = Diagnosis::State::warning;
    master.text += "; ours is another build";
    master.mend =
        "workers of our build cannot join this farm, and images rendered here may differ from its: "
        "install one build on all machines";
  }
  checks.push_back(std::move(master));
  if (info->unix_ms() > 0)
    checks.push_back(check_clock(static_cast<double>(info->unix_ms()) / 1000 - (begin + end) / 2,
                                 (end - begin) / 2 + 0.001));
  checks.push_back(check_workers(**farm));
  return checks;
}

}  // namespace candela::client
