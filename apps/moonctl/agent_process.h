// Starting and ending moondb_agent processes on this machine, for `up` and `down`.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

// Starts `command` in a session of its own, so that it outlives the terminal; stdin is /dev/null, stdout and stderr are
// appended to `log` (0600). kInternal if the log cannot be opened or the program cannot be started.
Result<pid_t> StartProcess(const std::vector<std::string>& command, const std::filesystem::path& log);

// Whether a child of this process has ended; reaps it.
bool HasEnded(pid_t child);

// The last line of `file` that is not empty, of at most its last 4 kB; empty if there is none.
std::string LastLine(const std::filesystem::path& file);

}  // namespace moondb
