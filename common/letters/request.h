// Layers of light path expressions that a job asks for, and their text in the job's settings.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::letters {

struct NamedExpression {
  std::string name, text;
  bool operator==(const NamedExpression&) const = default;
};

struct Region {
  enum class Kind { box, sphere };
  std::string name;
  Kind kind = Kind::box;
  std::array<double, 3> low{}, high{};  // a sphere has its center in low
  double radius = 0;                    // of a sphere
  bool operator==(const Region&) const = default;
};

inline constexpr std::size_t kMaxRegions = 8;
inline constexpr std::size_t kMaxRequestBytes = 16384;
inline constexpr double kDefaultGlossyBelow = 0.3;

struct LayerRequest {
  std::vector<NamedExpression> layers;
  std::vector<Region> regions;
  double glossy_below =
      kDefaultGlossyBelow;    // a finite lobe with a roughness alpha below it is G, others are D
  bool light_groups = false;  // a layer for each lamp: expand_light_groups()
  bool partition = false;     // each path must match exactly one layer

  bool empty() const { return layers.empty() && !light_groups; }  // nothing is asked for
  bool operator==(const LayerRequest&) const = default;
};

// Reads "layer NAME=EXPR; region NAME=box:x0,y0,z0,x1,y1,z1; region NAME=sphere:x,y,z,r; glossy-below 0.3;
// light-groups; partition", in any order. "" is empty. The result passes check(). Errors: input.
Result<LayerRequest> parse_layer_request(std::string_view text);
// As parse_layer_request() reads it. Precondition: check() passes.
std::string text_of(const LayerRequest& request);

// Adds "NAME=EXPR", or items as parse_layer_request() reads them. What the result may be is left to check().
Result<void> add_layers(std::string_view text, LayerRequest& request);
// "NAME=box:x0,y0,z0,x1,y1,z1" or "NAME=sphere:x,y,z,r"
Result<Region> parse_region(std::string_view text);
Result<double> parse_glossy_below(std::string_view text);

// All that can be checked without a scene: names, syntax, regions, numbers. Errors: input.
Result<void> check(const LayerRequest& request);

// Adds a layer light.NAME for each distinct name of a lamp, and clears light_groups. Characters that the name
// of a layer cannot have become '_', and equal names get a number. A request without light_groups stays as it
// is.
LayerRequest expand_light_groups(LayerRequest request, std::span<const std::string> lamp_names);

}  // namespace candela::letters
