// Text from peers, files and command lines: whether it is UTF-8, and how it is shown.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace candela {

// Length in bytes of the UTF-8 sequence at the front of `text`, which is not empty; 0 if there is none (RFC
// 3629: no surrogates, nothing overlong).
std::size_t utf8_length(std::string_view text);
bool is_utf8(std::string_view text);

// At most `max_bytes` of the front of `text`, not cut inside a UTF-8 sequence.
std::string_view clip_utf8(std::string_view text, std::size_t max_bytes);

// For messages: in single quotes, control characters and invalid UTF-8 as '?', cut after 80 bytes.
std::string quote(std::string_view text);

// One line that shows what is there and does nothing to a terminal. Control characters (C0, DEL, C1), line
// and paragraph separators, and characters that have no shape but change how others are shown (bidirectional
// controls, joiners, tags) become escapes: "\n", "\t", "\r", "\x1b", "\u202e", "\U000e0041". A byte that is
// not UTF-8 becomes "\xff". All else stays, backslashes too, so that escaping twice is escaping once.
std::string escape_unprintable(std::string_view text);

// The same for a text in JSON: what JSON itself would pass raw of the above becomes JSON's "\u202e". White
// space between values stays. Precondition: `json` is valid JSON in UTF-8.
std::string escape_json_unprintable(std::string_view json);

}  // namespace candela
