#include "tests/proofs/proofs.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "common/base/hash.h"
#include "tests/paths.h"
#include "tests/proofs/judge.h"
#include "tests/proofs/table.h"

namespace candela::proofs {
namespace {

using Digests = std::set<std::string>;  // a set, since batches may come in any order

// Scenes that one test rendered, and their films.
struct Record {
  std::set<std::string> rendered;        // scenes with their settings
  Digests facts;                         // outside of parts
  std::map<std::string, Digests> parts;  // by name
  bool passed = false, skipped = false;
  double seconds = 0;
};

struct State {
  std::set<std::string, std::less<>> opted_in;  // suites, and tests as Suite.Test
  bool probing = false;
  bool recording = false;
  std::set<std::string, std::less<>> proved_parts;  // names of their lines
  std::mutex mutex;
  Record now;
  std::string part;  // that is open; empty: none
};
// Harness functions are free functions that any test calls; one process runs one test at a time.
State& state() {
  static State one;
  return one;
}

std::string name_of(const testing::TestInfo& test) {
  return fmt::format("{}.{}", test.test_suite_name(), test.name());
}

// The name of a part's line. GoogleTest's names have no such sign.
std::string name_of(std::string_view test, std::string_view part) {
  return fmt::format("{}#{}", test, part);
}
std::string test_of(std::string_view line) {
  return std::string(line.substr(0, line.find('#')));
}

bool films_decide(const testing::TestInfo& test) {
  std::string_view suite = test.test_suite_name(), name = test.name();
  if (const auto slash = suite.rfind('/'); slash != suite.npos) suite.remove_prefix(slash + 1);
  name = name.substr(0, name.find('/'));
  return state().opted_in.contains(suite) || state().opted_in.contains(fmt::format("{}.{}", suite, name));
}

template <class Number>
std::string_view bytes_of(std::span<const Number> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

std::string digest(const Digests& facts) {
  if (facts.empty()) return "-";
  Sha256 hash;
  for (const std::string& fact : facts) hash.update(fact + "\n");
  return hash.finish_hex().substr(0, 16);
}

// The digest of a test, or those of its parts if it has some; by the names of the lines.
std::map<std::string, std::string> digests_of(const std::string& test, const Record& record) {
  if (record.parts.empty()) return {{test, digest(record.facts)}};
  std::map<std::string, std::string> digests;
  for (const auto& [part, facts] : record.parts) {
    Digests all = record.facts;
    all.insert(facts.begin(), facts.end());
    digests[name_of(test, part)] = digest(all);
  }
  return digests;
}

// Keeps a record of every test that films decide.
class Recorder final : public testing::EmptyTestEventListener {
 public:
  explicit Recorder(std::map<std::string, Record>& records) : records_(records) {}
  void OnTestStart(const testing::TestInfo&) override {
    state().now = {};
    begin_ = std::chrono::steady_clock::now();
  }
  void OnTestEnd(const testing::TestInfo& test) override {
    if (!films_decide(test)) return;
    Record record = std::move(state().now);
    record.passed = test.result()->Passed();
    record.skipped = test.result()->Skipped();
    record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    records_[name_of(test)] = std::move(record);
  }

 private:
  std::map<std::string, Record>& records_;
  std::chrono::steady_clock::time_point begin_;
};

struct Probe {
  std::map<std::string, std::string> films;  // digests by the names of the lines
  std::string judge;
  std::set<std::string> rendered;
  double seconds = 0;
};

std::string judge_of(const std::map<std::string, std::string>& files, const std::string& test) {
  const auto found = files.find(test);
  return found == files.end() ? std::string() : judge_digest(found->second);
}

std::map<std::string, std::string> files_of_tests() {
  std::map<std::string, std::string> files;
  const auto& unit = *testing::UnitTest::GetInstance();
  for (int s = 0; s < unit.total_test_suite_count(); ++s) {
    const auto& suite = *unit.GetTestSuite(s);
    for (int t = 0; t < suite.total_test_count(); ++t) {
      const auto& test = *suite.GetTestInfo(t);
      if (films_decide(test)) files[name_of(test)] = test.file();
    }
  }
  return files;
}

// Runs in the child: writes a record a line, renders in lines of their own, to `out`.
[[noreturn]] void probe_here(int out) {
  state().probing = true;
  for (const int fd : {STDOUT_FILENO, STDERR_FILENO})
    if (std::freopen("/dev/null", "w", fd == STDOUT_FILENO ? stdout : stderr) == nullptr) _exit(1);
  std::map<std::string, Record> records;
  auto& listeners = testing::UnitTest::GetInstance()->listeners();
  delete listeners.Release(listeners.default_result_printer());
  listeners.Append(new Recorder(records));
  testing::GTEST_FLAG(output) = "";
  testing::GTEST_FLAG(break_on_failure) = false;
  // Tests that films do not decide would run in vain.
  std::string others;
  const auto& unit = *testing::UnitTest::GetInstance();
  for (int s = 0; s < unit.total_test_suite_count(); ++s)
    for (int t = 0; t < unit.GetTestSuite(s)->total_test_count(); ++t)
      if (const auto& test = *unit.GetTestSuite(s)->GetTestInfo(t); !films_decide(test))
        others += ":" + name_of(test);
  std::string filter = testing::GTEST_FLAG(filter);
  if (!others.empty()) filter += (filter.find('-') == filter.npos ? "-" : ":") + others.substr(1);
  testing::GTEST_FLAG(filter) = filter;
  if (RUN_ALL_TESTS() != 0) {
  }  // what fails here says nothing
  std::string text;
  for (const auto& [test, record] : records) {
    if (record.skipped) continue;
    text += fmt::format("test\t{}\t{}\n", test, record.seconds);
    for (const auto& [line, films] : digests_of(test, record))
      text += fmt::format("line\t{}\t{}\n", line, films);
    for (const std::string& what : record.rendered) text += fmt::format("film\t{}\n", what);
  }
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t n = write(out, text.data() + done, text.size() - done);
    if (n <= 0) _exit(1);
    done += static_cast<std::size_t>(n);
  }
  _exit(0);
}

// By test. A probe that dies gives nothing: all tests then run in full.
std::map<std::string, Probe> probe(const std::map<std::string, std::string>& files) {
  int ends[2];
  if (pipe(ends) != 0) return {};
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) return {};
  if (child == 0) {
    close(ends[0]);
    probe_here(ends[1]);
  }
  close(ends[1]);
  std::string text;
  char buffer[1 << 16];
  for (ssize_t n; (n = read(ends[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  std::map<std::string, Probe> probes;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    std::printf("proofs: the probe ended with status %d; all tests run in full\n", status);
    return {};
  }
  Probe* last = nullptr;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string kind, what, value;
    std::getline(words, kind, '\t');
    std::getline(words, what, '\t');
    std::getline(words, value, '\t');
    if (kind == "test") {
      last = &probes[what];
      *last = {{}, judge_of(files, what), {}, std::atof(value.c_str())};
    } else if (last != nullptr && kind == "line") {
      last->films[what] = value;
    } else if (last != nullptr) {
      last->rendered.insert(what);
    }
  }
  return probes;
}

// Why a test or a part has to run; empty: its line is good.
std::string reason_to_run(const Table& table, const std::string& name, const std::string& judge,
                          const std::string& films) {
  if (films == "-") return "its probe renders nothing";
  const Line* line = table.find(name);
  if (line == nullptr) return "not in the table";
  if (judge != line->judge) return fmt::format("its source is not that of {}", line->commit);
  if (films == line->films) return {};
  if (table.build != this_build())
    return fmt::format("films differ from those proved at {} by another build ({}; this is {})", line->commit,
                       table.build, this_build());
  return fmt::format("films differ from those proved at {}", line->commit);
}

// Leaves tests out of those that GoogleTest runs. `names` begin with a colon each.
void leave_out(const std::string& names) {
  if (names.empty()) return;
  const std::string filter = testing::GTEST_FLAG(filter);
  testing::GTEST_FLAG(filter) = filter + (filter.find('-') == filter.npos ? "-" : ":") + names.substr(1);
}

// Says of each test whether it is proved, and leaves those out. Of one of which a part is not, that part
// runs.
void leave_out_proved(const Table& table, const std::map<std::string, Probe>& probes) {
  std::string proved;
  for (const auto& [test, found] : probes) {
    std::map<std::string, std::string> reasons;  // of what runs
    std::string commits;
    for (const auto& [name, films] : found.films) {
      const std::string why = reason_to_run(table, name, found.judge, films);
      if (!why.empty()) {
        reasons[name] = why;
        continue;
      }
      const std::string& commit = table.find(name)->commit;
      if (commits.find(commit) == commits.npos) commits += (commits.empty() ? "" : ", ") + commit;
      if (name != test) state().proved_parts.insert(name);
    }
    if (reasons.empty()) {
      std::printf("[  PROVED  ] %s at %s: the same films (probe: %.2f s)\n", test.c_str(), commits.c_str(),
                  found.seconds);
      proved += ":" + test;
    }
    for (const auto& [name, why] : reasons)
      std::printf("[ IN FULL  ] %s: %s; tests/nightly/prove writes its line\n", name.c_str(), why.c_str());
  }
  std::fflush(stdout);
  leave_out(proved);
}

// Why a test that ran in full may not have lines; empty: it may.
std::string reason_for_no_line(const Record& full, const Probe* probe, const Probe* again) {
  if (!full.passed) return "it failed";
  if (probe == nullptr || std::all_of(probe->films.begin(), probe->films.end(),
                                      [](const auto& line) { return line.second == "-"; }))
    return "the probe rendered nothing";
  if (again == nullptr || again->films != probe->films) return "a second probe rendered other films";
  for (const std::string& what : full.rendered)
    if (!probe->rendered.contains(what)) return "the probe did not render " + what;
  return {};
}

// Runs in full what is not proved, or all, and appends the lines of those that passed and may have one.
int record(const Table& table, bool all, const std::string& path, const char* commit) {
  const auto probes = probe(files_of_tests());
  if (!all) leave_out_proved(table, probes);
  const auto again = probe(files_of_tests());  // of those that are left
  state().recording = true;
  std::map<std::string, Record> records;
  testing::UnitTest::GetInstance()->listeners().Append(new Recorder(records));
  const int result = RUN_ALL_TESTS();
  std::ofstream out(path, std::ios::app);
  out << "# build: " << this_build() << '\n';
  for (const auto& [test, full] : records) {
    if (full.skipped) continue;
    const auto found = probes.find(test);
    const Probe* probe = found == probes.end() ? nullptr : &found->second;
    const auto second = again.find(test);
    const std::string why =
        reason_for_no_line(full, probe, second == again.end() ? nullptr : &second->second);
    std::printf("proofs: %s: %.2f s in full, %.2f s as a probe%s%s\n", test.c_str(), full.seconds,
                probe == nullptr ? 0 : probe->seconds, why.empty() ? "" : "; no line: ", why.c_str());
    if (!why.empty()) continue;
    for (const auto& [name, films] : probe->films)
      if (!state().proved_parts.contains(name)) out << line_text({name, films, probe->judge, commit}) << '\n';
  }
  out.flush();
  if (!out) {
    std::fprintf(stderr, "error: %s: cannot be written\n", path.c_str());
    return 1;
  }
  return result;
}

int check(const Table& table) {
  const auto files = files_of_tests();
  // A program without a line need not be probed.
  if (std::any_of(table.lines.begin(), table.lines.end(),
                  [&](const Line& line) { return files.contains(test_of(line.test)); }))
    leave_out_proved(table, probe(files));
  else if (!files.empty())
    std::printf("[ IN FULL  ] no test of this program is in the table; tests/nightly/prove writes lines\n");
  std::fflush(stdout);
  return RUN_ALL_TESTS();
}

// The value of NAME=VALUE at the front of a word of the environment.
std::string after(const std::string& text, std::string_view name) {
  return text.starts_with(name) ? text.substr(name.size()) : std::string();
}

}  // namespace

FilmsDecide::FilmsDecide(std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) state().opted_in.emplace(name);
}

bool probing() {
  return state().probing;
}

namespace {

// Adds to the part that is open, or to the test.
void add(const std::string& fact) {
  State& s = state();
  (s.part.empty() ? s.now.facts : s.now.parts[s.part]).insert(fact);
}

}  // namespace

void film(const std::string& what, std::span<const std::int64_t> integers) {
  State& s = state();
  if (!s.probing && !s.recording) return;
  const std::string key = sha256_hex(what).substr(0, 12) + " " + what.substr(0, what.find('\n'));
  std::string part;
  if (s.probing) part = "film " + sha256_hex(what) + " " + sha256_hex(bytes_of(integers));
  const std::lock_guard lock(s.mutex);
  s.now.rendered.insert(key);
  if (!part.empty()) add(part);
}

void fact(std::string_view name, std::string_view value) {
  State& s = state();
  if (!s.probing) return;
  const std::string part = fmt::format("fact {} {}", name, sha256_hex(value));
  const std::lock_guard lock(s.mutex);
  add(part);
}
void fact(std::string_view name, std::span<const float> values) {
  fact(name, bytes_of(values));
}
void fact(std::string_view name, std::span<const double> values) {
  fact(name, bytes_of(values));
}

Part::Part(std::string_view name) {
  State& s = state();
  const std::lock_guard lock(s.mutex);
  if (!s.part.empty())
    throw std::logic_error(fmt::format("part {} begins before part {} ends", name, s.part));
  s.part = name;
  if (s.probing && !s.now.parts.try_emplace(s.part).second)
    throw std::logic_error(fmt::format("two parts are called {}", name));
  const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
  proved_ = !s.probing && test != nullptr && s.proved_parts.contains(name_of(name_of(*test), name));
}
Part::~Part() {
  const std::lock_guard lock(state().mutex);
  state().part.clear();
}

std::string in_this_test(std::string_view key) {
  const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
  return fmt::format("{} {}", test != nullptr ? name_of(*test) : "", key);
}

Ends probe_ends(std::uint64_t iterations, std::size_t batches) {
  constexpr std::size_t kShare = 16;
  const std::uint64_t parts = std::max<std::uint64_t>(1, kShare / std::max<std::size_t>(1, batches));
  const std::uint64_t wanted = std::max<std::uint64_t>(1, iterations / parts);
  if (wanted >= iterations) return {iterations, 0};
  return {wanted - wanted / 2, wanted / 2};
}

int run_tests() {
  const auto variable = [](const char* name) {
    const char* text = std::getenv(name);
    return std::string(text == nullptr ? "" : text);
  };
  const std::string how = variable("CANDELA_PROOFS"), is_long = variable("CANDELA_LONG"),
                    commit = variable("CANDELA_COMMIT");
  if (how == "off" || (!is_long.empty() && is_long != "0") || testing::GTEST_FLAG(list_tests))
    return RUN_ALL_TESTS();
  const std::string out = after(how, "record="), all = after(how, "record-all="),
                    other = after(how, "table=");
  if (!how.empty() && other.empty() && (commit.empty() || (out.empty() && all.empty()))) {
    std::fprintf(
        stderr,
        "error: CANDELA_PROOFS is '%s': not off, table=FILE, record=FILE or record-all=FILE, the last two "
        "with CANDELA_COMMIT\n",
        how.c_str());
    return 2;
  }
  const std::string known = other.empty() ? variable("CANDELA_PROOFS_KNOWN") : other;
  const std::string path = known.empty() ? test::source_path("tests/proofs/proved.txt").string() : known;
  const auto table = read_table(path);
  if (!table.ok()) {
    std::fprintf(stderr, "error: %s\n", table.error().to_string().c_str());
    return 2;
  }
  if (!out.empty() || !all.empty()) return record(*table, !all.empty(), out + all, commit.c_str());
  return check(*table);
}

}  // namespace candela::proofs
