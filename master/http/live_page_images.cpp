// Pictures of jobs as files: thumbnails in the list, downloads of the image.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include "common/base/log.h"
#include "common/base/thread_cpu.h"
#include "common/image/image.h"
#include "master/farm.h"
#include "master/http/live_page.h"
#include "master/http/page_json.h"

namespace candela::master {
namespace {

constexpr std::size_t kMaxWanted = 256;  // thumbnails that are asked for and not made; older ones are dropped
// Share of one core for thumbnails, and the most seconds of it that are saved up.
constexpr double kThumbnailShare = 0.008, kThumbnailSeconds = 3;
constexpr int kMaxDownloads = 4;  // at a time, those that are being sent included
constexpr double kMaxExposure = 64;

std::string value_of(const HttpRequest& request, const char* name) {
  const auto it = request.query.find(name);
  return it == request.query.end() ? std::string() : it->second;
}

// Letters, digits and ".-_" of a job's name.
std::string file_name(const JobRow& row, std::string_view ending) {
  std::string out;
  for (const char c : row.name.substr(0, 100)) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       c == '-' || c == '_' || (c == '.' && !out.empty());
    if (plain)
      out += c;
    else if (!out.empty() && out.back() != '_')
      out += '_';
  }
  while (!out.empty() && out.back() == '_') out.pop_back();
  return (out.empty() ? row.id : out) + std::string(ending);
}

}  // namespace

HttpAnswer LivePage::png_answer(const Thumbnails& made, bool large, const std::string& revision) {
  HttpAnswer out{.type = "image/png", .shared = made.png[large ? 1 : 0]};
  out.lasting = made.revision == revision;
  return out;
}

std::optional<HttpAnswer> LivePage::thumbnail(const HttpRequest& request, const std::string& id,
                                              std::uint64_t connection) {
  const auto revision = farm_.with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(id);
    return job == nullptr ? std::string() : thumbnail_revision(*job);
  });
  if (revision.empty()) return HttpAnswer{.code = 202};
  const bool large = value_of(request, "size") == "large", exact = value_of(request, "revision") == revision;
  if (const auto known = thumbnails_.find(id); known && (known->revision == revision || !exact)) {
    HttpAnswer out = png_answer(*known, large, revision);
    out.lasting = out.lasting && exact;
    if (known->revision == revision) return out;
  }
  return later(connection, [this, id, revision, large, exact] {
    if (auto read = read_thumbnails(farm_.data_folder() / "jobs" / id, revision)) {
      thumbnails_.keep(id, *read);
      HttpAnswer out = png_answer(*read, large, revision);
      out.lasting = out.lasting && exact;
      return out;
    }
    wanted_.erase(std::remove(wanted_.begin(), wanted_.end(), id), wanted_.end());
    wanted_.push_back(id);
    if (wanted_.size() > kMaxWanted) wanted_.pop_front();
    // An older picture is better than none.
    if (const auto known = thumbnails_.find(id)) return png_answer(*known, large, revision);
    return HttpAnswer{.code = 202};
  });
}

void LivePage::make_wanted_thumbnails() {
  const double now = farm_.now().seconds;
  thumbnail_credit_ =
      std::min(kThumbnailSeconds, thumbnail_credit_ + kThumbnailShare * (now - thumbnail_credited_));
  thumbnail_credited_ = now;
  std::vector<std::string> made;
  while (!wanted_.empty() && thumbnail_credit_ > 0) {
    const std::string id = wanted_.front();
    wanted_.pop_front();
    const double before = thread_cpu_seconds();
    if (make_thumbnail(id)) made.push_back(json_string(id));
    thumbnail_credit_ -= thread_cpu_seconds() - before;
  }
  if (!made.empty()) out_.publish("farm", fmt::format("event: thumbnails\ndata: {}\n\n", json_array(made)));
}

