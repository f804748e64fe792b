// The files of the page (master/http/page), which the build puts into the program.
#pragma once

#include <span>
#include <string_view>

namespace candela::master {

struct PageFile {
  std::string_view name, bytes, etag;
};
std::span<const PageFile> page_files();

}  // namespace candela::master
