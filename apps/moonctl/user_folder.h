// The folder in which moonctl keeps the secret keys of clients. They belong to the user, not to a robot.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Returns $XDG_CONFIG_HOME/moondb, or ~/.config/moondb if that variable is not set. kInvalid, with a remedy, if neither
// variable names a folder.
Result<std::filesystem::path> UserFolder();

}  // namespace moondb
