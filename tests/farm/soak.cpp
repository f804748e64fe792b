#include "tests/farm/soak.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <thread>
#include <utility>

#include "tests/farm/metrics_page.h"
#include "tests/farm/soak_tools.h"
#include "tests/integrators.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

// Without any change of the farm. On an idle machine it changes within a second or two.
constexpr double kStuckSeconds = 240;

// Jobs of the short form are smaller by this, and the liar lies more often.
constexpr std::uint64_t kShorter = 10;

std::vector<Kind> kinds_of_rows(std::uint64_t shorter) {
  std::vector<Kind> all;
  for (const test::IntegratorRow& row : test::integrators()) {
    if (row.soak_iterations == 0) continue;
    all.push_back({row.name, row.soak_iterations / shorter, {"--integrator", row.name}});
    if (row.chains)
      for (const char* word : {"--set", "chains=64", "--set", "bootstrap=2000"})
        all.back().options.emplace_back(word);
    if (row.merges) all.back().options.insert(all.back().options.end(), {"--set", "plan=full"});
    if (row.epochs)
      for (const auto& [name, value] : row.small)
        all.back().options.insert(all.back().options.end(), {"--set", name + "=" + value});
  }
  return all;
}

bool same(const image::Image& a, const image::Image& b) {
  return a.width == b.width && a.height == b.height && a.rgb.size() == b.rgb.size() &&
         std::equal(a.rgb.begin(), a.rgb.end(), b.rgb.begin());
}

}  // namespace

SoakFarm::SoakFarm()
    : seed_(number_from("CANDELA_SOAK_SEED", 1)),
      random_(seed_),
      short_form_(std::getenv("CANDELA_SOAK_EVENTS") == nullptr &&
                  std::getenv("CANDELA_SOAK_SECONDS") == nullptr),
      kinds_(kinds_of_rows(short_form_ ? kShorter : 1)) {}

void SoakFarm::SetUp() {
  people_ = std::make_unique<People>(farm_, coin());
  clock_ = std::make_unique<ShiftedClock>(farm_);
  farm_.add_environment("CANDELA_LIES", (farm_.folder() / "lies").string());
  farm_.add_environment("CANDELA_LIE_EVERY", short_form_ ? "4" : "40");
  farm_.start_master(master_options("0.5"));
  link_ = std::make_unique<SlowLink>(farm_.address(), LinkOptions{});
  for (const char* name : kWorkers) start_worker(name);
}

std::vector<std::string> SoakFarm::master_options(const std::string& unit_time) const {
  return people_->options("master", {"--unit-time", unit_time, "--checkpoint-interval", "0.1", "--lease-time",
                                     "2", "--http", "127.0.0.1:0", "--audit", "100%"});
}

void SoakFarm::start_worker(const std::string& name) {
  std::vector<std::string> options;
  if (name == "b") options = {"--master", link_->address()};
  farm_.set_programs("checked-master", name == kLiar ? "lying-worker" : "candela-worker");
  workers_[name] = &farm_.start_worker(name, 1, people_->options("worker", std::move(options)));
  farm_.set_programs("checked-master", "candela-worker");
}

void SoakFarm::sleep_a_while() {
  std::this_thread::sleep_for(std::chrono::milliseconds(50 + pick(400)));
}

std::string SoakFarm::progress() {
  std::string out;
  for (const SoakJob& job : jobs_) {
    const v1::JobStatus s = farm_.job(job.id);
    out += fmt::format("{} {} {} {} {}; ", job.id, static_cast<int>(s.state()), s.units_merged(),
                       s.iterations(), s.message());
  }
  for (const v1::WorkerStatus& w : farm_.workers())
    out += fmt::format("{} {} {} {}; ", w.name(), w.state(), w.units_merged(), w.message());
  return out;
}

bool SoakFarm::await(const std::string& what, const std::function<bool()>& condition) {
  const Stopwatch all;
  Stopwatch still;
  std::string before;
  while (true) {
    if (eventually(5, condition)) return true;
    const std::string now = progress();
    if (now == before && still.seconds() > kStuckSeconds) break;
    if (now == before) continue;
    before = now;
    still = Stopwatch();
    if (!short_form_ && all.seconds() > 30)
      std::printf("     waits %.0f s for %s: %s\n", all.seconds(), what.c_str(), now.c_str());
  }
  ADD_FAILURE() << "progress: " << what << ", after " << all.seconds() << " s: " << before;
  return false;
}

