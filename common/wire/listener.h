// The user that listens on a port of this machine. Another user who binds a master's port while the master
// is away would be sent its token, and scenes.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/wire/address.h"

namespace candela::wire {

// The users that listen on a port of loopback, or of all addresses: `table` is the text of /proc/net/tcp or
// tcp6.
std::vector<uid_t> listeners(std::string_view table, int port);

// An error if on a loopback master's port somebody else listens than the owner of `token_file`, this user or
// root. Nothing where nobody listens, where there is no such file, and beyond loopback.
Result<void> check_listener(const Address& master, const std::filesystem::path& token_file);

}  // namespace candela::wire
