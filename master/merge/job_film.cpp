#include "master/merge/job_film.h"

#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <charconv>
#include <new>
#include <span>
#include <vector>

#include "common/base/files.h"
#include "common/base/memory_limit.h"
#include "common/chains/mutation_sums.h"

namespace candela::master {
namespace {

constexpr std::uint64_t kMaxCheckpointBytes = 1ULL << 38;
constexpr std::size_t kSpareBytes = 32 << 20;  // address space for calls: their threads have stacks of 8 MB

// True if the address space has room for other things beside what was just taken.
bool leaves_room() {
  void* const probe =
      ::mmap(nullptr, kSpareBytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (probe == MAP_FAILED) return false;
  ::munmap(probe, kSpareBytes);
  return true;
}

// Checks that `after` can be what segment number `segment` of this chain left of `before`.
Result<void> follows(const chains::ChainRecord& before, const chains::ChainRecord& after, std::uint64_t chain,
                     std::uint64_t segment) {
  if (before.segments != segment)
    return refused_error(fmt::format("chain {} has {} segments, the delta brings number {}", chain,
                                     before.segments, segment))
        .with_field("unit");
  const auto bad = [&](std::string_view what) {
    return input_error(fmt::format("the record of chain {} contradicts the one before: {}", chain, what))
        .with_field("chain_records");
  };
  if (after.segments != segment + 1)
    return bad(fmt::format("it is of {} segments, not {}", after.segments, segment + 1));
  const chains::ChainCounts& a = before.counts;
  const chains::ChainCounts& b = after.counts;
  if (b.mutations < a.mutations || b.accepted < a.accepted || b.large_steps < a.large_steps ||
      b.large_accepted < a.large_accepted || b.longest_stay < a.longest_stay || b.large_sum < a.large_sum ||
      b.large_square_sum < a.large_square_sum)
    return bad("a count has fallen");
  if (a.mollified && (!b.mollified || b.mollified->start_share != a.mollified->start_share ||
                      b.mollified->large_sum < a.mollified->large_sum ||
                      b.mollified->large_square_sum < a.mollified->large_square_sum ||
                      b.mollified->large_product_sum < a.mollified->large_product_sum ||
                      b.mollified->stay_sum < a.mollified->stay_sum || b.mollified->lost < a.mollified->lost))
    return bad("a sum of mollified paths has fallen");
  if (!a.by_mutation.empty() && a.by_mutation.size() != b.by_mutation.size())
    return bad("it has other mutations");
  for (std::size_t i = 0; i < a.by_mutation.size(); ++i) {
    const chains::MutationCounts &x = a.by_mutation[i], &y = b.by_mutation[i];
    if (x.name != y.name) return bad("it has other mutations");
    if (y.proposed < x.proposed || y.accepted < x.accepted || y.rays < x.rays)
      return bad("a count of mutation " + y.name + " has fallen");
  }
  return {};
}

}  // namespace

JobFilm::JobFilm(std::filesystem::path folder, film::Layout layout, int scale_log2, FileWriter writer,
                 CheckpointShape shape)
    : folder_(std::move(folder)),
      layout_(layout),
      scale_log2_(scale_log2),
      writer_(std::move(writer)),
      chains_(shape.chains),
      specs_(std::move(shape.accumulators)),
      epoch_plan_(std::move(shape.epochs)),
      epochs_(epoch_plan_ ? std::optional<Epochs>({epoch_plan_->first, epoch_plan_->growth}) : std::nullopt),
      movement_alpha_(shape.movement_alpha) {}

ChainRecords JobFilm::fresh_records() const {
  return ChainRecords(chains_, std::make_shared<const chains::ChainRecord>());
}

std::vector<JobFilm::Found> JobFilm::generations() const {
  std::vector<Found> out;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, code)) {
    const std::string file = entry.path().filename().string();
    if (!file.starts_with("film.") || !file.ends_with(".ckpt")) continue;
    const char* begin = file.data() + 5;
    const char* end = file.data() + file.size() - 5;
    std::uint64_t generation = 0;
    const auto parsed = std::from_chars(begin, end, generation);
    if (parsed.ec == std::errc() && parsed.ptr == end) out.push_back({generation, entry.path()});
  }
  std::sort(out.begin(), out.end(),
            [](const Found& a, const Found& b) { return a.generation > b.generation; });
  return out;
}

