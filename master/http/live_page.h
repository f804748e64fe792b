// The live page: routes, streams of events, and controls. docs/decisions/050-the-page.md
//
// answer() runs on the thread of the server and neither waits nor computes for long. Whatever reads a film,
// the store or many rows runs on a thread of the page, once for all viewers, and takes at most 2.4 %
// of a core.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "master/http/http_message.h"
#include "master/http/pictures.h"
#include "master/http/refresh_budget.h"
#include "master/http/routes.h"
#include "master/http/thumbnails.h"
#include "master/http/wall.h"
#include "master/jobs/image_memory.h"
#include "master/store/blob_store.h"

namespace candela::master {

class Farm;

struct PageOptions {
  std::string token;       // that allows controls, and reading; empty: the page is read-only
  std::string read_token;  // that allows reading
  bool loopback = true;    // then only requests for a loopback name are answered
};
// Errors (usage): those of wire::read_token_file().
Result<std::string> read_page_token(const std::string& file);

// A blob that comes. Made by LivePage::begin_upload(), and used on the thread of the server.
class BlobUpload {
 public:
  BlobUpload(std::unique_ptr<BlobStore::Upload> upload, std::string sha256, std::uint64_t bytes,
             std::shared_ptr<int> turn)
      : upload_(std::move(upload)),
        sha256_(std::move(sha256)),
        bytes_(bytes),
        left_(bytes),
        turn_(std::move(turn)) {}
  std::uint64_t left() const { return left_; }
  // An answer if the upload cannot go on. Precondition: data are no more than left().
  std::optional<HttpAnswer> add(std::string_view data);

 private:
  friend class LivePage;
  std::unique_ptr<BlobStore::Upload> upload_;
  std::string sha256_;
  std::uint64_t bytes_, left_;
  std::shared_ptr<int> turn_;
};

HttpAnswer error_of(const Error& error);

class LivePage {
 public:
  // Both from any thread.
  struct Out {
    std::function<void(std::uint64_t connection, HttpAnswer answer)> answer;
    std::function<void(const std::string& topic, std::string text)> publish;
  };
  LivePage(Farm& farm, PageOptions options, Out out);
  ~LivePage();

  // Nothing: the answer comes later, by Out::answer.
  std::optional<HttpAnswer> answer(const HttpRequest& request, const RouteMatch& match,
                                   std::uint64_t connection);
  // As BodyLimit says. Only who may submit may send a large body.
  std::size_t body_limit(const HttpRequest& head) const;
  // The answer to a PUT, or `upload`, which takes its body.
  std::optional<HttpAnswer> begin_upload(const HttpRequest& request, std::unique_ptr<BlobUpload>& upload);
  // Precondition: nothing is left of it.
  void finish_upload(std::unique_ptr<BlobUpload> upload, std::uint64_t connection);
  void opened(const std::string& topic);
  void closed(const std::string& topic);

 private:
  struct Topic {
    int viewers = 0;
    std::map<std::string, std::string> sent;  // by kind of event: the last one, for who comes later
    RefreshBudget status, details, picture;
    bool listed = false;           // of the farm: the page knows the lines that viewers have by GET
    std::uint64_t iterations = 0;  // of the picture that was sent
    std::shared_ptr<Picture> picture_made;
  };
  using Rows = std::map<std::string, std::string>;  // by id: JSON
  using Task = std::function<void()>;

