// The plan of an integrator: techniques that run on a scene, and that are left out, with reasons (law 5).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace candela::integrators {

struct PlanItem {
  enum class Kind : std::uint8_t { use, skip, note };
  Kind kind = Kind::use;
  std::string technique;
  std::string reason;
};

struct Plan {
  std::vector<PlanItem> items;
  void use(std::string technique, std::string reason) {
    items.push_back({PlanItem::Kind::use, std::move(technique), std::move(reason)});
  }
  void skip(std::string technique, std::string reason) {
    items.push_back({PlanItem::Kind::skip, std::move(technique), std::move(reason)});
  }
  // A warning for the user, before the image is trusted.
  void note(std::string subject, std::string warning) {
    items.push_back({PlanItem::Kind::note, std::move(subject), std::move(warning)});
  }
  // Runs a technique that is wanted if it pays, and says why, or why not. Says nothing of one that is not
  // wanted.
  void decide(bool& technique, std::string_view name, bool pays, std::string_view why,
              std::string_view why_not) {
    if (!technique) return;
    technique = pays;
    if (pays)
      use(std::string(name), std::string(why));
    else
      skip(std::string(name), std::string(why_not));
  }
  void append(const Plan& other) { items.insert(items.end(), other.items.begin(), other.items.end()); }
  std::string to_text() const;
};

}  // namespace candela::integrators
