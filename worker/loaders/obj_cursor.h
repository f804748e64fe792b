// The words of a piece of a Wavefront OBJ file, with lines that go on behind a backslash.
#pragma once

#include <cstddef>
#include <cstring>
#include <string_view>

namespace candela::loaders {

class ObjCursor {
 public:
  explicit ObjCursor(std::string_view bytes) : at_(bytes.data()), end_(bytes.data() + bytes.size()) {}

  bool at_end() const { return at_ == end_; }
  bool at_line_end() const { return at_ == end_ || *at_ == '\n' || *at_ == '#'; }
  char peek() const { return *at_; }
  const char* place() const { return at_; }
  const char* end() const { return end_; }
  // Precondition: `place` is not before place(), and no line end lies between.
  void move_to(const char* place) { at_ = place; }
  std::size_t line_ends() const { return line_ends_; }

  // Blanks, carriage returns, and line ends that a backslash takes away.
  void skip_blanks() {
    while (at_ < end_) {
      if (*at_ == ' ' || *at_ == '\t' || *at_ == '\r' || *at_ == '\v' || *at_ == '\f') {
        ++at_;
      } else if (*at_ == '\\' && end_ - at_ >= 2 && at_[1] == '\n') {
        at_ += 2;
        ++line_ends_;
      } else if (*at_ == '\\' && end_ - at_ >= 3 && at_[1] == '\r' && at_[2] == '\n') {
        at_ += 3;
        ++line_ends_;
      } else {
        break;
      }
    }
  }

  // The rest of a line; a continued line is skipped whole, a comment cannot be continued.
  void skip_line() {
    while (at_ < end_ && *at_ != '\n') {
      if (*at_ == '\\') {
        const char* before = at_;
        skip_blanks();
        if (at_ == before) ++at_;
      } else if (*at_ == '#') {
        const void* stop = std::memchr(at_, '\n', static_cast<std::size_t>(end_ - at_));
        at_ = stop != nullptr ? static_cast<const char*>(stop) : end_;
      } else {
        ++at_;
      }
    }
    if (at_ < end_) {
      ++at_;
      ++line_ends_;
    }
  }

  // The same where there is no backslash.
  void skip_plain_line() {
    const void* stop = std::memchr(at_, '\n', static_cast<std::size_t>(end_ - at_));
    if (stop == nullptr) {
      at_ = end_;
      return;
    }
    at_ = static_cast<const char*>(stop) + 1;
    ++line_ends_;
  }

  // Without blanks at its ends; the cursor stays.
  std::string_view rest_of_line() const {
    constexpr std::string_view blanks = " \t\r\v\f";
    std::string_view rest(at_, static_cast<std::size_t>(end_ - at_));
    rest = rest.substr(0, rest.find('\n'));
    const std::size_t begin = rest.find_first_not_of(blanks);
    return begin == rest.npos ? std::string_view()
                              : rest.substr(begin, rest.find_last_not_of(blanks) + 1 - begin);
  }

  std::string_view token() {
    const char* begin = at_;
    while (at_<end_&& static_cast<unsigned char>(*at_)> ' ' && *at_ != '#' && *at_ != '\\') ++at_;
    if (at_ == begin && at_ < end_ && static_cast<unsigned char>(*at_) < ' ' && *at_ != '\n') ++at_;
    return {begin, static_cast<std::size_t>(at_ - begin)};
  }

 private:
  const char* at_;
  const char* end_;
  std::size_t line_ends_ = 0;
};

}  // namespace candela::loaders
