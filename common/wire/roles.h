// Permissions of callers of the master. docs/decisions/077-roles.md
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

namespace candela::wire {

enum class Role : std::uint8_t {
  worker,   // leases units and delivers them
  submit,   // submits jobs and steers its own; includes `read`
  operate,  // steers everybody's jobs and workers; includes `submit`
  read,     // sees jobs, images and workers
};
std::string_view name(Role role);
std::optional<Role> role_of(std::string_view word);

class Roles {
 public:
  constexpr Roles() = default;
  constexpr Roles(std::initializer_list<Role> roles) {
    for (const Role role : roles) add(role);
  }
  static constexpr Roles all() { return {Role::worker, Role::submit, Role::operate, Role::read}; }
  constexpr void add(Role role) { bits_ |= bit(role); }
  constexpr bool empty() const { return bits_ == 0; }
  constexpr bool has(Role role) const { return (bits_ & bit(role)) != 0; }
  // True if these roles, with the ones they include, have `role`.
  constexpr bool allow(Role role) const {
    if (has(role)) return true;
    if (role == Role::submit) return has(Role::operate);
    return role == Role::read && (has(Role::submit) || has(Role::operate));
  }
  // "submit and read"; "no role".
  std::string text() const;
  friend constexpr bool operator==(Roles, Roles) = default;

 private:
  static constexpr unsigned bit(Role role) { return 1U << static_cast<unsigned>(role); }
  unsigned bits_ = 0;
};

// Roles stand in a certificate as URIs of its subjectAltName: "candela:role/submit".
inline constexpr std::string_view kRoleUri = "candela:role/";
std::string role_uri(Role role);
// Adds the role that a URI names; other URIs name none.
void add_role_of_uri(Roles& roles, std::string_view uri);

}  // namespace candela::wire
