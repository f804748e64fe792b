#include "tests/farm/farm.h"

#include <fmt/format.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "client/embedded/app.h"
#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/quantity.h"
#include "common/job/job.h"
#include "common/wire/grpc_settings.h"
#include "common/wire/token.h"
#include "common/wire/wire.h"
#include "master/master.h"
#include "tests/expect_invariants.h"
#include "tests/paths.h"
#include "worker/service/worker_service.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void give_up(const std::string& message) {
  throw std::runtime_error(message);
}

std::string program(const std::string& name) {
  return test::program_path(name);
}

std::string joined(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, " "));
}

std::string state_of(const fs::path& file) {
  return fmt::format("{} {} {}\n", file.string(), fs::file_size(file),
                     fs::last_write_time(file).time_since_epoch().count());
}

// Place where tests keep the image that this build of the program makes of the scene with these settings:
// many tests, each a process, compare with the same one. Its name has all that decides it.
fs::path shared_reference(const fs::path& scene, const std::vector<std::string>& settings) {
  std::vector<std::string> parts = {state_of(program("candela")), scene.string(), joined(settings)};
  for (const auto& entry : fs::recursive_directory_iterator(scene.parent_path()))
    if (entry.is_regular_file()) parts.push_back(state_of(entry.path()));
  std::sort(parts.begin(), parts.end());
  return test::program_path("").parent_path().parent_path() / "farm-references" /
         (sha256_hex(joined(parts)) + ".exr");
}

// Seen whole or not at all. Without room the next test renders for itself.
void share(const fs::path& file, const fs::path& shared) {
  std::error_code ignored;
  fs::create_directories(shared.parent_path(), ignored);
  const fs::path copy = fmt::format("{}.{}", shared.string(), ::getpid());
  if (fs::copy_file(file, copy, fs::copy_options::overwrite_existing, ignored))
    fs::rename(copy, shared, ignored);
}

template <class Request, class Response>
Response ask(v1::FarmService::Stub& stub,
             grpc::Status (v1::FarmService::Stub::*call)(grpc::ClientContext*, const Request&, Response*),
             const Request& request) {
  // A master that is being restarted is asked again.
  grpc::Status status;
  Response response;
  const Stopwatch clock;
  do {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(10));
    status = (stub.*call)(&context, request, &response);
  } while (status.error_code() == grpc::StatusCode::UNAVAILABLE && clock.seconds() < 30);
  if (!status.ok())
    give_up(fmt::format("call failed: {} {}", static_cast<int>(status.error_code()), status.error_message()));
  return response;
}

}  // namespace

std::string scene_path(const std::string& name) {
  return test::source_path(name.ends_with(".xml") ? name : "deploy/scenes/" + name + "/scene.xml");
}

std::vector<std::string> job_options(std::uint64_t iterations, std::uint64_t seed) {
  return {"--size",       fmt::format("{}x{}", kWidth, kHeight),
          "--seed",       std::to_string(seed),
          "--iterations", std::to_string(iterations)};
}

Farm::Farm() {
  // Nobody looks at a connection of this process that no call waits for. So a call over the connection to a
  // master that died fails always, not when the test is quicker than a poller.
  ::setenv("GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS", "3600000", 0);
  wire::configure_grpc();
  std::ofstream(folder_ / "config.toml") << "# nothing of the machine's own settings\n";
}

Farm::~Farm() {
  if (testing::Test::HasFailure() && master_)
    std::fprintf(stderr, "---- the master's log, its end\n%s\n",
                 master_->err().substr(std::max<std::size_t>(master_->err().size(), 6000) - 6000).c_str());
  workers_here_.clear();
  stub_.reset();
  master_here_.reset();
  workers_.clear();
  if (master_) master_->kill();
  report_violations();
}

