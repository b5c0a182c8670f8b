// CheckTrusted: checks that only this user and root could have written a file.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Returns kInvalid, with a remedy in the text, if the owner of the file or folder is neither this user nor root, or if
// others may write to it. "Others" means all users, or a group other than this process's own. A process of root accepts
// any owner. Sticky folders and missing files pass.
Result<void> CheckTrusted(const std::filesystem::path& path);

}  // namespace moondb
