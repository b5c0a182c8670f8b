// Starts and ends processes on this machine, for `up` and `down`.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

// Starts `command` in its own session, so that the process outlives the terminal. Uses /dev/null as stdin, and appends
// stdout and stderr to `log` (0600). kInternal if the log cannot be opened or the program cannot be started.
Result<pid_t> StartProcess(const std::vector<std::string>& command, const std::filesystem::path& log);

using SteadyClock = std::chrono::steady_clock;

// Polls until `condition` is true. Returns false if it is not true by `deadline`.
bool WaitUntil(SteadyClock::time_point deadline, const std::function<bool()>& condition);

// Returns true if this child process has ended, and reaps it.
bool HasEnded(pid_t child);

// Returns the last non-empty line within the last 4 kB of `file`. Empty: no such line, or the file cannot be read.
std::string LastLine(const std::filesystem::path& file);

}  // namespace moondb