Result<ParsedCheckpoint> JobFilm::read(const Found& found) const {
  CANDELA_ASSIGN(const std::string bytes, read_file(found.path, kMaxCheckpointBytes));
  CANDELA_ASSIGN(ParsedCheckpoint parsed,
                 parse_checkpoint(bytes, {chains_, specs_, epoch_plan_, movement_alpha_}));
  if (parsed.film.layout() != layout_ || parsed.film.scale_log2() != scale_log2_)
    return input_error("it belongs to another film");
  return parsed;
}

std::string JobFilm::set_aside(const Found& found, const Error& error) {
  std::error_code code;
  std::filesystem::path aside = found.path;
  aside += ".damaged";
  std::filesystem::rename(found.path, aside, code);
  return fmt::format("checkpoint {} is damaged{}: {}", found.path.filename().string(),
                     code ? "" : ", kept as " + aside.filename().string(), error.message);
}

Result<JobFilm::Loading> JobFilm::ensure_loaded() {
  const Lock file_lock(file_mutex_);
  if (loaded()) return Loading{};
  if (discarded()) return refused_error("the job begins anew");
  return within_memory("the film cannot be read", [&]() CANDELA_REQUIRES(file_mutex_) { return load(); });
}

// If memory runs out nothing changes but names of damaged files.
Result<JobFilm::Loading> JobFilm::load() {
  Loading out{true, {}};
  std::optional<ParsedCheckpoint> found;
  std::uint64_t generation = 0, newest = 0;
  for (const Found& candidate : generations()) {
    newest = std::max(newest, candidate.generation);
    Result<ParsedCheckpoint> parsed = read(candidate);
    if (parsed.ok()) {
      found = std::move(*parsed);
      generation = candidate.generation;
      break;
    }
    if (parsed.error().kind == ErrorKind::resource) return std::move(parsed).error();
    out.trouble += (out.trouble.empty() ? "" : "; ") + set_aside(candidate, parsed.error());
  }
  auto film = found ? std::make_unique<film::MergedFilm>(std::move(found->film))
                    : std::make_unique<film::MergedFilm>(layout_, scale_log2_);
  ChainRecords records = found ? std::move(found->records) : fresh_records();
  stats::MovementSums movement =
      found ? std::move(found->movement) : stats::MovementSums(layout_, movement_alpha_);
  if (found && !leaves_room()) throw std::bad_alloc();
  const Lock lock(mutex_);
  film_ = std::move(film);
  {
    const Lock records_lock(records_mutex_);
    records_ = std::move(records);
  }
  accumulators_ = found ? std::move(found->accumulators) : Accumulators();
  decisions_ = found ? std::move(found->decisions) : Decisions();
  history_ = found ? std::move(found->history) : nullptr;
  movement_ = std::move(movement);
  border_ = {};
  drop_ahead();
  saved_states_ = decisions_.states.size();
  saved_decisions_ = decisions_.made;
  saved_iterations_ = generation > 0 ? film_->iterations() : 0;
  generation_ = std::max(generation_, newest);  // the next one must be newer than a broken one, too
  return out;
}

Result<JobFilm::Verified> JobFilm::verify_files() {
  const Lock file_lock(file_mutex_);
  if (discarded()) return Verified{};
  return within_memory("the checkpoints cannot be read",
                       [&]() CANDELA_REQUIRES(file_mutex_) { return verify(); });
}

