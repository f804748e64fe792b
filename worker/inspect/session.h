// A scene with all that the tools of `candela inspect` read of it: its objects by name, one light path
// expression, regions, and the settings of its job.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/job/job.h"
#include "common/letters/automaton.h"
#include "common/letters/request.h"
#include "worker/core/vec.h"
#include "worker/film/filter.h"
#include "worker/integrators/volume/recorded_path.h"
#include "worker/scene/scene.h"

namespace candela::inspect {

using integrators::PathConsumer;
using integrators::PathVertex;
using integrators::PixelRect;
using integrators::RecordedPath;

// Light that matches `expression` is selected.
struct Selection {
  std::string expression;  // empty: all light
  std::vector<letters::Region> regions;
  double glossy_below = letters::kDefaultGlossyBelow;
};

class Session {
 public:
  // Reads and builds the scene as render::Renderer::create() does, with the crop and the edits of the
  // settings. Errors are those of the scene's files, of the expression and of the edits.
  static Result<std::unique_ptr<Session>> open(const description::FileSource& files,
                                               const std::string& main_key,
                                               const std::map<std::string, std::string>& parameters,
                                               const JobSettings& settings, const Selection& selection,
                                               unsigned threads, std::uint64_t memory_bytes = 0);

  const scene::Scene& scene() const { return *scene_; }
  const JobSettings& settings() const { return settings_; }
  const film::PixelFilter& filter() const { return filter_; }
  const letters::Automaton& automaton() const { return automaton_; }
  const letters::LayerRequest& request() const { return request_; }  // one layer, the selection
  bool selects() const { return selects_; }
  float glossy_below() const { return static_cast<float>(request_.glossy_below); }

  // The first name of an object; empty if it has none.
  const std::string& object_name(std::uint32_t object) const;
  // The first object with this one's first name: one object stands for all of a name.
  std::uint32_t object_of_name(std::uint32_t object) const { return object_of_name_[object]; }
  // The objects that {NAME} matches, of an object's first name; all if it has none.
  std::uint32_t objects_of_name(std::uint32_t object) const {
    return object < objects_of_name_.size() ? objects_of_name_[object] : letters::kNoObject;
  }
  // Bit i: p, a point of the scene, is inside region i.
  std::uint32_t regions_at(Vec3 p) const;
  // In the coordinates of the scene's file.
  Vec3d in_file(Vec3 p) const { return Vec3d(p) + scene_->offset(); }
  // Place at which the camera sees a point of the scene, on the film or up to its size beside it. Nothing: it
  // does not. Surfaces in between do not count.
  std::optional<Vec2> project(Vec3 p) const;

 private:
  Session(JobSettings settings, film::PixelFilter filter, std::unique_ptr<scene::Scene> scene,
          letters::Automaton automaton, letters::LayerRequest request, bool selects);

  JobSettings settings_;
  film::PixelFilter filter_;
  std::unique_ptr<scene::Scene> scene_;
  letters::Automaton automaton_;
  letters::LayerRequest request_;
  bool selects_;
  std::vector<std::uint32_t> object_of_name_, objects_of_name_;
};

}  // namespace candela::inspect