// --- jobs ---

const image::Image& SoakFarm::reference(const SoakJob& job) {
  const std::string key = fmt::format("{} {}", job.kind->integrator, job.iterations);
  const auto it = references_.find(key);
  if (it != references_.end()) return it->second;
  return references_.emplace(key, farm_.render(job.iterations, "cornell", job.kind->options)).first->second;
}

void SoakFarm::submit_job(const Kind& kind, std::uint64_t iterations, const std::vector<std::string>& more) {
  const std::string submitter = coin() ? "alice" : "bob";
  farm_.set_client_options(people_->options(submitter));
  std::vector<std::string> options = kind.options;
  options.insert(options.end(), more.begin(), more.end());
  jobs_.push_back({farm_.submit(iterations, "cornell", options), &kind, iterations, submitter});
  told_ += fmt::format(" {} of {} by {}", jobs_.back().id, kind.integrator, submitter);
}

bool SoakFarm::submit() {
  if (jobs_.size() >= kMaxJobs) return false;
  const Kind& kind = kinds_[pick(kinds_.size())];
  submit_job(kind, kind.iterations);
  return true;
}

bool SoakFarm::submit_another() {
  if (jobs_.size() >= kMaxJobs) jobs_.erase(jobs_.begin());
  return submit();
}

std::vector<SoakJob*> SoakFarm::jobs_that(bool have_ended) {
  std::vector<SoakJob*> out;
  for (SoakJob& job : jobs_)
    if (ended(farm_.job(job.id)) == have_ended) out.push_back(&job);
  return out;
}

SoakJob* SoakFarm::some_job(bool that_ended) {
  const auto found = jobs_that(that_ended);
  return found.empty() ? nullptr : found[pick(found.size())];
}

// --- invariants ---

void SoakFarm::check() {
  check_images();
  check_processes();
  check_liar();
}

void SoakFarm::check_images() {
  for (const SoakJob* job : jobs_that(true)) {
    check_image(*job);
    if (HasFailure()) return;
  }
}

// Each image that is given out is the whole one, or the job says what is missing or who made it false.
void SoakFarm::check_image(const SoakJob& job) {
  const v1::JobStatus status = farm_.job(job.id);
  ASSERT_EQ(status.state(), v1::JOB_STATE_DONE) << job.id << ": " << status.message();
  const std::string file = (farm_.folder() / "soak.exr").string();
  const CommandResult fetched = people_->run("rita", {"fetch", job.id, "-o", file});
  if (fetched.exit_code != 0) {
    EXPECT_EQ(fetched.exit_code, 1) << fetched.err;
    EXPECT_NE(fetched.err.find("candela repair " + job.id), std::string::npos) << fetched.err;
    EXPECT_GT(farm_.job(job.id).lost(), 0U);
    ++losses_;
    return;
  }
  const auto image = image::read_image(file);
  ASSERT_TRUE(image.ok()) << image.error().to_string();
  if (same(*image, reference(job))) {
    ++equal_;
  } else if (liar_had_a_part(job.id) &&
             (!is_found_ || eventually(10, [&] { return farm_.job(job.id).taints_size() > 0; }))) {
    false_.insert(job.id);
  } else {
    expect_identical(*image, reference(job), fmt::format("{} of {}", job.id, job.kind->integrator));
  }
  if (ended(farm_.job(job.id)) && farm_.job(job.id).lost() == 0) farm_.audit(job.id, job.iterations);
}

bool SoakFarm::liar_had_a_part(const std::string& id) {
  const v1::GetLedgerResponse ledger = farm_.ledger(id);
  for (const v1::LedgerRow& row : ledger.merged())
    if (liar_ids_.contains(row.worker_id())) return true;
  return farm_.job(id).taints_size() > 0;
}