void Farm::start_master_here(const std::vector<std::string>& options) {
  master::MasterOptions o;
  o.data_dir = folder_ / "data";
  o.listen = "127.0.0.1:0";
  o.observer = test::expect_invariants();
  const std::map<std::string, double*> seconds = {{"--unit-time", &o.unit_seconds},
                                                  {"--lease-time", &o.lease_seconds},
                                                  {"--audit", &o.audit_share},
                                                  {"--checkpoint-interval", &o.checkpoint_seconds}};
  for (std::size_t i = 0; i + 1 < options.size(); i += 2) {
    const auto known = seconds.find(options[i]);
    if (known != seconds.end())
      *known->second = std::stod(options[i + 1]);
    else if (options[i] == "--statistics-memory")
      o.statistics_bytes = parse_bytes(options[i + 1]).value();
    else
      give_up("a master of this process has no option " + options[i]);
  }
  if (!log::initialise("test", "off", "text").ok()) give_up("no log");
  auto started = master::Master::start(o);
  if (!started.ok()) give_up(started.error().to_string());
  master_here_ = std::move(*started);
  address_ = fmt::format("127.0.0.1:{}", master_here_->port());
  use_token();
}

void Farm::start_worker_here(const std::string& name, unsigned threads) {
  worker::WorkerOptions options;
  options.cache_dir = folder_ / ("cache-" + name);
  options.threads = threads;
  options.name = name;
  auto started = worker::Worker::start(options, master_here_->in_process_channel());
  if (!started.ok()) give_up(started.error().to_string());
  workers_here_.push_back(std::move(*started));
}

std::vector<std::string> Farm::violations() {
  std::vector<std::string> all;
  std::istringstream log(master_ ? master_->err() : std::string());
  for (std::string line; std::getline(log, line);)
    if (line.starts_with(kViolation)) all.push_back(line);
  violations_.insert(all.begin(), all.end());
  return all;
}

void Farm::report_violations() {
  const std::set<std::string> known = violations_;
  for (const std::string& violation : violations())
    if (!known.contains(violation)) ADD_FAILURE() << violation;
}

std::map<std::string, std::string> Farm::environment() const {
  std::map<std::string, std::string> all = {{"HOME", folder_.path().string()},
                                            {"PATH", "/usr/local/bin:/usr/bin:/bin"},
                                            {"LC_ALL", "C.UTF-8"},
                                            {"CANDELA_CONFIG", (folder_.path() / "config.toml").string()}};
  for (const char* name : {"TMPDIR", "ASAN_OPTIONS", "TSAN_OPTIONS", "UBSAN_OPTIONS"})
    if (const char* value = std::getenv(name)) all[name] = value;
  if (!address_.empty()) all["CANDELA_MASTER"] = address_;
  // The master's own place for it is found by its port alone, which a link before the master does not have.
  if (fs::exists(token_file())) all["CANDELA_TOKEN_FILE"] = token_file();
  all.insert(more_environment_.begin(), more_environment_.end());
  return all;
}

void Farm::start_master(std::vector<std::string> options) {
  master_options_ = std::move(options);
  std::vector<std::string> arguments = {program(master_program_), "--data", (folder_ / "data").string()};
  if (std::find(master_options_.begin(), master_options_.end(), "--listen") == master_options_.end()) {
    arguments.push_back("--listen");
    arguments.push_back(address_.empty() ? "127.0.0.1:0" : address_);
  }
  // Audits render some units twice, which tests of other things do not count on.
  if (std::find(master_options_.begin(), master_options_.end(), "--audit") == master_options_.end())
    arguments.insert(arguments.end(), {"--audit", "0"});
  arguments.insert(arguments.end(), master_options_.begin(), master_options_.end());
  auto environment_of_master = environment();
  environment_of_master.erase("CANDELA_MASTER");
  master_ = std::make_unique<Process>(arguments, folder_ / fmt::format("master-{}", ++serial_),
                                      environment_of_master);
  address_ = master_->wait_for_line("listening on ", 30);
  if (address_.empty())
    give_up(fmt::format("the master does not listen: {}\n{}", joined(arguments), master_->err()));
  use_token();
}

void Farm::kill_master() {
  master_->kill();
  report_violations();
}

void Farm::restart_master() {
  restart_master(master_options_);
}

void Farm::restart_master(std::vector<std::string> options) {
  stub_.reset();
  start_master(std::move(options));
}

Process& Farm::start_worker(const std::string& name, unsigned threads, std::vector<std::string> options) {
  std::vector<std::string> arguments = {program(worker_program_),
                                        "--cache",
                                        (folder_ / ("cache-" + name)).string(),
                                        "--threads",
                                        std::to_string(threads),
                                        "--name",
                                        name};
  arguments.insert(arguments.end(), options.begin(), options.end());  // the environment names the master
  workers_.push_back(std::make_unique<Process>(
      arguments, folder_ / fmt::format("worker-{}-{}", name, ++serial_), environment()));
  return *workers_.back();
}

