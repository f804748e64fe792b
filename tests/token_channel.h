// Channels to a master of the test on loopback, by the token that the master made in its data folder.
#pragma once

#include <grpcpp/grpcpp.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include "common/wire/token.h"

namespace candela::test {

inline std::shared_ptr<grpc::Channel> token_channel(const std::string& address,
                                                    const std::filesystem::path& data_folder,
                                                    const grpc::ChannelArguments& arguments = {}) {
  return wire::token_channel(address, grpc::InsecureChannelCredentials(), arguments, data_folder / "token");
}

// By the file that $CANDELA_TOKEN_FILE names.
inline std::shared_ptr<grpc::Channel> token_channel_by_environment(
    const std::string& address, const grpc::ChannelArguments& arguments = {}) {
  const char* file = std::getenv("CANDELA_TOKEN_FILE");
  return wire::token_channel(address, grpc::InsecureChannelCredentials(), arguments,
                             file != nullptr ? file : "");
}

}  // namespace candela::test
