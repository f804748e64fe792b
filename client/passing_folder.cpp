#include "client/passing_folder.h"

#include <stdlib.h>  // mkdtemp

#include <string>

namespace candela::client {

Result<PassingFolder> PassingFolder::make() {
  std::string path = (std::filesystem::temp_directory_path() / "candela-XXXXXX").string();
  if (::mkdtemp(path.data()) == nullptr)
    return resource_error("no folder can be made for the image").at(path, 0).with_mend("give -o FILE");
  PassingFolder folder;
  folder.path_ = path;
  return folder;
}

}  // namespace candela::client
