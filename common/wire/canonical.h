// A message as bytes that do not depend on the order of map entries: for digests, and for files that are
// compared.
#pragma once

#include <string>

namespace google::protobuf {
class Message;
}

namespace candela::wire {

std::string canonical(const google::protobuf::Message& message);

}  // namespace candela::wire
