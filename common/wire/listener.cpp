#include "common/wire/listener.h"

#include <fmt/format.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <charconv>
#include <fstream>
#include <sstream>
#include <string>

namespace candela::wire {
namespace {

constexpr std::string_view kListening = "0A";

// An address of the kernel's tables: words in hex, each with its bytes turned around.
bool is_loopback_or_any(std::string_view address) {
  if (address.find_first_not_of('0') == std::string_view::npos) return true;
  if (address.size() == 8) return address.ends_with("7F");
  return address == "00000000000000000000000001000000" ||
         (address.starts_with("0000000000000000FFFF0000") && address.ends_with("7F"));
}

std::string user_name(uid_t user) {
  const passwd* entry = ::getpwuid(user);
  return entry != nullptr ? entry->pw_name : std::to_string(user);
}

}  // namespace

std::vector<uid_t> listeners(std::string_view table, int port) {
  std::vector<uid_t> users;
  std::istringstream lines{std::string(table)};
  std::string line;
  std::getline(lines, line);  // names of columns
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    std::string slot, local, remote, state, queues, timer, retransmits;
    uid_t user = 0;
    if (!(words >> slot >> local >> remote >> state >> queues >> timer >> retransmits >> user)) continue;
    const std::size_t colon = local.find(':');
    if (state != kListening || colon == std::string::npos) continue;
    int number = 0;
    std::from_chars(local.data() + colon + 1, local.data() + local.size(), number, 16);
    if (number == port && is_loopback_or_any(std::string_view(local).substr(0, colon))) users.push_back(user);
  }
  return users;
}

Result<void> check_listener(const Address& master, const std::filesystem::path& token_file) {
  struct stat facts {};
  if (!master.loopback || ::stat(token_file.c_str(), &facts) != 0) return {};
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream in(table);
    std::ostringstream text;
    text << in.rdbuf();
    for (const uid_t user : listeners(text.str(), master.port))
      if (user != facts.st_uid && user != ::geteuid() && user != 0)
        return refused_error(fmt::format("user '{}' listens on {}, and the token for it is of user '{}'",
                                         user_name(user), master.text(), user_name(facts.st_uid)))
            .at(token_file.string(), 0)
            .with_mend(
                "start your own master on another port; for a master of that user give --token-file with a "
                "copy of its token");
  }
  return {};
}

}  // namespace candela::wire
