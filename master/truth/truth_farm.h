// The interface of the farm for JobTruth. The farm implements it, so that nothing in this folder knows the
// farm.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include "common/base/result.h"
#include "master/merge/job_film.h"
#include "master/scheduler/scheduler.h"
#include "master/store/blob_store.h"
#include "master/store/store.h"
#include "master/truth/manifest.h"

namespace candela::master {

class TruthFarm {
 public:
  virtual ~TruthFarm() = default;

  virtual Now now() const = 0;
  virtual bool stopping() const = 0;
  virtual const std::filesystem::path& data_folder() const = 0;
  virtual BlobStore& blobs() = 0;
  virtual Store& store() = 0;
  virtual StoreWriter& writer() = 0;
  // Loaded or not; null before the pilot and for unknown jobs.
  virtual std::shared_ptr<JobFilm> film_of(const std::string& job_id) = 0;
  // Calls `use` under the scheduler's lock, then hands its changes to the store's queue.
  virtual void use_scheduler(const std::function<void(Scheduler&)>& use) = 0;

  // Calls `change` under the scheduler's lock; what it changed is written when this returns.
  virtual Result<void> change(const std::string& job_id,
                              const std::function<Result<void>(Scheduler&, Now)>& change) = 0;
  // A job that only its folder knew. Precondition: its row and bundle are in the store already.
  virtual Result<void> take_in(Manifest manifest) = 0;
  virtual std::string blob_lost(const std::string& sha256, bool damaged) = 0;

  // The result of f(scheduler), called by use_scheduler().
  template <class F>
  auto with_scheduler(F&& f) {
    using Answer = std::invoke_result_t<F, Scheduler&>;
    if constexpr (std::is_void_v<Answer>) {
      use_scheduler([&](Scheduler& s) { f(s); });
    } else {
      std::optional<Answer> answer;
      use_scheduler([&](Scheduler& s) { answer.emplace(f(s)); });
      return std::move(*answer);
    }
  }
};

}  // namespace candela::master
