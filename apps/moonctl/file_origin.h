// The origin of an exported file, with the agents that its source could not reach. The file may lack their data. Not
// thread-safe.
#pragma once

#include <string>

#include "apps/moonctl/command_context.h"
#include "model/file_notes.h"

namespace moondb {

struct FileOrigin {
  std::string team;
  std::string agent;
  std::string time;          // UTC.
  std::string out_of_reach;  // Names of unreachable agents, "nobody", or "unknown" if the source does not report them.
};

FileOrigin OriginOf(const proto::TeamConfig& team, const AgentClient& source);

// Returns the origin's notes with the notes on the content ("maps" "183") before the last one, out_of_reach.
FileNotes NotesOf(const FileOrigin& origin, FileNotes content);

}  // namespace moondb
