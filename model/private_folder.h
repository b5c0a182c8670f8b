// Private folders for sockets. Other users can neither reach the sockets in such a folder nor create sockets there.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Returns kInvalid if `folder` exists but is not a directory of this user with mode 0700; a link is refused too. Also
// returns kInvalid if others could replace the folder: its parent must belong to this user or root, and must not be
// writable by others unless it is sticky (like /tmp). A missing folder passes.
Result<void> CheckPrivateFolder(const std::filesystem::path& folder);

// Creates the folder and its missing parents with mode 0700, and then returns CheckPrivateFolder(folder). Returns
// kInvalid if a folder cannot be created.
Result<void> MakePrivateFolder(const std::filesystem::path& folder);

}  // namespace moondb