// alive, answers, flat
void SoakFarm::check_processes() {
  EXPECT_TRUE(farm_.master().running()) << "alive: the master has ended";
  for (const auto& [name, worker] : workers_) EXPECT_TRUE(worker->running()) << "alive: worker " << name;
  Viewer viewer(farm_.master().wait_for_line("http on ", 10));
  viewer.ask("/healthz", "", false);
  EXPECT_TRUE(viewer.answered(60)) << "answers: not even its health";
  count_audits();
  resident_mb_["master"].push_back(resident_mb(farm_.master()));
  for (const auto& [name, worker] : workers_) resident_mb_[name].push_back(resident_mb(*worker));
}

// A master counts from its start.
void SoakFarm::count_audits() {
  const std::string page = http_get(farm_.master().wait_for_line("http on ", 10), "/metrics");
  for (const char* result : {"equal", "disputed", "alone", "rechecked"}) {
    const double now = metric(page, "candela_audits_total", fmt::format("\"{}\"", result));
    Count& count = audits_[result];
    count.sum += now >= count.last ? now - count.last : now;
    count.last = now;
  }
}

std::size_t SoakFarm::lies() {
  std::ifstream file(farm_.folder() / "lies");
  return static_cast<std::size_t>(
      std::count(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>(), '\n'));
}

std::vector<v1::DistrustedWorker> SoakFarm::distrusted() {
  v1::ListWorkersResponse all;
  EXPECT_TRUE(eventually(30, [&] {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(10));
    return farm_.stub().ListWorkers(&context, {}, &all).ok();
  })) << "answers: not who works for it";
  for (const v1::WorkerStatus& worker : all.workers())
    if (worker.name() == kLiar) liar_ids_.insert(worker.id());
  return {all.distrusted().begin(), all.distrusted().end()};
}

void SoakFarm::check_liar() {
  const auto found = distrusted();
  for (const v1::DistrustedWorker& one : found)
    EXPECT_TRUE(one.worker().ends_with(std::string("/") + kLiar))
        << "liar: " << one.worker() << ": " << one.reason();
  if (found.empty() || std::exchange(is_found_, true)) return;
  lies_to_be_found_.push_back(lies() - known_lies_);
  known_lies_ = lies();
  if (!short_form_) std::printf("     %s\n", found.front().reason().c_str());
}

int SoakFarm::cuts() {
  int count = 0;
  for (const std::string& id : urgent_)
    for (const v1::Event& event : farm_.events(id)) count += event.kind() == "cut" ? 1 : 0;
  return count;
}

// whole, and the liar is set aside by name
void SoakFarm::check_end() {
  // The liar lies until it is found.
  while (distrusted().empty() && !HasFailure()) {
    submit_another();
    await("the liar to be found", [&] { return !distrusted().empty() || ended(farm_.job(jobs_.back().id)); });
  }
  check_liar();
  for (const SoakJob& job : jobs_) {
    if (!await(job.id + " to end", [&] { return ended(farm_.job(job.id)); })) return;
    people_->expect_done("olga", {"repair", job.id});
    if (!await(job.id + " to be whole", [&] {
          const v1::JobStatus status = farm_.job(job.id);
          return ended(status) && status.lost() == 0 && !status.repairing();
        }))
      return;
    check_image(job);
    if (HasFailure()) return;
  }
}

void SoakFarm::expect_flat() const {
  for (const auto& [name, mb] : resident_mb_) {
    const auto middle = mb.begin() + static_cast<std::ptrdiff_t>(mb.size() / 2);
    const double before = *std::max_element(mb.begin(), middle), after = *std::max_element(middle, mb.end());
    std::printf("%s: at most %.0f MB in the first half, %.0f MB in the second\n", name.c_str(), before,
                after);
    EXPECT_LE(after, 1.5 * before + 64) << "flat: " << name;
  }
}

std::string SoakFarm::summary() {
  std::string out = fmt::format(
      "{} images equal, {} refused for a loss, {} jobs with false samples, which said so; {} cuts for "
      "urgent jobs; lies until the liar was found: {}, {} in all; units audited:",
      equal_, losses_, false_.size(), cuts(), fmt::join(lies_to_be_found_, ", "), lies());
  for (const auto& [result, audits] : audits_) out += fmt::format(" {} {},", audits.sum, result);
  return out;
}

}  // namespace candela::farm
