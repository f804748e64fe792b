// Film layers of bdpt's techniques: which layer a path made of s and t vertices goes to.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace candela::integrators::bdpt {

class TechniqueLayers {
 public:
  TechniqueLayers() = default;
  // Layers of paths of up to `depth` edges; lens: techniques with t = 0 exist.
  TechniqueLayers(bool weighted, bool unweighted, std::uint32_t depth, std::uint32_t max_depth, bool lens);

  bool any() const { return !names_.empty(); }
  const std::vector<std::string>& names() const { return names_; }

  static constexpr std::uint32_t kNoLayer = 0;  // the image's own
  std::uint32_t weighted(std::uint32_t s, std::uint32_t t) const { return find(weighted_, s, t); }
  // A layer of all mollified paths, after all others.
  void add_mollified();
  std::uint32_t mollified() const { return mollified_; }
  std::uint32_t unweighted(std::uint32_t s, std::uint32_t t) const { return find(unweighted_, s, t); }

 private:
  // Layer numbers by [depth - 1][s]; longer paths share the last entry.
  struct Table {
    std::vector<std::vector<std::uint32_t>> layers;
    std::uint32_t deeper = kNoLayer;
  };
  std::uint32_t find(const Table& table, std::uint32_t s, std::uint32_t t) const {
    const std::uint32_t depth = s + t - 1;
    return depth <= table.layers.size() ? table.layers[depth - 1][s] : table.deeper;
  }
  Table make_table(const std::string& kind, std::uint32_t depth, bool deeper, bool lens);

  std::vector<std::string> names_;
  Table weighted_, unweighted_;
  std::uint32_t mollified_ = kNoLayer;
};

}  // namespace candela::integrators::bdpt
