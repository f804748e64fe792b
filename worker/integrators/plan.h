// What an integrator will do with a scene, and what it leaves out, each with the reason (law 5).
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace candela::integrators {

struct PlanItem {
  std::string technique;
  bool used = false;
  std::string reason;
};

struct Plan {
  std::vector<PlanItem> items;
  void use(std::string technique, std::string reason) {
    items.push_back({std::move(technique), true, std::move(reason)});
  }
  void skip(std::string technique, std::string reason) {
    items.push_back({std::move(technique), false, std::move(reason)});
  }
  std::string to_text() const;
};

}  // namespace candela::integrators
