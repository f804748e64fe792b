// Places of the files of the tests. Only paths.cpp knows the folders of the checkout and of its build, so
// that the objects of all other tests are the same in every clone and ccache finds them.
#pragma once

#include <filesystem>
#include <string_view>

namespace candela::test {

// A file of the checkout; `file` is relative to its top.
std::filesystem::path source_path(std::string_view file);

// A file of the folder of programs, build/bin.
std::filesystem::path program_path(std::string_view name);

// ../shared beside the checkout, or $CANDELA_SHARED. It need not exist.
std::filesystem::path shared_path();

}  // namespace candela::test
