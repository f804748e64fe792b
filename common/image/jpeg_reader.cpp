#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <utility>
#include <vector>

// clang-format off
#include <jpeglib.h>  // after <cstdio>, which it needs
#include <jerror.h>
// clang-format on

#include "common/image/exif.h"
#include "common/image/jpeg.h"
#include "common/image/row_reader.h"

namespace candela::image {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 16;
// A file of a few bytes can ask for any number of passes over a large image.
constexpr int kMaxScans = 500;
constexpr std::array<unsigned char, 6> kExif{'E', 'x', 'i', 'f', 0, 0};

// The structures of libjpeg, which calls back with them. They are the first member of each.
struct Errors {
  jpeg_error_mgr library{};
  std::jmp_buf leave{};
  std::array<char, JMSG_LENGTH_MAX> message{};
  bool source_ended = false;
};
struct Source {
  jpeg_source_mgr library{};
  ByteSource* bytes = nullptr;
  std::uint64_t at = 0;
  std::array<JOCTET, kBufferBytes> buffer{};
};

Errors& errors_of(j_common_ptr call) {
  return *reinterpret_cast<Errors*>(call->err);
}
Source& source_of(j_decompress_ptr call) {
  return *reinterpret_cast<Source*>(call->src);
}

[[noreturn]] void leave(j_common_ptr call, const char* why) {
  Errors& errors = errors_of(call);
  std::snprintf(errors.message.data(), errors.message.size(), "%s", why);
  std::longjmp(errors.leave, 1);
}
[[noreturn]] void on_error(j_common_ptr call) {
  Errors& errors = errors_of(call);
  call->err->format_message(call, errors.message.data());
  std::longjmp(errors.leave, 1);
}
// Warnings are of bytes that do not matter, but for this one: the decoder goes on in gray.
void on_message(j_common_ptr call, int level) {
  if (level < 0 && call->err->msg_code == JWRN_HIT_MARKER && errors_of(call).source_ended)
    leave(call, "the file ends too early");
}
void on_output(j_common_ptr /*call*/) {}
void on_progress(j_common_ptr call) {
  if (reinterpret_cast<j_decompress_ptr>(call)->input_scan_number > kMaxScans)
    leave(call, "the file has more than 500 scans");
}

void on_begin(j_decompress_ptr /*call*/) {}
// Behind its end a file has the mark of the end: some lack it, and are whole without.
boolean on_fill(j_decompress_ptr call) {
  Source& source = source_of(call);
  std::size_t count =
      static_cast<std::size_t>(std::min<std::uint64_t>(kBufferBytes, source.bytes->size() - source.at));
  if (count == 0) {
    errors_of(reinterpret_cast<j_common_ptr>(call)).source_ended = true;
    source.buffer[count++] = 0xff;
    source.buffer[count++] = JPEG_EOI;
  } else {
    if (!source.bytes->read(source.at, count, source.buffer.data()))
      leave(reinterpret_cast<j_common_ptr>(call), "the file cannot be read");
    source.at += count;
  }
  source.library.next_input_byte = source.buffer.data();
  source.library.bytes_in_buffer = count;
  return TRUE;
}
void on_skip(j_decompress_ptr call, long count) {
  Source& source = source_of(call);
  if (count <= 0) return;
  const auto wanted = static_cast<std::uint64_t>(count);
  const std::uint64_t here = std::min<std::uint64_t>(wanted, source.library.bytes_in_buffer);
  source.library.next_input_byte += here;
  source.library.bytes_in_buffer -= static_cast<std::size_t>(here);
  source.at += std::min(wanted - here, source.bytes->size() - source.at);
}

class JpegReader final : public RowReader {
 public:
  explicit JpegReader(std::unique_ptr<ByteSource> bytes) : bytes_(std::move(bytes)) {}
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;
  ~JpegReader() override { jpeg_destroy_decompress(&call_); }

  // Reads the file up to its pixels, anew.
  bool open();