void Farm::forget_worker(const Process& worker) {
  std::erase_if(workers_, [&](const std::unique_ptr<Process>& one) { return one.get() == &worker; });
}

std::unique_ptr<Process> Farm::start_candela(std::vector<std::string> arguments, const std::string& name) {
  arguments.insert(arguments.begin(), program("candela"));
  return std::make_unique<Process>(arguments, folder_ / fmt::format("{}-{}", name, ++serial_), environment());
}

// For clients and workers of this process.
void Farm::use_token() const {
  if (fs::exists(token_file()))
    ::setenv("CANDELA_TOKEN_FILE", token_file().c_str(), 1);
  else
    ::unsetenv("CANDELA_TOKEN_FILE");
}

CommandResult Farm::candela(std::vector<std::string> arguments) {
  const Stopwatch clock;
  const auto settings = environment();
  for (const char* name : {"CANDELA_CONFIG", "CANDELA_MASTER"})
    if (const auto value = settings.find(name); value != settings.end())
      ::setenv(name, value->second.c_str(), 1);
    else
      ::unsetenv(name);
  use_token();
  arguments.insert(arguments.begin(), "candela");
  std::ostringstream out, err;
  CommandResult result;
  result.exit_code = client::run_program(arguments, out, err);
  result.seconds = clock.seconds();
  result.out = out.str();
  result.err = err.str();
  return result;
}

CommandResult Farm::candela_process(std::vector<std::string> arguments) {
  const Stopwatch clock;
  const auto process = start_candela(std::move(arguments), "candela");
  CommandResult result;
  result.exit_code = process->wait(kPatienceSeconds).value_or(-1);
  result.seconds = clock.seconds();
  result.out = process->out();
  result.err = process->err();
  return result;
}

std::string Farm::submit(std::uint64_t iterations, const std::string& scene, std::vector<std::string> more,
                         std::uint64_t seed) {
  std::vector<std::string> arguments = {"submit", scene_path(scene)};
  for (const auto* words : {&client_options_, &more})
    arguments.insert(arguments.end(), words->begin(), words->end());
  for (const std::string& word : job_options(iterations, seed)) arguments.push_back(word);
  const CommandResult result = candela(arguments);
  if (result.exit_code != 0 || result.out.empty() || result.out.back() != '\n')
    give_up(fmt::format("submit: exit {}\n{}{}", result.exit_code, result.out, result.err));
  const std::string id = result.out.substr(0, result.out.size() - 1);
  if (id.empty() || id.find_first_of(" \n") != std::string::npos)
    give_up("submit prints more than an id: " + result.out);
  return id;
}

image::Image Farm::fetch(const std::string& id) {
  const auto file = folder_ / fmt::format("fetched-{}.exr", ++serial_);
  std::vector<std::string> arguments = {"fetch", id, "-o", file.string()};
  arguments.insert(arguments.end(), client_options_.begin(), client_options_.end());
  const CommandResult result = candela(arguments);
  if (result.exit_code != 0) give_up(fmt::format("fetch: exit {}\n{}", result.exit_code, result.err));
  auto image = image::read_image(file);
  if (!image.ok()) give_up(image.error().to_string());
  return std::move(image).value();
}

image::Image Farm::render(std::uint64_t iterations, const std::string& scene, std::vector<std::string> more) {
  std::vector<std::string> settings = job_options(iterations);
  settings.insert(settings.end(), more.begin(), more.end());
  const fs::path shared = shared_reference(scene_path(scene), settings);
  const bool about_threads = std::find(more.begin(), more.end(), "--threads") != more.end();
  fs::path file = shared;
  if (about_threads || !fs::exists(shared)) {
    file = folder_ / fmt::format("rendered-{}.exr", ++serial_);
    std::vector<std::string> arguments = {"render", scene_path(scene), "-o", file.string(), "--quiet"};
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    const CommandResult result = candela_process(arguments);
    if (result.exit_code != 0) give_up(fmt::format("render: exit {}\n{}", result.exit_code, result.err));
    if (!about_threads) share(file, shared);
  }
  auto image = image::read_image(file);
  if (!image.ok()) give_up(image.error().to_string());
  return std::move(image).value();
}

