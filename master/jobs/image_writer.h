// Images of what is merged: a snapshot of a film becomes the bytes of an EXR file that explains itself.
//
// Pixels, and every attribute under "candela:" but those named here, depend on scene, settings and merged
// iterations alone: equal renders have equal bytes there. Facts of the run (its job id and name, why it
// stopped, which builds worked on it) are in candela:job, candela:name and under "candela:run:". The place
// of its scene is in candela:scene and candela:reproduce.
//
// Called by any number of threads at a time. The images that were sent a short time ago have a lock of their
// own (RecentImages); an image is encoded from a snapshot, under no lock.
#pragma once

#include <string>

#include "common/base/result.h"
#include "master/jobs/image_memory.h"
#include "master/jobs/job_table.h"
#include "master/jobs/state_reports.h"
#include "master/merge/bulk_threads.h"
#include "master/merge/recent_images.h"
#include "master/truth/job_truth.h"

namespace candela::master {

struct ImageParts {
  bool error_layer = false;
  bool image_only = false;     // without the job's further layers
  bool chain_layers = false;   // with what the image of a job of chains is made of
  bool state_layers = false;   // with what the rule of a job of epochs tells of its newest state
  bool partial = false;        // of a job that has lost samples: what is left
  std::string estimator = {};  // one that the job's development offers; empty: the job's own
  film::MergedFilm::Which which = film::MergedFilm::Which::both;  // a half has no error or variance layer
  bool variance_layer = false;
};

class ImageWriter {
 public:
  // `memory_bytes`: of the images under way.
  ImageWriter(JobTable& table, JobTruth& truth, Store& store, StateReports& reports, BulkThreads& bulk,
              std::uint64_t memory_bytes)
      : table_(table), truth_(truth), store_(store), reports_(reports), bulk_(bulk), memory_(memory_bytes) {}

  // The image of what is merged now, as the bytes of an EXR file. ErrorKind::refused before the first merge
  // (of the half that is asked for), usage for the error layer of a half, resource for want of memory.
  // Precondition: the job exists.
  Result<std::string> encode(const std::string& job_id, const ImageParts& parts);
  // Writes the image into the job's folder. An image that cannot be written is worth a line in the log, no
  // more: the film is safe in its checkpoints.
  void write_file(const std::string& job_id, JobFilm& film);
  RecentImages& recent() { return recent_; }
  ImageMemory& memory() { return memory_; }

 private:
  Result<std::string> encode_within(const std::string& job_id, const ImageParts& parts);
  Result<std::string> encode(const JobRow& row, const JobFilm::Snapshot& snapshot, const ImageParts& parts,
                             const std::vector<StateReport::Layer>& state_layers);

  JobTable& table_;
  JobTruth& truth_;
  Store& store_;
  StateReports& reports_;
  BulkThreads& bulk_;
  RecentImages recent_;
  ImageMemory memory_;
};

}  // namespace candela::master
