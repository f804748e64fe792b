// Small pictures of jobs for the list, as PNG in two sizes. They are made when somebody sees their job in the
// list, and made anew when the job has half as many iterations again; those of ended jobs lie in the job's
// folder.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "master/http/pictures.h"
#include "master/scheduler/scheduler_state.h"

namespace candela::master {

inline constexpr std::array<std::uint32_t, 2> kThumbnailSides{96, 256};  // pixels of the longer side

struct Thumbnails {
  std::string revision;
  std::array<std::shared_ptr<const std::string>, kThumbnailSides.size()> png;
  std::size_t bytes() const { return png[0]->size() + png[1]->size(); }
};

// Names the picture that the list shows now; empty: nothing is merged.
std::string thumbnail_revision(const Job& job);

// A scene whose bright pixels lie far from 1 is exposed so that they lie at 1.
Result<Thumbnails> make_thumbnails(const Picture& picture, std::string revision);

// The file in a job's folder. Nothing: there is none of this revision.
std::optional<Thumbnails> read_thumbnails(const std::filesystem::path& folder, const std::string& revision);
Result<void> write_thumbnails(const std::filesystem::path& folder, const Thumbnails& thumbnails);

// The last that were made or asked for. Thread-safe.
class ThumbnailMemory {
 public:
  explicit ThumbnailMemory(std::size_t limit_bytes = 32 << 20) : limit_bytes_(limit_bytes) {}
  std::optional<Thumbnails> find(const std::string& job_id);
  void keep(const std::string& job_id, Thumbnails thumbnails);
  std::size_t bytes() const;

 private:
  struct Entry {
    std::string job_id;
    Thumbnails thumbnails;
  };
  const std::size_t limit_bytes_;
  mutable Mutex mutex_;
  std::list<Entry> entries_ CANDELA_GUARDED_BY(mutex_);  // the last first
  std::map<std::string, std::list<Entry>::iterator> by_job_ CANDELA_GUARDED_BY(mutex_);
  std::size_t bytes_ CANDELA_GUARDED_BY(mutex_) = 0;
};

}  // namespace candela::master
