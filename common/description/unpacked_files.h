// Files whose names end in .gz, unpacked.
#pragma once

#include <map>
#include <string>

#include "common/base/mutex.h"
#include "common/description/object.h"
#include "common/description/reading_budget.h"

namespace candela::description {

// Opens the files of another source. What ends in .gz is unpacked once and kept, and counts in the other
// source's budget as long; of pbrt's texts the last one is kept; the other source outlives this one. May be
// used by several threads.
class UnpackedFiles final : public FileSource {
 public:
  explicit UnpackedFiles(const FileSource& files) : files_(files) {}
  Result<Bytes> open(const std::string& key) const override;
  // The same, for readers with a limit: a packed file that unpacks to more than `max_bytes` is an error.
  Result<Bytes> open(const std::string& key, std::size_t max_bytes) const;
  // A packed file is unpacked no further, and is not kept.
  Result<Bytes> start(const std::string& key, std::size_t count) const override;
  // A packed file is not unpacked.
  Result<void> find(const std::string& key) const override { return files_.find(key); }
  ReadingBudget& budget() const override { return files_.budget(); }

 private:
  struct Content {
    std::string text;
    Charge charge;
  };
  Result<Content> unpack(const Bytes& packed, const std::string& key, std::size_t max_bytes) const;

  const FileSource& files_;
  mutable Mutex mutex_;
  mutable std::map<std::string, Bytes> unpacked_ CANDELA_GUARDED_BY(mutex_);
  // The shapes of one pbrt file open it in turn.
  mutable std::string text_key_ CANDELA_GUARDED_BY(mutex_);
  mutable Bytes text_ CANDELA_GUARDED_BY(mutex_);
};

}  // namespace candela::description
