#include "apps/moonctl/user_folder.h"

#include <cstdlib>

namespace moondb {
namespace {

// Returns the folder that the environment variable names. Empty: the variable is not set, or is not an absolute path.
std::filesystem::path FolderIn(const char* variable) {
  const char* value = std::getenv(variable);
  const std::filesystem::path folder = value == nullptr ? "" : value;
  return folder.is_absolute() ? folder : std::filesystem::path();
}

}  // namespace

Result<std::filesystem::path> UserFolder() {
  if (const auto folder = FolderIn("XDG_CONFIG_HOME"); !folder.empty()) return folder / "moondb";
  if (const auto home = FolderIn("HOME"); !home.empty()) return home / ".config" / "moondb";
  return Fail(ErrorCode::kInvalid,
              "neither XDG_CONFIG_HOME nor HOME names a folder; give the place of the key with --out");
}

}  // namespace moondb
