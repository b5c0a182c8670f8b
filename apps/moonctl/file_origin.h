// The origin of an exported file, and the agents that the source of the data could not reach. The file may lack data of
// these agents. Not thread-safe.
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

// Returns the notes on the origin. Inserts `content`, the notes on the content ("maps" "183"), before the last note,
// out_of_reach.
FileNotes NotesOf(const FileOrigin& origin, FileNotes content);

}  // namespace moondb
