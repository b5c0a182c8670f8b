// Where an exported file came from, and who is out of reach of the agent that gave it, so that it may lack what they
// know. Not thread-safe.
#pragma once

#include <string>

#include "apps/moonctl/command_context.h"
#include "model/file_notes.h"

namespace moondb {

struct FileOrigin {
  std::string team;
  std::string agent;
  std::string time;          // UTC.
  std::string out_of_reach;  // Names, "nobody", or "unknown" where the agent does not say.
};

FileOrigin OriginOf(const proto::TeamConfig& team, const AgentClient& source);

// The origin's notes, with what is said of the content in between: "maps" "183".
FileNotes NotesOf(const FileOrigin& origin, FileNotes content);

}  // namespace moondb
