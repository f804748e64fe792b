// Calls of libpng, which leaves by longjmp where it fails.
#pragma once

#include <png.h>

#include <array>
#include <csetjmp>
#include <cstdio>

namespace candela::image {

class PngCalls {
 public:
  PngCalls() = default;
  PngCalls(const PngCalls&) = delete;
  PngCalls& operator=(const PngCalls&) = delete;

 protected:
  ~PngCalls() = default;
  // Calls `body`, which must own nothing. False if libpng failed: message() says why.
  template <class Body>
  bool guarded(const Body& body) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;  // NOLINT: as libpng has it
    body();
    return true;
  }
  const char* message() const { return message_.data(); }

  // For png_create_read_struct() and png_create_write_struct(), with this object as their error_ptr.
  static void on_error(png_structp png, png_const_charp why) {
    auto* const self = static_cast<PngCalls*>(png_get_error_ptr(png));
    std::snprintf(self->message_.data(), self->message_.size(), "%s", why);
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp, png_const_charp) {}

  png_structp png_ = nullptr;
  png_infop info_ = nullptr;

 private:
  std::array<char, 256> message_{};
};

}  // namespace candela::image
