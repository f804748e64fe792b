// The token of a master without TLS. It lies in a file that only the master's user can read, and each call
// carries it. docs/decisions/077-roles.md
#pragma once

#include <grpcpp/grpcpp.h>
#include <grpcpp/support/client_interceptor.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/wire/address.h"

namespace candela::wire {

// The field of a call's metadata.
inline constexpr const char* kTokenField = "candela-token";

// 64 random hexadecimal digits.
Result<std::string> random_token();
// The token in the file, which is made, with mode 0600, if it is not there.
Result<std::string> make_token_file(const std::filesystem::path& file);
// Errors: it cannot be read, every user of the machine can read it, it has fewer than 16 printable characters
// beside white space.
Result<std::string> read_token_file(const std::filesystem::path& file);

// Place where programs of this user look for the token of the master at an address:
// ~/.local/state/candela/masters/HOST-PORT.token. Nothing: this user has no home.
std::optional<std::filesystem::path> published_token_file(const Address& master);
// Writes the token there, with mode 0600.
Result<void> publish_token(const std::string& token, const std::filesystem::path& file);

// In a time that does not tell where they differ.
bool same_token(std::string_view a, std::string_view b);

// A channel whose calls carry the token of `file`. The file is read at each call: it may come after the
// channel. Without a file calls go without a token, and a master refuses them. With `listener`, calls go
// without a token as well while check_listener() finds somebody else there.
std::shared_ptr<grpc::Channel> token_channel(const std::string& target,
                                             const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                                             const grpc::ChannelArguments& arguments,
                                             const std::filesystem::path& file,
                                             const std::optional<Address>& listener = std::nullopt);

// Credentials that make each call of a channel carry `token`.
std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> token_interceptors(
    std::string token);

// "user@host" of this process, for people.
std::string user_at_host();

}  // namespace candela::wire
