// The log: one line per event, to stderr and optionally to a file. Times are UTC. The text format is "time level agent
// actor: text". The JSON format is for programs that read logs; each line is one object, whatever the text contains:
//   {"time":"2026-11-22T06:00:00.123Z","level":"warning","agent":"rover1","actor":"lease","text":"..."}
// "actor" is present only if the text begins with the name of an actor or component. The name is then removed from
// "text".
//
// Code logs with spdlog::info and similar functions. A text begins with the name of its actor or component, as in
// "transport: rover2 is connected". Bytes from peers and operators must pass through Quoted
// (runtime/team/placed_errors.h), which keeps one event on one line.
#pragma once

#include <string>

#include "model/error.h"

namespace moondb {

enum class LogFormat { kText, kJson };

// Sets up the log. Call once, before other threads log. `level`: trace, debug, info, warning, error, critical or off.
// `file`: path of the log file, or empty for none. The file is rotated at 10 MB, and three old files are kept. If
// stderr already writes to the same file (as `moonctl up` arranges, to capture crash output), each line is written
// once. Returns kInvalid for an unknown level, kUnavailable if the file cannot be opened. After an error, the log is
// unchanged.
Result<void> InitLog(const std::string& level, const std::string& agent_name, const std::string& file = {},
                     LogFormat format = LogFormat::kText);

}  // namespace moondb
