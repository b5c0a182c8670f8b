// The log: one line an event, "time level agent actor text", to stderr and optionally to a file. Time is UTC.
//
// Code logs with spdlog::info and its like; a text begins with its actor's or part's name: "transport: rover2 is
// connected". Bytes of peers and operators go through Quoted (runtime/placed_errors.h) first: lines stay lines.
#pragma once

#include <string>

#include "model/error.h"

namespace moondb {

// Call once, before other threads log. `level`: trace, debug, info, warning, error, critical or off.
// `file`: empty for none; it is rotated at 10 MB and three old ones are kept.
// kInvalid for another level; kUnavailable if the file cannot be opened. Then nothing has changed.
Result<void> InitLog(const std::string& level, const std::string& agent_name, const std::string& file = {});

}  // namespace moondb
