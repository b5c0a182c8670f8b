// The folder in which moonctl keeps the secret keys of clients. These keys belong to the user, not to a robot.
#pragma once

#include <filesystem>

#include "model/error.h"

namespace moondb {

// Returns $XDG_CONFIG_HOME/moondb, or ~/.config/moondb if that variable is not set. Returns kInvalid, with a remedy, if
// neither XDG_CONFIG_HOME nor HOME is an absolute path.
Result<std::filesystem::path> UserFolder();

}  // namespace moondb
