// Quantities as people write them in options, environment and configuration files of the servers.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace candela {

// "2", "2s", "0.5", "10m", "1h", "30d": seconds from 0 to 1e9; nothing else is one.
std::optional<double> parse_seconds(std::string_view text);

// "1000000", "512M", "2GiB": bytes with binary multiples K, M, G, T, from 1 to 2^63 - 1; nothing else is one.
std::optional<std::uint64_t> parse_bytes(std::string_view text);

// "0.01", "1%", "0", "100%": a share from 0 to 1; nothing else is one.
std::optional<double> parse_share(std::string_view text);

}  // namespace candela
