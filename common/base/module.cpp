#include "common/base/module.h"

#include <dlfcn.h>

#include <filesystem>
#include <string>
#include <system_error>

namespace candela {
namespace {

namespace fs = std::filesystem;

std::string file_name(const char* name) {
  return std::string("candela-") + name + ".so";
}

Error module_error(const std::string& message, const char* name, const fs::path& folder) {
  return failed_error(message).with_mend("install " + file_name(name) + " of this version into " +
                                         folder.string() + " or " +
                                         (folder.parent_path() / "lib/candela").string());
}

Result<fs::path> program_folder() {
  std::error_code code;
  const fs::path program = fs::read_symlink("/proc/self/exe", code);
  if (code) return failed_error("cannot tell where the program lies: " + code.message());
  return program.parent_path();
}

// Empty if the module is neither beside the program nor in its lib/candela.
fs::path find_module(const char* name, const fs::path& folder) {
  std::error_code code;
  for (const fs::path& place : {folder, folder.parent_path() / "lib/candela"})
    if (fs::exists(place / file_name(name), code)) return place / file_name(name);
  return {};
}

}  // namespace

Result<void*> load_from_module(const char* name, const char* function) {
  CANDELA_ASSIGN(const fs::path folder, program_folder());
  fs::path path = find_module(name, folder);
  if (path.empty()) path = file_name(name);  // without a folder: where the dynamic linker looks
  void* const module = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (module == nullptr) return module_error(std::string("cannot load a module: ") + dlerror(), name, folder);
  void* const found = dlsym(module, function);
  if (found == nullptr)
    return module_error(path.string() + " is of another version, without " + function, name, folder);
  return found;
}

Result<void> check_module(const char* name) {
  CANDELA_ASSIGN(const fs::path folder, program_folder());
  if (!find_module(name, folder).empty()) return {};
  if (void* const module = dlopen(file_name(name).c_str(), RTLD_NOW | RTLD_LOCAL); module != nullptr)
    return {};
  return module_error(file_name(name) + " is missing", name, folder);
}

}  // namespace candela
