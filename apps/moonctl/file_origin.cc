#include "apps/moonctl/file_origin.h"

#include "apps/common/table.h"
#include "apps/common/utc.h"
#include "proto/status.pb.h"

namespace moondb {
namespace {

std::string UnreachedBy(Client& client) {
  const auto status = client.Status();
  if (!status) return "unknown";
  std::string names;
  for (const proto::PeerStatus& peer : status->peers()) {
    if (!peer.is_connected()) names += (names.empty() ? "" : ", ") + peer.name();
  }
  return names.empty() ? "nobody" : names;
}

}  // namespace

FileOrigin OriginOf(const proto::TeamConfig& team, const AgentClient& source) {
  return {team.team(), source.agent->name(), FormatUtc(UtcNowNs()), UnreachedBy(*source.client)};
}

FileNotes NotesOf(const FileOrigin& origin, FileNotes content) {
  FileNotes notes{{"team", origin.team}, {"agent", origin.agent}, {"time", origin.time}};
  notes.insert(notes.end(), content.begin(), content.end());
  notes.emplace_back("out_of_reach", origin.out_of_reach);
  return notes;
}

}  // namespace moondb
