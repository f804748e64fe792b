#include "common/wire/stored_bundle.h"

#include "common/wire/wire.h"

namespace candela::wire {

Result<bundle::Bundle> parse_bundle(const std::string& bytes) {
  v1::Bundle message;
  if (!message.ParseFromString(bytes)) return input_error("not a bundle");
  return from_proto(message);
}

}  // namespace candela::wire