v1::FarmService::Stub& Farm::stub() {
  if (!stub_) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // a new stub has a new connection
    arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 50);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 100);
    arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 10000);
    stub_ = v1::FarmService::NewStub(
        credentials_
            ? grpc::CreateCustomChannel(address_, credentials_, arguments)
            : wire::token_channel(address_, grpc::InsecureChannelCredentials(), arguments, token_file()));
  }
  return *stub_;
}

v1::JobStatus Farm::job(const std::string& id) {
  v1::GetJobRequest request;
  request.set_job_id(id);
  return ask(stub(), &v1::FarmService::Stub::GetJob, request);
}

v1::JobStatus Farm::wait_for(const std::string& id, v1::JobState state, double seconds) {
  v1::JobStatus status;
  eventually(seconds, [&] {
    status = job(id);
    return status.state() == state || status.state() == v1::JOB_STATE_FAILED;
  });
  if (status.state() != state)
    give_up(fmt::format("the job is {} after {} s, not {}: {} ({} iterations)", wire::name(status.state()),
                        seconds, wire::name(state), status.message(), status.iterations()));
  return status;
}

v1::JobStatus Farm::wait_for_iterations(const std::string& id, std::uint64_t iterations) {
  v1::JobStatus status;
  eventually(kPatienceSeconds, [&] {
    status = job(id);
    return status.iterations() >= iterations || status.state() == v1::JOB_STATE_FAILED;
  });
  if (status.iterations() < iterations)
    give_up(fmt::format("the job has {} iterations, {} were awaited: {}", status.iterations(), iterations,
                        status.message()));
  return status;
}

std::vector<v1::WorkerStatus> Farm::workers() {
  const auto response = ask(stub(), &v1::FarmService::Stub::ListWorkers, v1::ListWorkersRequest());
  return {response.workers().begin(), response.workers().end()};
}

v1::WorkerStatus Farm::worker(const std::string& name) {
  for (auto& one : workers())
    if (one.name() == name) return one;
  return {};
}

std::vector<v1::Event> Farm::events(const std::string& id) {
  v1::ListEventsRequest request;
  request.set_job_id(id);
  request.set_limit(1000);
  const auto response = ask(stub(), &v1::FarmService::Stub::ListEvents, request);
  return {response.events().begin(), response.events().end()};
}

v1::GetLedgerResponse Farm::ledger(const std::string& id) {
  v1::GetLedgerRequest request;
  request.set_job_id(id);
  return ask(stub(), &v1::FarmService::Stub::GetLedger, request);
}

v1::JobStatus Farm::extend(const std::string& id, std::uint64_t iterations) {
  v1::ExtendJobRequest request;
  request.set_job_id(id);
  request.set_add_iterations(iterations);
  job(id);  // finds the master, with patience; the call adds, so it is made once
  v1::JobStatus status;
  grpc::ClientContext context;
  const grpc::Status answer = stub().ExtendJob(&context, request, &status);
  if (!answer.ok()) give_up("ExtendJob: " + answer.error_message());
  return status;
}

v1::JobStatus Farm::repair(const std::string& id) {
  v1::JobRequest request;
  request.set_job_id(id);
  return ask(stub(), &v1::FarmService::Stub::RepairJob, request);
}

