// A folder that belongs to this user alone: sockets in it can be reached by nobody else, and nobody can plant theirs.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// kInvalid if `folder` exists and is not a directory of this user with mode 0700 (a link is none), or if others may
// replace it: its parent must be this user's or root's, and not writable by others unless sticky (as /tmp is).
Result<void> CheckPrivateFolder(const std::filesystem::path& folder);

// Makes it, and the folders above it that are missing, then checks as above.
Result<void> MakePrivateFolder(const std::filesystem::path& folder);

}  // namespace moondb
