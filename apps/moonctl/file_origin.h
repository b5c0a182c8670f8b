// The origin of an exported file, and the agents whose data the file may lack, because the source agent was not
// connected to them. Not thread-safe.
#pragma once

#include <string>

#include "apps/moonctl/command_context.h"
#include "model/file_notes.h"

namespace moondb {

struct FileOrigin {
  std::string team;
  std::string agent;
  std::string time;          // UTC, as text.
  std::string out_of_reach;  // Names of unreachable agents, "nobody", or "unknown" if the source does not report them.
};

FileOrigin OriginOf(const proto::TeamConfig& team, const AgentClient& source);

// Returns the notes team, agent and time of the origin, then the notes in `content` (such as "maps": "183"), then the
// origin's note out_of_reach.
FileNotes NotesOf(const FileOrigin& origin, FileNotes content);

}  // namespace moondb
