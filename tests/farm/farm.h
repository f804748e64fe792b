// A farm on loopback, steered with the real command, and the questions the tests ask of it. Masters and
// workers are real processes, or parts of this one where a test is about neither.
#pragma once

#include <candela/v1/client.grpc.pb.h>
#include <grpcpp/security/credentials.h>

#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "common/image/image.h"
#include "tests/farm/process.h"
#include "tests/long_form.h"

namespace candela::master {
class Master;
}
namespace candela::worker {
class Worker;
}

namespace candela::farm {

// No wait is longer. A healthy farm on an idle machine needs a small part of it; beside five busy loops for
// each processor the longest took 130 s.
inline constexpr double kPatienceSeconds = 600;

struct CommandResult {
  int exit_code = -1;  // -1: it did not end and was killed
  std::string out, err;
  double seconds = 0;
};

// The path of a scene that ships with Candela, or of a file of the source tree (NAME.xml).
std::string scene_path(const std::string& name);

// Options of the jobs of these tests: small, of a fixed seed.
inline constexpr std::uint32_t kWidth = 48, kHeight = 32;
std::vector<std::string> job_options(std::uint64_t iterations, std::uint64_t seed = 7);
// Iterations of most jobs of `path`: one reference serves all of them. Odd: the halves differ in length.
inline constexpr std::uint64_t kJobIterations = 301;

// CANDELA_LONG=1: the long forms of all tests, of which continuous integration runs the short ones.
using test::long_form;

// All fatal troubles throw std::runtime_error with the output of the process concerned: GoogleTest reports
// them.
class Farm {
 public:
  Farm();
  ~Farm();

  TempDir& folder() { return folder_; }

  // Other programs in the place of the product's, from the same folder.
  void set_programs(std::string master, std::string worker) {
    master_program_ = std::move(master);
    worker_program_ = std::move(worker);
  }

  // --- in this process ---
  // A master that answers at address() as any other. Some of the program's options.
  void start_master_here(const std::vector<std::string>& options = {});
  void start_worker_here(const std::string& name, unsigned threads = 1);

  // --- processes ---
  void start_master(std::vector<std::string> options = {});
  void kill_master();  // SIGKILL
  // On the same port and data, with the same options. Calls of the tests' own then go over a new connection:
  // the old one's end is known only when somebody looks at it, and a call that is sent before fails.
  void restart_master();
  void restart_master(std::vector<std::string> options);  // with others from now on
  Process& master() { return *master_; }
  const std::string& address() const { return address_; }
  // The token of a master without TLS.
  std::string token_file() const { return (folder_.path() / "data" / "token").string(); }
  Process& start_worker(const std::string& name, unsigned threads = 1, std::vector<std::string> options = {});
  void forget_worker(const Process& worker);  // SIGKILL, if it lives
  std::map<std::string, std::string> environment() const;
  // For every process that is started from now on.
  void add_environment(const std::string& name, const std::string& value) { more_environment_[name] = value; }
  // Arguments that every client command needs to reach the master (TLS, say).
  void set_client_options(std::vector<std::string> options) { client_options_ = std::move(options); }
  // For the tests' own calls.
  void set_credentials(std::shared_ptr<grpc::ChannelCredentials> credentials) {
    credentials_ = std::move(credentials);
  }

  // --- the command ---
  // `candela ARGUMENTS` with $CANDELA_MASTER set, as a function of this process: to start one takes longer
  // than most commands.
  CommandResult candela(std::vector<std::string> arguments);
  // The same in a process of its own.
  CommandResult candela_process(std::vector<std::string> arguments);
  std::unique_ptr<Process> start_candela(std::vector<std::string> arguments, const std::string& name);
  // Submits and expects success; the job's id.
  std::string submit(std::uint64_t iterations, const std::string& scene = "cornell",
                     std::vector<std::string> more = {}, std::uint64_t seed = 7);
  // The image as `candela fetch` gets it.
  image::Image fetch(const std::string& id);
  // The image as `candela render` makes it, in a process of its own: this test's, or an earlier one's with
  // the same settings, unless they say how many threads.
  image::Image render(std::uint64_t iterations, const std::string& scene = "cornell",
                      std::vector<std::string> more = {});

  // --- questions, over plain gRPC: quicker to ask often ---
  v1::FarmService::Stub& stub();
  v1::JobStatus job(const std::string& id);
  // Waits until the job has this state; throws if it fails, ends otherwise, or takes too long.
  v1::JobStatus wait_for(const std::string& id, v1::JobState state, double seconds = kPatienceSeconds);
  v1::JobStatus wait_for_iterations(const std::string& id, std::uint64_t iterations);
  std::vector<v1::WorkerStatus> workers();
  v1::WorkerStatus worker(const std::string& name);  // by name; an empty status if there is none
  std::vector<v1::Event> events(const std::string& id);
  v1::GetLedgerResponse ledger(const std::string& id);
  // Commands that must succeed.
  v1::JobStatus extend(const std::string& id, std::uint64_t iterations);
  v1::JobStatus repair(const std::string& id);

  // Violations of the scheduler's invariants that the present master's log tells of. Each master's are
  // looked for at its end, and reported as failures unless they were asked for here before.
  std::vector<std::string> violations();

  // The ledger of units, the film's own ranges and its count of samples must tell one story: no unit twice,
  // no overlap, and with `complete` no gap in `iterations`. Reports through GoogleTest.
  void audit(const std::string& id, std::uint64_t iterations, bool complete = true);

 private:
  void report_violations();
  void use_token() const;

  TempDir folder_;
  std::set<std::string> violations_;  // that are known
  // Both programs are the product's, but this master tells of violated invariants (checked_master.h).
  std::string master_program_ = "checked-master", worker_program_ = "candela-worker";
  std::vector<std::string> master_options_, client_options_;
  std::map<std::string, std::string> more_environment_;
  std::string address_;
  std::unique_ptr<Process> master_;
  std::vector<std::unique_ptr<Process>> workers_;
  std::unique_ptr<master::Master> master_here_;
  std::vector<std::unique_ptr<worker::Worker>> workers_here_;
  std::shared_ptr<grpc::ChannelCredentials> credentials_;  // null: none
  std::unique_ptr<v1::FarmService::Stub> stub_;
  int serial_ = 0;
};

// Regular files below a folder, in order; those alone whose names begin with `prefix`.
std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder,
                                            const std::string& prefix = "");
// The generation of the newest checkpoint below a folder; 0: there is none.
std::uint64_t newest_checkpoint(const std::filesystem::path& folder);

// Expects that two images are equal to the last bit.
void expect_identical(const image::Image& a, const image::Image& b, const std::string& what);

}  // namespace candela::farm
