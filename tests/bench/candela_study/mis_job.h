// Jobs of path and optimis, rendered block by block on one thread, and the images that are read from what any
// blocks have merged: several estimators from the same samples.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/film/merged_film.h"
#include "common/mis/sums.h"
#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/renders.h"
#include "worker/render/renderer.h"

namespace candela::study {

// CPU seconds of the calling thread.
double thread_seconds();

class MisJob {
 public:
  // The merged film and sums of some blocks.
  struct Merged {
    film::MergedFilm film;
    std::array<std::vector<film::MergedAccumulator>, 2> sums;  // [half][accumulator]
  };

  static Result<MisJob> create(const Render& render);

  const WorkPlan& work() const { return pilot_.work; }
  const std::string& plan() const { return pilot_.plan; }
  Merged empty() const;
  // Renders indices [begin, end) of each half and merges them into each of `into`. Returns the seconds of
  // rendering alone. A rejected sample is an error.
  Result<double> render(std::uint64_t begin, std::uint64_t end, const std::vector<Merged*>& into);
  // The image by an estimator of the job's development, or of the film itself if it has none.
  // seconds: if not null, CPU seconds of all threads are added.
  Result<Image> image(const Merged& merged, std::string_view estimator, double* seconds = nullptr) const;
  // Slopes of all samples, by technique: a value for each pixel, of green, or none. They are those that sum
  // to the image.
  std::vector<std::vector<float>> slopes(const Merged& merged) const;

 private:
  MisJob() = default;

  Render render_;
  std::unique_ptr<render::Renderer> renderer_;
  PilotResult pilot_;
  render::UnitOutput output_;
};

}  // namespace candela::study
