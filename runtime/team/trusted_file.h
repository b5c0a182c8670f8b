// CheckTrusted: whether other users than this one and root could have written what a file says.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// kInvalid, with how to mend it, for a file or folder that belongs to another user than this one or root (to root, who
// reads everybody's files, any user's is as good), or that others may write: all users, or those of a group that is not
// this process's own. What is not there passes.
Result<void> CheckTrusted(const std::filesystem::path& path);

}  // namespace moondb
