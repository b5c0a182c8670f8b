// CheckTrusted: checks that only this user and root could have written a file.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Returns kInvalid, with a remedy in the text, if the owner of the file or folder is neither this user nor root, or if
// others may write to it. "Others" means all users, or a group other than this process's own. That group passes because
// some systems give each user a group of its own and make folders that this group may write (Ubuntu: umask 002). A
// process of root accepts any owner.
//
// The same must hold for the folder that holds a file, because a user who may write there can replace the file. A
// sticky folder, such as /tmp, passes: only the owners of a file and of the folder can replace a file there. If the
// path is a link, the folder of the link and the folder of the file behind it are checked. Missing files pass.
Result<void> CheckTrusted(const std::filesystem::path& path);

}  // namespace moondb
