// The files that a scene names: where they are looked for, which of them were used, and how much was read.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/unpacked_files.h"
#include "common/description/xml_document.h"

namespace candela::description {

class SceneFiles {
 public:
  // `files` must outlive this.
  SceneFiles(const UnpackedFiles& files, const std::string& main_key);

  // The XML document of this key. Its bytes count as often as it is read.
  Result<std::unique_ptr<XmlDocument>> document(const std::string& key);

  // The key of a file named in the scene, found and readable: in the <path> folders, the last one first, then
  // in the main scene file's folder, then in the folder of the XML file `from` that names it.
  Result<std::string> find(const std::string& from, const Location& where, std::string_view name);

  // The same, looked for in the folder of the file `from` first.
  Result<std::string> find_beside(const std::string& from, const Location& where, std::string_view name);

  // The content of a small file, which find() has found. `what` it is, for errors: "a spectrum".
  Result<FileSource::Bytes> small_file(const std::string& key, const Location& where, std::string_view what);

  // The content of a mesh, of any size.
  Result<FileSource::Bytes> mesh(const std::string& key) const { return files_.open(key); }

  // A <path> element of the XML file `from`.
  Result<void> add_folder(const std::string& from, const Location& where, std::string_view name);

  ReadingBudget& budget() const { return files_.budget(); }
  const std::set<std::string>& used() const { return used_; }

 private:
  Result<void> count_bytes(const std::string& key, std::size_t bytes);

  const UnpackedFiles& files_;
  std::string main_folder_;
  std::vector<std::string> folders_;
  std::set<std::string> used_;
  std::size_t total_bytes_ = 0;
};

}  // namespace candela::description
