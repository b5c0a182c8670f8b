// The folder of this user in which moonctl keeps what is the user's and no robot's: the secret keys of clients.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// $XDG_CONFIG_HOME/moondb, else ~/.config/moondb. kInvalid, with what to give instead, where neither variable names a
// folder.
Result<std::filesystem::path> UserFolder();

}  // namespace moondb