Result<JobFilm::Verified> JobFilm::verify() {
  Verified out;
  std::optional<ParsedCheckpoint> newest;
  for (const Found& candidate : generations()) {
    Result<ParsedCheckpoint> parsed = read(candidate);
    if (!parsed.ok() && parsed.error().kind == ErrorKind::resource) return std::move(parsed).error();
    if (!parsed.ok()) {
      out.damage += (out.damage.empty() ? "" : "; ") + set_aside(candidate, parsed.error());
    } else if (!newest) {
      newest = std::move(*parsed);
      const Lock lock(mutex_);
      // An older generation serves now, or one that somebody put in the place of the newest.
      if (film_) saved_iterations_ = std::min(saved_iterations_, newest->film.iterations());
    } else if (out.contradiction.empty()) {
      out.contradiction = contradiction(*parsed, *newest, {chains_, specs_, epoch_plan_});
    }
  }
  const Lock lock(mutex_);
  if (film_ && !newest) saved_iterations_ = 0;
  return out;
}

bool JobFilm::loaded() const {
  const Lock lock(mutex_);
  return film_ != nullptr;
}

void JobFilm::unload_if_idle(double now_seconds, double idle_seconds) {
  const Lock lock(mutex_);
  if (closed_ && saved() && !ahead_.film && now_seconds - last_use_ > idle_seconds) {
    film_.reset();
    accumulators_.clear();
    decisions_ = {};
    history_.reset();
    movement_ = {};
    drop_ahead();
    saved_states_ = saved_decisions_ = 0;
    const Lock records_lock(records_mutex_);
    ChainRecords().swap(records_);
  }
}

Result<JobFilm::Outcome> JobFilm::merge(const film::Delta& delta, std::vector<chains::ChainRecord> records,
                                        const PrefixBorder& border) {
  // Made before the lock, so that nothing fails between the sums and the records.
  ChainRecords shared;
  shared.reserve(records.size());
  for (chains::ChainRecord& record : records)
    shared.push_back(std::make_shared<const chains::ChainRecord>(std::move(record)));

  const Lock lock(mutex_);
  if (closed_ || !film_) return Outcome::closed;
  const Unit& unit = delta.info().unit;
  const Unit::Kind kind = chains_ > 0 ? Unit::Kind::segments : Unit::Kind::iterations;
  if (unit.kind != kind || unit.half > 1)
    return input_error(chains_ > 0 ? "not a delta of segments" : "not a delta of iterations")
        .with_field("unit");
  set_border(border);
  if (film_->merged(unit.half).intersects(unit.begin, unit.end) ||
      (ahead_.film && ahead_.film->merged(unit.half).intersects(unit.begin, unit.end)))
    return Outcome::duplicate;
  if (chains_ > 0) {
    if (unit.end - unit.begin > chains_ / 2 || shared.size() != unit.end - unit.begin)
      return input_error(fmt::format("{} records for {} segments", shared.size(), unit.end - unit.begin))
          .with_field("chain_records");
    for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
      const std::uint64_t chain = chains::chain_of(unit.half, i, chains_);
      CANDELA_TRY(
          follows(*newest_record(chain), *shared[i - unit.begin], chain, chains::segment_of(i, chains_)));
    }
  }
  if (delta.accumulators().size() != specs_.size())
    return input_error(
               fmt::format("{} accumulators, the job has {}", delta.accumulators().size(), specs_.size()))
        .with_field("accumulators");
  if (unit.begin < border_.end[unit.half]) {
    CANDELA_TRY(add_sums(delta, *film_, movement_, accumulators_));
    const Lock records_lock(records_mutex_);
    for (std::uint64_t i = unit.begin; chains_ > 0 && i < unit.end; ++i)
      records_[chains::chain_of(unit.half, i, chains_)].swap(shared[i - unit.begin]);
    return Outcome::merged;
  }
  if (!ahead_.film) {
    ahead_.movement = stats::MovementSums(layout_, movement_alpha_);
    ahead_.film = std::make_unique<film::MergedFilm>(layout_, scale_log2_);
  }
  std::map<std::uint64_t, std::shared_ptr<const chains::ChainRecord>> newest;  // made before the sums change
  for (std::uint64_t i = unit.begin; chains_ > 0 && i < unit.end; ++i)
    newest[chains::chain_of(unit.half, i, chains_)] = std::move(shared[i - unit.begin]);
  CANDELA_TRY(add_sums(delta, *ahead_.film, ahead_.movement, ahead_.accumulators));
  const Lock records_lock(records_mutex_);
  newest.merge(ahead_.records);
  ahead_.records.swap(newest);
  return Outcome::merged;
}

