// CheckTrusted: checks that only this user and root could have written a file.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Returns kInvalid, with a way to fix it, if the file or folder belongs to another user than this one or root, or if
// others may write it. Others are all users, or a group that is not this process's own. A process of root accepts any
// owner, since root can read all files anyway. Sticky folders and missing files pass.
Result<void> CheckTrusted(const std::filesystem::path& path);

}  // namespace moondb
