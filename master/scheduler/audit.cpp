#include "master/scheduler/audit.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>

#include "common/base/hash.h"

namespace candela::master {

std::string identity(const WorkerRow& worker) {
  std::string out = worker.host + "/" + worker.name;
  std::replace(out.begin(), out.end(), '\n', ' ');  // lists of identities have one a line
  return out;
}

std::string_view host_of(std::string_view identity) {
  return identity.substr(0, identity.find('/'));
}

bool is_audited(std::uint64_t secret, const std::string& job_id, const Unit& unit, double share) {
  if (!(share > 0)) return false;
  const std::string hash = sha256_hex(
      fmt::format("{} {} {} {} {}", secret, job_id, static_cast<int>(unit.kind), unit.half, unit.begin));
  constexpr std::size_t kDigits = 13;  // 52 bits, which a double holds
  std::uint64_t value = 0;
  std::from_chars(hash.data(), hash.data() + kDigits, value, 16);
  return static_cast<double>(value) < share * static_cast<double>(1ULL << (4 * kDigits));
}

std::string pilot_sha256(const PilotResult& result) {
  const WorkPlan& work = result.work;
  std::string text = fmt::format("scale {} b {}\n", result.state.film_scale_log2, result.state.bootstrap_b);
  if (!result.state.decided.empty()) text += fmt::format("decided {}\n", sha256_hex(result.state.decided));
  const auto add_map = [&](const SettingsMap& map) {
    for (const auto& [name, value] : map)
      text += fmt::format("{}:{} {}:{}\n", name.size(), name, value.size(), value);
  };
  for (const std::string& layer : work.layers) text += fmt::format("layer {}\n", layer);
  for (const film::AccumulatorSpec& spec : work.accumulators) {
    text += fmt::format("sums {} {} {} {}\n", spec.name, spec.channels, spec.scale_log2,
                        static_cast<int>(spec.per));
    if (spec.domain == film::AccumulatorSpec::Domain::film) continue;
    text +=
        fmt::format("domain {} {} {}\n", static_cast<int>(spec.domain), spec.entries, spec.key_names.size());
    for (const std::string& name : spec.key_names) text += fmt::format("{}:{}\n", name.size(), name);
  }
  if (work.chains)
    text += fmt::format("chains {} {} {}\n", work.chains->chains, work.chains->bootstrap_samples,
                        work.chains->segment_mutations);
  if (work.epochs) {
    text += fmt::format("epochs {} {} {} {}\n", work.epochs->first, work.epochs->growth, work.epochs->lag,
                        work.epochs->rule);
    add_map(work.epochs->constants);
  }
  if (work.development) {
    text += fmt::format("development {}\n", work.development->name);
    add_map(work.development->constants);
  }
  return sha256_hex(text);
}

const AuditAnswer* Audit::of(std::string_view worker) const {
  const auto found =
      std::find_if(answers.begin(), answers.end(), [&](const AuditAnswer& a) { return a.worker == worker; });
  return found == answers.end() ? nullptr : &*found;
}

std::string Audit::key(const AuditAnswer& answer) const {
  if (!answer.content.empty()) return answer.content;
  for (const AuditAnswer& other : answers)
    if (!other.content.empty() && other.sha256 == answer.sha256) return other.content;
  return "bytes " + answer.sha256;
}

std::string Audit::merged_key() const {
  return key({"", merged_sha256, ""});
}

bool Audit::disputed() const {
  std::set<std::string> keys;
  if (recheck && !answers.empty()) keys.insert(merged_key());
  for (const AuditAnswer& answer : answers) keys.insert(key(answer));
  return keys.size() > 1;
}

std::vector<std::string> Audit::workers_with(const std::string& wanted) const {
  std::vector<std::string> out;
  for (const AuditAnswer& answer : answers)
    if (key(answer) == wanted) out.push_back(answer.worker);
  return out;
}

std::string Audit::majority(const std::set<std::string>& able) const {
  std::set<std::string> all = able;
  std::map<std::string, std::size_t> votes;
  for (const AuditAnswer& answer : answers) {
    all.insert(answer.worker);
    ++votes[key(answer)];
  }
  const std::size_t needed = std::min(all.size(), kMaxJury) / 2 + 1;
  for (const auto& [key, count] : votes)
    if (count >= needed) return key;
  return {};
}

}  // namespace candela::master