const std::shared_ptr<const chains::ChainRecord>& JobFilm::newest_record(std::uint64_t chain) const {
  const auto ahead = ahead_.records.find(chain);
  return ahead == ahead_.records.end() ? records_[chain] : ahead->second;
}

void JobFilm::remember_history(std::string bytes) {
  auto history = std::make_shared<const std::string>(std::move(bytes));
  const Lock lock(mutex_);
  if (film_) history_ = std::move(history);
}

// Film, movement and accumulators change together or not at all, also if memory runs out.
Result<void> JobFilm::add_sums(const film::Delta& delta, film::MergedFilm& film,
                               stats::MovementSums& movement, Accumulators& accumulators) {
  const auto& sums = delta.accumulators();
  std::uint32_t channels = 0;
  std::vector<film::MergedAccumulator*> to;
  for (std::uint32_t i = 0; i < specs_.size(); ++i) {
    const bool per_job = specs_[i].per == film::AccumulatorSpec::Per::job;
    to.push_back(&editable(accumulators, {i, per_job ? delta.info().unit.half : sums[i].epoch}));
    // Before there is room for them: a refused delta leaves nothing.
    if (to.back()->overfull_with(sums[i]))
      return usage_error(fmt::format("the accumulator '{}' has more than {} pairs of pixel and name, for "
                                     "which there is no memory",
                                     specs_[i].name,
                                     film::max_pairs(specs_[i], layout_.width, layout_.height)))
          .with_field("accumulators")
          .with_mend("leave this AOV out, or give small objects one id together");
    to.back()->reserve(sums[i]);
    channels = std::max(channels, sums[i].sums.channels());
  }
  // To take sums back, and for the movement, nothing is allocated.
  film::SparseSums::TileBuffers buffers(std::max<std::uint32_t>(channels, film::kChannels));
  std::size_t added = 0;
  const auto take_back = [&] {
    while (added-- > 0) to[added]->take_back(sums[added], buffers);
  };
  try {
    for (; added < to.size(); ++added) to[added]->merge(sums[added]);
    Result<void> merged = film.merge(delta);  // the last that can be refused
    if (merged.ok())
      movement.add(delta, buffers);
    else
      take_back();
    return merged;
  } catch (const std::bad_alloc&) {
    take_back();
    throw;
  }
}

//
film::MergedAccumulator& JobFilm::editable(Accumulators& accumulators, const AccumulatorKey& key) {
  auto& held = accumulators[key];
  if (!held)
    held = std::make_shared<film::MergedAccumulator>(layout_.width, layout_.height, specs_[key.first]);
  else if (held.use_count() > 1)  // readers hold it; a new one takes the lock first
    held = std::make_shared<film::MergedAccumulator>(*held);
  return *held;
}

std::shared_ptr<const film::MergedAccumulator> JobFilm::accumulator(std::string_view name,
                                                                    std::uint64_t part) const {
  const Lock lock(mutex_);
  for (std::uint32_t i = 0; film_ && i < specs_.size(); ++i) {
    if (specs_[i].name != name) continue;
    if (const auto found = accumulators_.find({i, part}); found != accumulators_.end()) return found->second;
    return std::make_shared<film::MergedAccumulator>(layout_.width, layout_.height, specs_[i]);
  }
  return nullptr;
}

void JobFilm::close() {
  const Lock lock(mutex_);
  closed_ = true;
}

void JobFilm::reopen() {
  const Lock lock(mutex_);
  closed_ = discarded_;
}

Result<void> JobFilm::discard() {
  const Lock file_lock(file_mutex_);
  {
    const Lock lock(mutex_);
    closed_ = discarded_ = true;
    film_.reset();
    accumulators_.clear();
    decisions_ = {};
    history_.reset();
    movement_ = {};
    drop_ahead();
    const Lock records_lock(records_mutex_);
    ChainRecords().swap(records_);
  }
  for (const Found& found : generations()) {
    std::error_code code;
    std::filesystem::remove(found.path, code);
    if (code)
      return resource_error(fmt::format("cannot remove a film: {}", code.message()))
          .at(found.path.string(), 0);
  }
  return {};
}

