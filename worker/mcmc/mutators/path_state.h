// A path of a chain in path space, with what its contribution and its mutations need. All of it follows from
// the path.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "worker/scene/scene.h"
#include "worker/transport/path/assemble.h"
#include "worker/transport/path/evaluation.h"
#include "worker/transport/path/mollified.h"
#include "worker/transport/path/path.h"

namespace candela::mcmc {

// The base of what a mutator keeps with a state.
struct Memo {
  virtual ~Memo() = default;
};

// A state that is copied shares what it stands on with the copy.
class PathState {
 public:
  transport::path::Path path;
  // By channel, in the product of area measures, delta functions of specular vertices left out. A light or
  // sensor that no ray meets has its own in the place of an area.
  std::array<double, 3> contribution{};
  double scalar = 0;  // its luminance, > 0 and finite
  std::optional<transport::path::MollifiedVertex> mollified;
  // Vertices from the light's end that are those of the state near which it was made.
  std::size_t shared_light = 0;

  const transport::path::Assembled& assembled() const { return stands_on_->assembled; }
  const transport::path::Evaluation& evaluation() const { return *stands_on_->evaluation; }

  // The T, a Memo, that `make()` makes for the owner (a std::unique_ptr<T>) when it is first asked for. It
  // has to follow from the path and the owner alone. Not for two threads at once.
  template <class T, class Make>
  const T& memo(const void* owner, const Make& make) const {
    StandsOn& kept = *stands_on_;
    for (std::size_t i = 0; i < std::min(kept.memo_count, kUsualMemos); ++i)
      if (kept.memos[i].first == owner) return static_cast<const T&>(*kept.memos[i].second);
    for (const auto& [of, memo] : kept.more_memos)
      if (of == owner) return static_cast<const T&>(*memo);
    std::unique_ptr<T> made = make();
    const T& result = *made;
    const std::size_t at = kept.memo_count++;
    if (at < kUsualMemos)
      kept.memos[at] = {owner, std::move(made)};
    else
      kept.more_memos.emplace_back(owner, std::move(made));
    return result;
  }

 private:
  friend std::optional<PathState> path_state(const scene::Scene& scene, transport::path::Path path,
                                             const transport::path::Rules& rules, const PathState* near,
                                             const transport::path::FoundSurfaces* found);
  using KeptMemo = std::pair<const void*, std::unique_ptr<Memo>>;  // and its owner
  static constexpr std::size_t kUsualMemos = 4;
  struct StandsOn {
    StandsOn() = default;
    StandsOn(const StandsOn&) = delete;
    StandsOn& operator=(const StandsOn&) = delete;
    transport::path::Assembled assembled;
    std::optional<transport::path::Evaluation> evaluation;  // of assembled.path
    std::array<KeptMemo, kUsualMemos> memos;
    std::vector<KeptMemo> more_memos;
    std::size_t memo_count = 0;
  };
  std::shared_ptr<StandsOn> stands_on_;
};

// Nothing: the path carries no light, it leaves the film, or its media are not homogeneous or not the same
// from both ends. film_border: pixels around the film that count
// as on it. near: a state of the same scene and rules, as the one that was mutated; what follows from
// vertices that both have is copied from it. The result is the same to the bit. found: as of assemble().
std::optional<PathState> path_state(const scene::Scene& scene, transport::path::Path path,
                                    const transport::path::Rules& rules = {}, const PathState* near = nullptr,
                                    const transport::path::FoundSurfaces* found = nullptr);

}  // namespace candela::mcmc