  std::optional<HttpAnswer> answer_api(const HttpRequest& request, const RouteMatch& match,
                                       std::uint64_t connection);
  std::optional<HttpAnswer> control(const HttpRequest& request, const RouteMatch& match,
                                    std::uint64_t connection);
  // Why the request may change nothing; nothing: it may.
  std::optional<HttpAnswer> may_not_change(const HttpRequest& request) const;
  HttpAnswer submit(const std::string& json);
  HttpAnswer list_groups();
  HttpAnswer finished(BlobUpload& upload);
  HttpAnswer open_stream(const HttpRequest& request);
  HttpAnswer tile(const HttpRequest& request, const std::string& job_id);
  HttpAnswer pixel(const HttpRequest& request, const std::string& job_id);
  // live_page_colors.cpp
  static Result<PictureKind> kind_of(const HttpRequest& request);
  static std::string topic_of(const std::string& job_id, const PictureKind& kind);
  static PictureKind kind_of_topic(const std::string& topic);
  // The newest picture of the stream that the request's kind names. Null: `otherwise` is the answer.
  std::shared_ptr<Picture> shown_picture(const HttpRequest& request, const std::string& job_id,
                                         HttpAnswer& otherwise);
  std::optional<HttpAnswer> colors(const HttpRequest& request, const std::string& job_id,
                                   std::uint64_t connection);
  // live_page_images.cpp
  std::optional<HttpAnswer> thumbnail(const HttpRequest& request, const std::string& id,
                                      std::uint64_t connection);
  static HttpAnswer png_answer(const Thumbnails& made, bool large, const std::string& revision);
  void make_wanted_thumbnails();
  bool make_thumbnail(const std::string& id);
  std::optional<HttpAnswer> download(const HttpRequest& request, const std::string& id, bool png,
                                     std::uint64_t connection);
  HttpAnswer image_file(const std::string& id, bool png, double exposure, std::shared_ptr<int> turn);
  void run_saves();
  bool is_token(std::string_view given) const;  // one of both
  bool may_read(const HttpRequest& request) const;
  HttpAnswer log_in(const HttpRequest& request) const;
  std::optional<HttpAnswer> refusal(const HttpRequest& request) const;
  std::optional<HttpAnswer> later(std::uint64_t connection, std::function<HttpAnswer()> make);

  // A picture that was made a short time ago, whoever looks at it.
  struct Kept {
    std::string topic;
    std::uint64_t indices = 0;  // merged, when it was made
    std::shared_ptr<Picture> picture;
  };

  // On the thread of the page.
  void run();
  // The picture of a topic: a kept one if as many indices are merged as then.
  Result<std::shared_ptr<Picture>> picture_of(const std::string& topic, const std::string& id,
                                              std::uint64_t indices);
  void refresh();
  void refresh_farm();
  void refresh_running_jobs();
  void look_at_farm();
  void refresh_worker(const std::string& topic, const std::string& id);
  void refresh_picture(const std::string& topic, const std::string& id);
  std::string details_of(const std::string& id);
  void send(const std::string& topic, const std::string& kind, std::string data);
  void tell_changed(const std::string& kind, const std::vector<std::string>& rows);
  Rows job_rows();
  Rows rows_of(const std::vector<std::string>& job_ids);
  std::string throughput_json() const;
  Rows worker_rows();
  HttpAnswer list_jobs(const std::map<std::string, std::string>& query);
  HttpAnswer change(const std::string& id, std::string_view verb, bool group,
                    const std::map<std::string, std::string>& values);

  Farm& farm_;
  const PageOptions options_;
  const Out out_;
  // A browser that has shown a token gets them, since it cannot send a header with a stream of events. They
  // are made of the token, so that they stay good over a restart, and read only.
  const std::string cookie_name_, cookie_value_;
  const std::string start_;  // differs after a restart of the master

  Mutex mutex_;  // held for copying alone
  std::condition_variable wake_;
  bool stopping_ CANDELA_GUARDED_BY(mutex_) = false;
  std::deque<Task> tasks_ CANDELA_GUARDED_BY(mutex_);
  std::map<std::string, Topic> topics_ CANDELA_GUARDED_BY(mutex_);
  Rows jobs_ CANDELA_GUARDED_BY(mutex_), workers_ CANDELA_GUARDED_BY(mutex_);  // as last sent
  std::deque<Task> saves_ CANDELA_GUARDED_BY(mutex_);                          // downloads
  std::condition_variable save_wake_;

  ImageMemory picture_memory_;  // of pictures that are kept or shown
  ThumbnailMemory thumbnails_;
  const std::shared_ptr<int> downloads_ = std::make_shared<int>(0);  // one more owner for each under way
  const std::shared_ptr<int> uploads_ = std::make_shared<int>(0);    // as downloads_
  // Members for the thread of the page alone:
  std::list<Kept> kept_;                                     // the last made first
  std::deque<std::string> wanted_;                           // jobs whose thumbnails are to be made
  double thumbnail_credit_ = 0, thumbnail_credited_ = -1e9;  // seconds
  std::map<std::string, JobState> states_;                   // of the lines in jobs_
  FarmHistory history_;
  FarmPoint newest_;
  double look_at_ = 0;
  std::thread thread_, save_thread_;
};

}  // namespace candela::master