bool JobFilm::discarded() const {
  const Lock lock(mutex_);
  return discarded_;
}

JobFilm::Snapshot JobFilm::snapshot(Part part) {
  const LargeWork large;
  const Lock lock(mutex_);
  Snapshot out;
  if (!film_) return out;
  out.film = part == Part::image
                 ? std::make_shared<const film::MergedFilm>(film_->first_layers(image_layers()))
                 : std::make_shared<const film::MergedFilm>(*film_);
  add_all_but_film(out);
  return out;
}

JobFilm::Snapshot JobFilm::snapshot_in(Room& room) {
  const LargeWork large;
  const Lock lock(mutex_);
  Snapshot out;
  if (!film_) return out;
  if (image_layers() == layout_.layers)
    room.film = *film_;
  else
    room.film = film_->first_layers(image_layers());
  out.film = std::shared_ptr<const film::MergedFilm>(std::shared_ptr<void>(), &*room.film);
  add_all_but_film(out);
  return out;
}

void JobFilm::add_all_but_film(Snapshot& out) const {
  out.counts.reserve(records().size());
  for (const auto& record : records()) {
    out.counts.push_back(record->counts);
    out.chain_segments += record->segments;
  }
  out.history = history_;
  out.movement = movement_;
  out.accumulators.resize(specs_.size());
  for (std::size_t i = 0; i < specs_.size(); ++i)
    for (std::uint32_t half = 0; half < 2 && specs_[i].per == film::AccumulatorSpec::Per::job; ++half)
      if (const auto found = accumulators_.find({i, half}); found != accumulators_.end())
        out.accumulators[i][half] = found->second;
}

JobFilm::Account JobFilm::account() const {
  const Lock lock(mutex_);
  Account out;
  for (std::uint32_t h = 0; film_ && h < 2; ++h) {
    out.merged[h] = film_->merged(h);
    out.sample_counts.add(film_->sample_counts(h));
  }
  return out;
}

std::array<film::IndexSet, 2> JobFilm::holds() const {
  const Lock lock(mutex_);
  std::array<film::IndexSet, 2> out;
  for (std::uint32_t h = 0; film_ && h < 2; ++h) {
    out[h] = film_->merged(h);
    if (!ahead_.film) continue;
    for (const auto& [begin, end] : ahead_.film->merged(h).ranges()) out[h].insert(begin, end);
  }
  return out;
}

std::vector<chains::ChainCounts> JobFilm::chain_counts() const {
  const Lock lock(mutex_);
  std::vector<chains::ChainCounts> out;
  out.reserve(records().size());
  for (const auto& record : records()) out.push_back(record->counts);
  return out;
}

std::optional<chains::Summary> JobFilm::chain_summary(const chains::BootstrapSums& bootstrap) const {
  std::optional<chains::Summary> out;
  if (chains_ > 0) out = chains::summarise(bootstrap, chain_counts());
  for (const film::AccumulatorSpec& spec : specs_) {
    if (!spec.name.starts_with(chains::kMutationPrefix)) continue;
    if (!out) out.emplace();
    for (std::uint64_t half = 0; half < 2; ++half)
      if (const auto sums = accumulator(spec.name, half))
        if (const auto counts = chains::counts_of(*sums))
          chains::add(out->groups[half].by_mutation, std::span(&*counts, 1));
  }
  return out;
}

std::size_t JobFilm::largest_record_bytes() const {
  const Lock lock(mutex_);
  std::size_t most = 0;
  for (const auto& record : records())
    if (record->segments > 0) most = std::max(most, chains::encoded_bytes(*record));
  return most;
}

bool JobFilm::all_black() const {
  const Lock lock(mutex_);
  return film_ &&
         std::all_of(records().begin(), records().end(), [](const auto& r) { return r->segments > 0; }) &&
         film_->black(chains::kImageLayers);
}

