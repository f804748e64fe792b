#include "common/wire/roles.h"

#include <array>

#include "common/base/enum_names.h"

namespace candela::wire {
namespace {

constexpr std::array kAll = {Role::worker, Role::submit, Role::operate, Role::read};

}  // namespace

std::string_view name(Role role) {
  return name_of_value<Role::read>({"worker", "submit", "operate", "read"}, role, "");
}

std::optional<Role> role_of(std::string_view word) {
  for (const Role role : kAll)
    if (name(role) == word) return role;
  return std::nullopt;
}

std::string Roles::text() const {
  std::string text;
  for (const Role role : kAll) {
    if (!has(role)) continue;
    if (!text.empty()) text += " and ";
    text += name(role);
  }
  return text.empty() ? "no role" : text;
}

std::string role_uri(Role role) {
  return std::string(kRoleUri).append(name(role));
}

void add_role_of_uri(Roles& roles, std::string_view uri) {
  if (!uri.starts_with(kRoleUri)) return;
  if (const auto role = role_of(uri.substr(kRoleUri.size()))) roles.add(*role);
}

}  // namespace candela::wire
