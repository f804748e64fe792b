// Keeps the finished pieces of a long study in a folder, so that the study goes on after a kill with the
// rest.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "common/base/result.h"
#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/study.h"

namespace candela::study {

// The results of a piece of a study: those in folder/name.json if the file has this key, else those of
// `make`, which are written there. The key says all that the results depend on. An empty folder keeps
// nothing.
Result<Results> kept_results(const std::filesystem::path& folder, const std::string& name,
                             const std::string& key, const std::function<Result<Results>()>& make);

// The same of an image, in folder/name.f32, whose name says all that it depends on. values: its number.
Result<Image> kept_image(const std::filesystem::path& folder, const std::string& name, std::size_t values,
                         const std::function<Result<Image>()>& make);

}  // namespace candela::study