JobFilm::Starts JobFilm::starts_of(const Unit& unit) const {
  const Lock lock(records_mutex_);
  if (unit.half > 1 || unit.end - unit.begin > chains_ / 2) return {};
  if (records_.empty()) return {Starts::State::unread, {}};
  Starts out{Starts::State::whole, {}};
  out.records.reserve(unit.end - unit.begin);
  for (std::uint64_t i = unit.begin; i < unit.end; ++i) {
    out.records.push_back(newest_record(chains::chain_of(unit.half, i, chains_)));
    const std::uint64_t done = out.records.back()->segments, before = chains::segment_of(i, chains_);
    if (done < before) return {};
    if (done > before) out.state = Starts::State::merged;
  }
  if (out.state != Starts::State::whole) out.records.clear();
  return out;
}

Result<JobFilm::Checkpoint> JobFilm::checkpoint(Room& room) {
  const Lock file_lock(file_mutex_);
  if (discarded()) return refused_error("the job begins anew");
  Saved saved;
  Result<void> encoded = within_memory("the film cannot be copied", [&] { return encode_copy(room, saved); });
  if (!encoded.ok()) {
    // Memory that other jobs left here may be all that is missing.
    room = {};
    encoded = within_memory("the checkpoint cannot be made", [&] { return encode_in_place(room, saved); });
  }
  if (!encoded.ok()) {
    room = {};
    return std::move(encoded).error();
  }
  if (!saved.loaded) return Checkpoint{saved.generation, saved.iterations};  // unloaded means saved
  CANDELA_TRY(make_directories(folder_));
  const std::uint64_t next = saved.generation + 1;
  CANDELA_TRY(writer_(folder_ / fmt::format("film.{}.ckpt", next), room.bytes));
  {
    const Lock lock(mutex_);
    generation_ = next;
    saved_iterations_ = saved.iterations;
    saved_states_ = saved.states;
    saved_decisions_ = saved.decisions;
  }
  // This one and the newest before it stay.
  const std::vector<Found> all = generations();
  std::error_code code;
  for (std::size_t i = 2; i < all.size(); ++i) std::filesystem::remove(all[i].path, code);
  return Checkpoint{next, saved.iterations};
}

//
JobFilm::Saved JobFilm::present() const {
  return {film_ != nullptr, generation_, film_ ? film_->iterations() : saved_iterations_,
          decisions_.states.size(), decisions_.made};
}

// Merges go on while the copy is encoded.
Result<void> JobFilm::encode_copy(Room& room, Saved& saved) const {
  ChainRecords records;
  Accumulators accumulators;
  Decisions decisions;
  std::shared_ptr<const std::string> history;
  stats::MovementSums movement;
  {
    const Lock lock(mutex_);
    saved = present();
    if (!film_) return {};
    accumulators = accumulators_;
    decisions = decisions_;
    history = history_;
    movement = movement_;
    room.film = *film_;
    records = this->records();
  }
  encode_checkpoint(*room.film, records, accumulators, decisions, room.bytes);
  append_movement(movement, room.bytes);
  if (history) append_history(*history, room.bytes);
  return {};
}

// Without a copy, if there is no memory for one. Merges wait.
Result<void> JobFilm::encode_in_place(Room& room, Saved& saved) const {
  const Lock lock(mutex_);
  saved = present();
  if (!film_) return {};
  encode_checkpoint(*film_, records(), accumulators_, decisions_, room.bytes);
  append_movement(movement_, room.bytes);
  if (history_) append_history(*history_, room.bytes);
  return {};
}

bool JobFilm::dirty() const {
  const Lock lock(mutex_);
  return film_ && !saved();
}

bool JobFilm::saved() const {
  return film_ && film_->iterations() == saved_iterations_ && decisions_.states.size() == saved_states_ &&
         decisions_.made == saved_decisions_;
}

std::uint64_t JobFilm::generation() const {
  const Lock lock(mutex_);
  return generation_;
}

void JobFilm::touch(double now_seconds) {
  const Lock lock(mutex_);
  last_use_ = now_seconds;
}

}  // namespace candela::master
