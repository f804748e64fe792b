// The picture of a job while it converges: a PNG that is rewritten, and a viewer that is told.
#pragma once

#include <condition_variable>
#include <iosfwd>
#include <optional>
#include <string>
#include <thread>

#include "client/farm_client.h"
#include "client/preview/tev.h"
#include "client/progress.h"
#include "common/base/mutex.h"

namespace CLI {
class App;
}

namespace candela::client {

// --tev and --preview, as typed.
struct PreviewOptions {
  std::optional<std::string> tev, interval;
};
// `with_png`: the command writes a PNG that can be rewritten.
void add_preview_options(CLI::App& app, PreviewOptions& options, bool with_png);

// The viewer and the PNG file that a preview writes to. There is no preview if both are empty.
struct PreviewPlan {
  std::optional<TevViewer> tev;
  std::string png;  // path; empty: none
  double interval_seconds = 0;
  bool any() const { return tev.has_value() || !png.empty(); }
};
// `name`: of the picture in the viewer. `png`: is rewritten if --preview is given; empty: there is none.
Result<PreviewPlan> plan_preview(const PreviewOptions& options, std::string name, const std::string& png);

// Seconds from one picture to the next: the interval, or more where a picture costs much. `cpu`: of this
// thread, for the picture before; a master spends up to three times as much, and all of it is a tenth of a
// processor at most. `wall`: while other programs have the processors a picture takes long and costs no more.
double preview_pause(double interval, double cpu, double wall);

// Fetches the job's image time and again, in a thread of its own, until it is stopped or ends. Its troubles
// (nothing is merged yet, a viewer that went away) never stop the job.
class Preview {
 public:
  // Precondition: `farm` lives longer. Starts nothing if the plan has nothing.
  Preview(FarmClient& farm, std::string job_id, PreviewPlan plan);
  ~Preview();
  Preview(const Preview&) = delete;
  Preview& operator=(const Preview&) = delete;

  // Tells the user of troubles: of each once, until a picture is shown again.
  void warn(std::ostream& err, ProgressLine& progress);
  // Stops, and shows the picture of now to the viewer if `last`. (The PNG of the end is the caller's.)
  // Idempotent.
  void stop(bool last);

 private:
  void run();
  Result<void> show_now(bool with_png);
  void note(const Result<void>& shown);

  FarmClient& farm_;
  const std::string job_id_;
  PreviewPlan plan_;
  Mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ CANDELA_GUARDED_BY(mutex_) = false;
  std::string told_ CANDELA_GUARDED_BY(mutex_);
  std::optional<std::string> trouble_ CANDELA_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace candela::client
