// The log: one line an event, to stderr and optionally to a file. Time is UTC. As text "time level agent actor: text",
// or as JSON, for programs that read logs, one object a line whatever the text holds:
//   {"time":"2026-11-22T06:00:00.123Z","level":"warning","agent":"rover1","actor":"lease","text":"..."}
// where "actor" is there only for a text that begins with its actor's or part's name, which then is not in "text".
//
// Code logs with spdlog::info and its like; a text begins with its actor's or part's name: "transport: rover2 is
// connected". Bytes of peers and operators go through Quoted (runtime/team/placed_errors.h) first: lines stay lines.
#pragma once

#include <string>

#include "model/error.h"

namespace moondb {

enum class LogFormat { kText, kJson };

// Call once, before other threads log. `level`: trace, debug, info, warning, error, critical or off.
// `file`: empty for none; it is rotated at 10 MB and three old ones are kept. Where stderr goes to that very file, as
// `moonctl up` has it, so that it also holds what a crash says, each line is written once.
// kInvalid for another level; kUnavailable if the file cannot be opened. Then nothing has changed.
Result<void> InitLog(const std::string& level, const std::string& agent_name, const std::string& file = {},
                     LogFormat format = LogFormat::kText);

}  // namespace moondb
