#include "master/merge/job_film.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "common/base/files.h"

namespace candela::master {
namespace {

constexpr std::uint64_t kMaxCheckpointBytes = 1ULL << 38;

}  // namespace

JobFilm::JobFilm(std::filesystem::path folder, film::Layout layout, int scale_log2, FileWriter writer)
    : folder_(std::move(folder)), layout_(layout), scale_log2_(scale_log2), writer_(std::move(writer)) {}

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

Result<std::string> JobFilm::ensure_loaded() {
  const std::lock_guard file_lock(file_mutex_);
  if (loaded()) return std::string();
  std::string trouble;
  std::unique_ptr<film::MergedFilm> found;
  std::uint64_t generation = 0, newest = 0;
  for (const Found& candidate : generations()) {
    newest = std::max(newest, candidate.generation);
    auto bytes = read_file(candidate.path, kMaxCheckpointBytes);
    auto parsed = bytes.ok() ? film::MergedFilm::parse(*bytes) : Result<film::MergedFilm>(bytes.error());
    if (parsed.ok() && parsed->layout() == layout_ && parsed->scale_log2() == scale_log2_) {
      found = std::make_unique<film::MergedFilm>(std::move(*parsed));
      generation = candidate.generation;
      break;
    }
    trouble += fmt::format("{}checkpoint {} cannot be used: {}", trouble.empty() ? "" : "; ",
                           candidate.path.filename().string(),
                           parsed.ok() ? "it is another film's" : parsed.error().to_string());
  }
  if (!found) found = std::make_unique<film::MergedFilm>(layout_, scale_log2_);
  const std::lock_guard lock(mutex_);
  saved_iterations_ = generation > 0 ? found->iterations() : 0;
  film_ = std::move(found);
  generation_ = newest;  // the next one must be newer than a broken one, too
  return trouble;
}

bool JobFilm::loaded() const {
  const std::lock_guard lock(mutex_);
  return film_ != nullptr;
}

void JobFilm::unload_if_idle(double now_seconds, double idle_seconds) {
  const std::lock_guard lock(mutex_);
  if (film_ && closed_ && film_->iterations() == saved_iterations_ && now_seconds - last_use_ > idle_seconds)
    film_.reset();
}

Result<JobFilm::Outcome> JobFilm::merge(const film::Delta& delta) {
  const std::lock_guard lock(mutex_);
  if (closed_ || !film_) return Outcome::closed;
  const Unit& unit = delta.info().unit;
  if (unit.kind != Unit::Kind::iterations || unit.half > 1)
    return input_error("not a delta of iterations").with_field("unit");
  if (film_->merged(unit.half).intersects(unit.begin, unit.end)) return Outcome::duplicate;
  CANDELA_TRY(film_->merge(delta));
  return Outcome::merged;
}

void JobFilm::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
}

void JobFilm::reopen() {
  const std::lock_guard lock(mutex_);
  closed_ = false;
}

std::shared_ptr<const film::MergedFilm> JobFilm::snapshot(Part part) {
  const std::lock_guard lock(mutex_);
  if (!film_) return nullptr;
  if (part == Part::image) return std::make_shared<const film::MergedFilm>(film_->image_layer());
  return std::make_shared<const film::MergedFilm>(*film_);
}

Result<JobFilm::Checkpoint> JobFilm::checkpoint() {
  const std::lock_guard file_lock(file_mutex_);
  const std::shared_ptr<const film::MergedFilm> copy = snapshot();
  if (!copy) {
    const std::lock_guard lock(mutex_);
    return Checkpoint{generation_, saved_iterations_};  // unloaded means saved
  }
  CANDELA_TRY(make_directories(folder_));
  const std::uint64_t next = generation() + 1;
  CANDELA_TRY(writer_(folder_ / fmt::format("film.{}.ckpt", next), copy->serialise()));
  {
    const std::lock_guard lock(mutex_);
    generation_ = next;
    saved_iterations_ = copy->iterations();
  }
  // This one and the newest before it stay.
  const std::vector<Found> all = generations();
  std::error_code code;
  for (std::size_t i = 2; i < all.size(); ++i) std::filesystem::remove(all[i].path, code);
  return Checkpoint{next, copy->iterations()};
}

bool JobFilm::dirty() const {
  const std::lock_guard lock(mutex_);
  return film_ && film_->iterations() != saved_iterations_;
}

std::uint64_t JobFilm::generation() const {
  const std::lock_guard lock(mutex_);
  return generation_;
}

void JobFilm::touch(double now_seconds) {
  const std::lock_guard lock(mutex_);
  last_use_ = now_seconds;
}

}  // namespace candela::master
