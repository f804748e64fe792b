// The contributions of one eye path by the labels of their paths, in the order in which they were summed.
//
// The image gets the rounded sum of a path. So that layers add up to the image to the last bit, each
// contribution's part is the difference of the rounded sums behind and before it, all rounded with the number
// that rounds the whole: the parts telescope to what the image gets, and each has the expectation of its
// contribution.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/film/unit_film.h"
#include "worker/core/vec.h"
#include "worker/transport/between.h"
#include "worker/transport/letters/path_letters.h"
#include "worker/transport/technique/contribution.h"

namespace candela::transport {

// A sum up to a contribution, that one included, and the labels of its path.
struct LabelledSum {
  Spectrum sum;
  ChannelLabels labels;
};

// Parts of one contribution that is known as a whole: merges at one vertex.
class LabelledParts {
 public:
  struct Part {
    ChannelLabels labels;
    Spectrum value;
  };
  void clear() { parts_.clear(); }
  void add(const ChannelLabels& labels, const Spectrum& value);
  std::span<const Part> parts() const { return parts_; }

 private:
  std::vector<Part> parts_;
};

// Units for each layer of a pixel, before they go to the film. They are gathered by label, over as many
// samples of the pixel as come one after another: most labels stand for several layers, and most pixels have
// few labels.
class LayerUnits {
 public:
  explicit LayerUnits(const PathLetters& letters)
      : letters_(letters), cells_(letters.label_count()), used_(letters.label_count()) {}

  // Gathers the parts of a value whose prefixes are `sums`, each times `weight`, rounded as the film does
  // with this key. Precondition: the film took the last of them.
  void gather(std::span<const LabelledSum> sums, float weight, const film::UnitFilm& film, std::uint64_t key);
  // Adds what is gathered to a pixel of the film, in the layers of expressions from number `offset` on.
  void write(film::UnitFilm& film, std::uint32_t x, std::uint32_t y, std::uint32_t offset = 0);
  std::uint32_t layer_count() const { return letters_.layer_count(); }

 private:
  using Units = std::array<std::int64_t, kColors>;
  struct Cell {
    Units units{};
    bool used = false;
  };
  Cell& use(letters::Automaton::Label label) {
    Cell& cell = cells_[label];
    if (!cell.used) {
      cell.used = true;
      used_[used_count_++] = label;
    }
    return cell;
  }

  const PathLetters& letters_;
  std::vector<Cell> cells_;                      // by label
  std::vector<letters::Automaton::Label> used_;  // the first used_count_
  std::size_t used_count_ = 0;
  bool wrapped_ = false;
};

// Adds units of one contribution to a pixel of the film, in the layers of its labels.
void splat_labelled(const PathLetters& letters, const ChannelLabels& labels,
                    const std::array<std::int64_t, kColors>& units, film::UnitFilm& film, std::uint32_t x,
                    std::uint32_t y);

class LayerSums {
 public:
  explicit LayerSums(const PathLetters& letters) : letters_(letters), units_(letters) {}
  const PathLetters& letters() const { return letters_; }

  // A path is next.
  void clear() { sums_.clear(); }
  // sum: of the path, with the contribution. Parts of one label that follow each other are one part: their
  // differences telescope.
  void add(const Spectrum& sum, const ChannelLabels& labels) {
    if (!sums_.empty() && sums_.back().labels == labels)
      sums_.back().sum = sum;
    else
      sums_.push_back({sum, labels});
  }
  // Adds a contribution in parts, each times `factor`; the parts lead from `before` to `sum` but for
  // rounding.
  void add(const Spectrum& before, const Spectrum& sum, const LabelledParts& parts, const Spectrum& factor);
  void scale(float factor) {
    for (LabelledSum& part : sums_) part.sum *= factor;
  }
  std::span<const LabelledSum> sums() const { return sums_; }

  // The path's radiance times `weight` went to the image with this key, and the film took it. offset: as
  // LayerUnits::write.
  void write(film::UnitFilm& film, std::uint32_t x, std::uint32_t y, float weight, std::uint64_t key,
             std::uint32_t offset = 0) {
    gather(film, weight, key);
    write_gathered(film, x, y, offset);
  }
  // The same in two steps: the second for all paths of a pixel at once.
  void gather(const film::UnitFilm& film, float weight, std::uint64_t key) {
    units_.gather(sums_, weight, film, key);
  }
  void write_gathered(film::UnitFilm& film, std::uint32_t x, std::uint32_t y, std::uint32_t offset = 0) {
    units_.write(film, x, y, offset);
  }