void Farm::audit(const std::string& id, std::uint64_t iterations, bool complete) {
  const v1::GetLedgerResponse ledger = this->ledger(id);
  const v1::JobStatus status = job(id);
  const std::uint64_t chains = status.has_chains() ? status.chains().plan().chains() : 0;

  std::array<std::vector<std::pair<std::uint64_t, std::uint64_t>>, 2> rows, film;
  std::vector<std::uint64_t> ids;
  for (const v1::LedgerRow& row : ledger.merged()) {
    if (row.unit().kind() == v1::Unit::KIND_PILOT) continue;
    ASSERT_LT(row.unit().half(), 2U);
    ASSERT_LT(row.unit().begin(), row.unit().end());
    rows[row.unit().half()].emplace_back(row.unit().begin(), row.unit().end());
    ids.push_back(row.unit_id());
  }
  std::sort(ids.begin(), ids.end());
  EXPECT_EQ(std::adjacent_find(ids.begin(), ids.end()), ids.end()) << "a unit is in the ledger twice";
  EXPECT_EQ(status.units_merged(), ids.size());
  for (const v1::IterationRange& range : ledger.film()) {
    ASSERT_LT(range.half(), 2U);
    ASSERT_LT(range.begin(), range.end());
    film[range.half()].emplace_back(range.begin(), range.end());
  }

  std::uint64_t counted = 0;
  for (std::size_t half = 0; half < 2; ++half) {
    // Neighbours joined, overlaps reported.
    const auto join = [&](std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges, const char* what) {
      std::sort(ranges.begin(), ranges.end());
      std::vector<std::pair<std::uint64_t, std::uint64_t>> joined_ranges;
      for (const auto& range : ranges) {
        if (!joined_ranges.empty() && range.first < joined_ranges.back().second)
          ADD_FAILURE() << what << ": overlap at index " << range.first << " of half " << half;
        if (!joined_ranges.empty() && range.first == joined_ranges.back().second)
          joined_ranges.back().second = range.second;
        else
          joined_ranges.push_back(range);
      }
      return joined_ranges;
    };
    const auto from_rows = join(rows[half], "ledger");
    const auto from_film = join(film[half], "film");
    EXPECT_EQ(from_rows, from_film) << "ledger and film differ in half " << half;
    for (const auto& [begin, end] : from_film) counted += end - begin;
    const std::uint64_t wanted = chains > 0  ? iterations * chains / 2
                                 : half == 0 ? (iterations + 1) / 2
                                             : iterations / 2;
    if (complete && wanted > 0) {
      ASSERT_EQ(from_film.size(), 1U) << "gaps in half " << half;
      EXPECT_EQ(from_film[0], (std::pair<std::uint64_t, std::uint64_t>(0, wanted)));
    }
  }
  const std::uint64_t round = std::max<std::uint64_t>(chains, 1);  // indices of an iteration
  if (complete) {
    EXPECT_EQ(counted, iterations * round);
  }
  EXPECT_EQ(status.iterations(), counted / round);
  if (chains > 0) {  // what their samples are is their integrator's; each segment has its mutations
    EXPECT_EQ(ledger.chain_segments(), counted) << "the chains' records are of other segments than the film";
    std::uint64_t mutations = 0;
    for (const v1::ChainGroupStatus& group : status.chains().groups()) mutations += group.mutations();
    if (complete) {
      EXPECT_EQ(mutations, counted * status.chains().plan().segment_mutations());
    }
    EXPECT_EQ(status.samples(), ledger.film_eye_samples());
    return;
  }
  const std::uint64_t pixels = std::uint64_t{status.settings().width()} * status.settings().height();
  EXPECT_EQ(ledger.film_eye_samples(), pixels * counted)
      << "the film counted other samples than its units have";
  EXPECT_EQ(status.samples(), ledger.film_eye_samples());
}

std::vector<fs::path> files_in(const fs::path& folder, const std::string& prefix) {
  std::vector<fs::path> out;
  std::error_code code;
  for (auto it = fs::recursive_directory_iterator(folder, code);
       !code && it != fs::recursive_directory_iterator(); it.increment(code))
    if (it->is_regular_file(code) && it->path().filename().string().starts_with(prefix))
      out.push_back(it->path());
  std::sort(out.begin(), out.end());
  return out;
}

std::uint64_t newest_checkpoint(const fs::path& folder) {
  std::uint64_t newest = 0;
  for (const fs::path& path : files_in(folder, "film."))
    if (path.extension() == ".ckpt")
      newest = std::max<std::uint64_t>(newest, std::stoull(path.filename().string().substr(5)));
  return newest;
}

void expect_identical(const image::Image& a, const image::Image& b, const std::string& what) {
  ASSERT_EQ(a.width, b.width) << what;
  ASSERT_EQ(a.height, b.height) << what;
  ASSERT_EQ(a.rgb.size(), b.rgb.size()) << what;
  std::size_t different = 0, first = 0;
  double sum = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) {
    sum += static_cast<double>(a.rgb[i]);
    if (std::memcmp(&a.rgb[i], &b.rgb[i], sizeof(float)) == 0) continue;
    if (different++ == 0) first = i;
  }
  EXPECT_GT(sum, 0) << what << ": the image is black, which proves nothing";
  EXPECT_EQ(different, 0U) << what << ": first at pixel " << first / 3 % a.width << ", "
                           << first / 3 / a.width << ": " << a.rgb[first] << " and " << b.rgb[first];
}

}  // namespace candela::farm