 private:
  const void* row_at(int y) override;
  // Calls `body`, which must own nothing. False if libjpeg failed.
  template <class Body>
  bool guarded(const Body& body) {
    if (setjmp(errors_.leave) != 0) return fail(errors_.message.data());  // NOLINT: as libjpeg has it
    body();
    return true;
  }
  void set_up();
  void describe();

  std::unique_ptr<ByteSource> bytes_;
  Errors errors_;
  Source source_;
  jpeg_progress_mgr progress_{};
  jpeg_decompress_struct call_{};
  bool started_ = false;
  int next_row_ = 0;
  std::vector<JSAMPLE> row_;
};

void JpegReader::set_up() {
  call_.err = jpeg_std_error(&errors_.library);
  errors_.library.error_exit = on_error;
  errors_.library.emit_message = on_message;
  errors_.library.output_message = on_output;
  jpeg_create_decompress(&call_);
  source_.library.init_source = on_begin;
  source_.library.fill_input_buffer = on_fill;
  source_.library.skip_input_data = on_skip;
  source_.library.resync_to_restart = jpeg_resync_to_restart;
  source_.library.term_source = on_begin;
  source_.bytes = bytes_.get();
  call_.src = &source_.library;
  progress_.progress_monitor = on_progress;
  call_.progress = &progress_;
  jpeg_save_markers(&call_, JPEG_APP0 + 1, 0xffff);
}

bool JpegReader::open() {
  jpeg_destroy_decompress(&call_);
  call_ = {};
  source_.at = 0;
  source_.library = {};
  errors_.source_ended = false;
  started_ = false;
  next_row_ = 0;
  if (!guarded([this] {
        set_up();
        jpeg_read_header(&call_, TRUE);
      }))
    return false;
  if (call_.num_components != 1 && call_.num_components != 3)
    return fail(call_.num_components == 4 ? "it holds four inks (CMYK), not colors: save it as RGB"
                                          : "it has neither one component nor three");
  call_.out_color_space = call_.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
  describe();
  return true;
}

void JpegReader::describe() {
  spec_ = {};
  spec_.width = spec_.display_width = static_cast<int>(call_.image_width);
  spec_.height = spec_.display_height = static_cast<int>(call_.image_height);
  spec_.channels =
      call_.num_components == 1 ? std::vector<std::string>{"Y"} : std::vector<std::string>{"R", "G", "B"};
  spec_.is_uint8 = true;
  spec_.sample_bytes = 1;
  spec_.image_bytes = std::uint64_t{call_.image_width} * call_.image_height * spec_.channels.size();
  for (jpeg_saved_marker_ptr marker = call_.marker_list; marker != nullptr; marker = marker->next) {
    if (marker->data_length < kExif.size() || !std::equal(kExif.begin(), kExif.end(), marker->data)) continue;
    spec_.orientation = exif_orientation(marker->data + kExif.size(), marker->data_length - kExif.size());
    break;
  }
  row_.resize(std::size_t{call_.image_width} * spec_.channels.size());
}

const void* JpegReader::row_at(int y) {
  if (y < next_row_ && !open()) return nullptr;
  if (!started_ && !guarded([this] { jpeg_start_decompress(&call_); })) return nullptr;
  started_ = true;
  JSAMPROW row = row_.data();
  for (; next_row_ <= y; ++next_row_)
    if (!guarded([this, &row] { jpeg_read_scanlines(&call_, &row, 1); })) return nullptr;
  return row_.data();
}

}  // namespace

std::unique_ptr<ImageReader> open_jpeg(std::unique_ptr<ByteSource> source, std::string& error) {
  auto reader = std::make_unique<JpegReader>(std::move(source));
  if (reader->open()) return reader;
  error = reader->error();
  return nullptr;
}

std::string jpeg_library() {
  constexpr int kVersion = LIBJPEG_TURBO_VERSION_NUMBER;  // three digits each
  return "libjpeg-turbo " + std::to_string(kVersion / 1000000) + "." +
         std::to_string(kVersion / 1000 % 1000) + "." + std::to_string(kVersion % 1000);
}

}  // namespace candela::image