 private:
  const PathLetters& letters_;
  std::vector<LabelledSum> sums_;
  LayerUnits units_;
};

// True if kernels of this form read the letters: only kernels for media know of letters, so that the
// other kernels stay as they are. Null: the job has no expressions.
template <EdgeContent kEdgeContent>
constexpr bool reads_letters([[maybe_unused]] const void* letters) {
  if constexpr (kEdgeContent == EdgeContent::media) return letters != nullptr;
  return false;
}

// Names of the draws of a path's letters, one after another. A draw's number is made only if it is read: most
// surfaces have one lobe, most scenes one environment.
class LetterKeys {
 public:
  class Key {
   public:
    Key(LetterKeys& keys, std::uint32_t number) : keys_(keys), number_(number) {}
    operator std::uint64_t() const { return keys_.at(number_); }  // NOLINT: as a number, if it is read

   private:
    LetterKeys& keys_;
    std::uint32_t number_;
  };

  // A path along this ray. key: names it, but for a chain's, whose ray names it.
  void begin(std::uint64_t key, const Ray& ray) {
    path_ = key;
    direction_ = ray.direction;
    named_ = 0;
    made_ = kNone;
  }
  Key next() { return {*this, ++named_}; }

 private:
  static constexpr std::uint32_t kNone = ~0u;
  std::uint64_t at(std::uint32_t number);

  std::uint64_t path_ = 0, value_ = 0;
  Vec3 direction_;
  std::uint32_t named_ = 0;
  std::uint32_t made_ = kNone;  // the number whose value is value_
};

// An eye path under way: the states of its tokens so far, and its contributions. Its functions are no part of
// the kernels, whose size decides what the compiler makes inline in them.
class EyeLetters {
 public:
  explicit EyeLetters(const PathLetters& letters) : letters_(letters), sums_(letters) {}

  // A path along this ray, with the key of LetterKeys.
  void begin(std::uint64_t key, const Ray& ray) {
    sums_.clear();
    states_ = letters_.at_eye();
    keys_.begin(key, ray);
  }
  // For the next draw between lobes.
  LetterKeys::Key next_key() { return keys_.next(); }

  const PathLetters& letters() const { return letters_; }
  const ChannelStates& states() const { return states_; }
  LayerSums& sums() { return sums_; }
  // The walk left v along wi; likewise a surface, by a delta lobe or another; a vertex in a medium.
  void scattered(const ScatterPoint& v, Vec3 wi);
  void scattered(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi, bool delta);
  void scattered(std::uint32_t medium, Vec3 p);

  // Contributions, `sum` being that of the path with them: light met at its end, on a surface or outside
  // looking along d.
  void met(const Spectrum& sum, std::uint32_t emitter);
  void met_outside(const Spectrum& sum, Vec3 d);
  void met(const Spectrum& sum, const ScatterPoint& v, bool left);
  // y is connected to the vertex z of a light path whose states before z are `before`.
  void connected(const Spectrum& sum, const ScatterPoint& y, const ScatterPoint& z,
                 const ChannelStates& before);
  // Next event estimation found it, at v, at a surface, at a vertex in a medium.
  void lit(const Spectrum& sum, const ScatterPoint& v, const Towards& light);
  void lit(const Spectrum& sum, const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo,
           const Towards& light);
  void lit(const Spectrum& sum, std::uint32_t medium, Vec3 p, const Towards& light);

 private:
  void step(const ChannelClasses& token) { states_ = letters_.from_eye(states_, token); }
  void add(const Spectrum& sum, const ChannelClasses& token, const ChannelStates& light) {
    sums_.add(sum, letters_.labels(light, letters_.from_eye(states_, token)));
  }

  const PathLetters& letters_;
  LayerSums sums_;
  ChannelStates states_;
  LetterKeys keys_;
};

// Letters of eye paths for kernels that read them, if `letters` is given.
template <EdgeContent kEdgeContent>
std::optional<EyeLetters> eye_letters(const PathLetters* letters) {
  if (!reads_letters<kEdgeContent>(letters)) return std::nullopt;
  return std::optional<EyeLetters>(std::in_place, *letters);
}

// A light path under way.
class LightLetters {
 public:
  explicit LightLetters(const PathLetters& letters) : letters_(letters) {}
  // The light left along its ray. key: names the path.
  void begin(const scene::EmissionSample& light, std::uint64_t key);
  const PathLetters& letters() const { return letters_; }
  // Before the vertex at hand.
  const ChannelStates& states() const { return states_; }
  void scattered(const ScatterPoint& v, Vec3 wi);
  // Labels of a path that ends at the lens: v is connected to the lens along wi, or the walk met the lens.
  ChannelLabels connected(const ScatterPoint& v, Vec3 wi);
  ChannelLabels met_lens() const { return letters_.labels(states_, letters_.at_eye()); }

 private:
  const PathLetters& letters_;
  ChannelStates states_;
  LetterKeys keys_;
};

}  // namespace candela::transport
