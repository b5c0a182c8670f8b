// Writes new files and makes folders. A link that somebody planted does not redirect a write, and access is decided by
// the caller, not by the umask. Thread-safe.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>

#include "model/error.h"

namespace moondb {

struct FileOwner {
  uid_t user;
  gid_t group;
};

struct WriteOptions {
  // The file gets exactly this mode, whatever the umask. Without a mode it gets 0644, less what the umask takes away:
  // for files that a user exports.
  std::optional<mode_t> mode = {};
  std::optional<FileOwner> owner = {};  // Without an owner, the file belongs to this process's user.
  bool is_synced = false;               // If true, the content is on the disk when the call returns.
};

// Creates the file `path` and writes `content`. Fails with EEXIST if anything has this name, a link too. If another
// step fails, removes the new file and returns the step's error.
std::error_code WriteNew(const std::filesystem::path& path, std::string_view content, const WriteOptions& options);

// Writes a temporary file like WriteNew. First removes an entry of this name, which a killed process may have left. A
// link is removed and not followed. Returns EISDIR or EPERM if a folder has this name.
std::error_code WriteTemporary(const std::filesystem::path& path, std::string_view content,
                               const WriteOptions& options);

// Renames the finished file `from` to `to`. Fails with EEXIST if anything is called `to`. Atomic, except on file
// systems that have neither RENAME_NOREPLACE nor hard links: there, `to` is an empty file for a moment.
std::error_code MoveToNew(const std::filesystem::path& from, const std::filesystem::path& to);

// Returns false if `path` is on a file system that stores no permissions of files, as FAT, exFAT and NTFS on memory
// sticks: every file there has the permissions that the mount gives to all.
bool HasPermissions(const std::filesystem::path& path);

// Replaces a file atomically: writes the temporary file `file`.part and renames it. If `file` itself is a link,
// replaces the link. Fails with kInternal; the error's field is the path.
Result<void> WriteWholeFile(const std::filesystem::path& file, std::string_view content, const WriteOptions& options);

// Makes the folder `path` and its missing parents. New folders get exactly `mode`, whatever the umask. Without a mode
// they get 0755, less what the umask takes away. Existing folders keep their mode. An empty path stands for the current
// folder. Returns ENOTDIR if `path` exists and is no folder.
std::error_code MakeFolders(const std::filesystem::path& path, std::optional<mode_t> mode = {});

// Changes the mode of a folder. Returns ENOTDIR or ELOOP for a link, which is not followed.
std::error_code SetFolderMode(const std::filesystem::path& folder, mode_t mode);

}  // namespace moondb