bool LivePage::make_thumbnail(const std::string& id) {
  struct View {
    std::string revision;
    std::uint32_t width = 0, height = 0;
    bool ended = false;
  };
  const View view = farm_.with_scheduler([&](Scheduler& s) {
    if (!s.jobs().contains(id)) return View{};
    const Job& job = s.jobs().at(id);
    return View{thumbnail_revision(job), job.row.settings.width, job.row.settings.height,
                has_ended(job.row.state)};
  });
  if (view.revision.empty()) return false;
  const auto place = picture_memory_.take(Picture::memory_bytes(view.width, view.height));
  if (!place.ok()) return false;  // the page asks again
  const auto picture = make_picture(farm_, id, {});
  auto made = picture.ok() ? make_thumbnails(**picture, view.revision) : Result<Thumbnails>(picture.error());
  if (!made.ok()) {
    log::info("no thumbnail: " + made.error().to_string(), {.job = id});
    return false;
  }
  thumbnails_.keep(id, *made);
  if (view.ended)
    if (const auto written = write_thumbnails(farm_.data_folder() / "jobs" / id, *made); !written.ok())
      log::info("no thumbnail on disk: " + written.error().to_string(), {.job = id});
  return true;
}

std::optional<HttpAnswer> LivePage::download(const HttpRequest& request, const std::string& id, bool png,
                                             std::uint64_t connection) {
  double exposure = 0;
  if (const std::string text = value_of(request, "exposure"); !text.empty()) {
    const char* end = text.data() + text.size();
    const auto [at, error] = std::from_chars(text.data(), end, exposure);
    if (error != std::errc() || at != end || !(std::abs(exposure) <= kMaxExposure))
      return error_answer(400, "exposure must be a number of stops, -64 to 64");
  }
  if (downloads_.use_count() > kMaxDownloads)
    return error_answer(503, "images are being sent to others: ask again in a moment");
  {
    const Lock lock(mutex_);
    saves_.push_back([this, connection, id, png, exposure, turn = downloads_] {
      HttpAnswer made;
      try {
        made = image_file(id, png, exposure, turn);
      } catch (const std::bad_alloc&) {
        made = error_answer(503, "the master is out of memory: ask again in a moment");
      }
      out_.answer(connection, std::move(made));
    });
  }
  save_wake_.notify_all();
  return std::nullopt;
}

HttpAnswer LivePage::image_file(const std::string& id, bool png, double exposure, std::shared_ptr<int> turn) {
  const auto row = farm_.with_scheduler([&](Scheduler& s) {
    const Job* job = s.job(id);
    return job == nullptr ? std::optional<JobRow>() : std::optional(job->row);
  });
  if (!row) return error_answer(404, "no such job");
  auto bytes = [&]() -> Result<std::string> {
    if (!png) return farm_.images().encode(id, {});
    CANDELA_ASSIGN(const ImageMemory::Place place,
                   picture_memory_.take(Picture::memory_bytes(row->settings.width, row->settings.height)));
    CANDELA_ASSIGN(const std::shared_ptr<Picture> picture, make_picture(farm_, id, {}));
    const Picture::Level& level = picture->levels().front();
    return image::encode_png({level.width, level.height, level.rgb, {}}, exposure);
  }();
  if (!bytes.ok())
    return error_answer(bytes.error().kind == ErrorKind::resource ? 503 : 409, bytes.error().to_string());
  auto place = farm_.images().memory().take(bytes->size());
  if (!place.ok()) return error_answer(503, place.error().to_string());
  // Until the last of it is sent.
  struct Sent {
    std::string bytes;
    ImageMemory::Place place;
    std::shared_ptr<int> turn;
  };
  const auto sent = std::make_shared<Sent>(Sent{std::move(*bytes), std::move(*place), std::move(turn)});
  return {.type = png ? "image/png" : "image/x-exr",
          .shared = std::shared_ptr<const std::string>(sent, &sent->bytes),
          .file = file_name(*row, png ? ".png" : ".exr")};
}

void LivePage::run_saves() {
  for (;;) {
    Task task;
    {
      Lock lock(mutex_);
      save_wake_.wait(lock, [this]() CANDELA_REQUIRES(mutex_) { return stopping_ || !saves_.empty(); });
      if (stopping_) return;
      task = std::move(saves_.front());
      saves_.pop_front();
    }
    task();
  }
}

}  // namespace candela::master
