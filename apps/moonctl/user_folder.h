// The user's folder in which moonctl keeps data of the user and not of a robot: the secret keys of clients.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Returns $XDG_CONFIG_HOME/moondb, or ~/.config/moondb if that variable is not set. kInvalid, with a remedy, if neither
// variable names a folder.
Result<std::filesystem::path> UserFolder();

}  // namespace moondb
