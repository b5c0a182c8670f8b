// Private folders: other users can neither reach the sockets in such a folder nor create sockets there.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Checks that a folder is private. A missing folder passes. Returns kInvalid if `folder` is not a directory of this
// user with mode 0700; a link is refused too. Also returns kInvalid if others could replace the folder: the parent must
// belong to this user or root, and must not be writable by others unless it is sticky (like /tmp).
Result<void> CheckPrivateFolder(const std::filesystem::path& folder);

// Creates the folder and missing parents, then checks it like CheckPrivateFolder.
Result<void> MakePrivateFolder(const std::filesystem::path& folder);

}  // namespace moondb
