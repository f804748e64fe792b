// From objects with named references to the finished graph.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description {

// A child as written: an object in place, or a reference.
struct Link {
  std::string slot;
  Location where;
  std::size_t target = 0;  // index of the draft, for an object in place
  bool is_reference = false;
  std::string id;  // of a reference
  // A property of the slot's name stands before the link, or after it: the later one counts of a texture.
  bool after_property = false, before_property = false;
};

struct Draft {
  std::shared_ptr<Object> object;  // properties complete and checked, no children yet
  std::vector<Link> links;
  bool stands_in = false;  // for a plugin that nobody knows: children that do not fit are left out
  bool left_out = false;   // so are links to this
  bool legacy = false;     // written in a file before version 2
  std::optional<std::size_t> given_way = {};  // an integrator that runs in its place
  std::size_t repeated = 0;                   // parameters that were given again
  bool broken = false;                        // an error within was told: whether it is complete nobody knows

  // The names of the parameters that are links.
  std::vector<std::string_view> slots() const {
    std::vector<std::string_view> names;
    for (const Link& link : links) names.emplace_back(link.slot);
    return names;
  }
};

// A lookup in a texture looks up those that it is made of; one that is referred to twice, twice.
inline constexpr std::uint64_t max_texture_unfolded = 10'000;

// Way in which the drafts are joined.
struct Joining {
  // Textures and volumes for unknown parameters, and what does not fit into an object that stands in for
  // another, are left out; else they are errors.
  bool lenient = false;
  std::vector<Note>& passed_over;        // gets what was left out
  std::vector<Error>* errors = nullptr;  // if all are wanted: those so far
};

// Fills in the children of all drafts and checks them. Errors: unknown ids (naming the
// nearest), references that lead back to themselves, nesting deeper than 128 with references followed, bsdfs
// and other parts of surfaces and media that would unfold into more than 20 million objects, and textures
// beyond max_texture_unfolded. What a scene or a shape refers to is built once, however often that is.
Result<ObjectPtr> resolve(std::vector<Draft>& drafts, std::size_t root,
                          const std::map<std::string, std::size_t, std::less<>>& ids, const Joining& joining);

// Puts the error among `errors`, if there is room. False: the reading ends with it.
bool collect(std::vector<Error>* errors, const Error& error);

// The note that tells of something passed over, made of the error that it would be.
Note passed_over_note(const Error& error);

}  // namespace candela::description
