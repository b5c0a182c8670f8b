// Agent: the whole runtime of one team member: its data folder, the standard actors
// (apps/moondb_agent/standard_actors.h), the user's own actors and the transport.
//
// Start detects faults of the environment (folder, database, keys, ports, a missing GL backend) before any actor runs
// and returns them as one error. Create and destroy an Agent on the same thread. Callbacks run on other threads.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "actors/merge/gather_backend.h"
#include "model/error.h"
#include "runtime/actor.h"
#include "runtime/team/team_config.h"

namespace moondb {

// A user's actor, supervised like the standard actors. Actors of this agent and of other agents send Message.custom to
// the actor's name; clients use Client::Ask. The actor receives RecordsStored after each commit of new rows, and
// RolesChanged and LeasesChanged after each change of roles or leases. The actor may ignore these messages.
struct OwnActor {
  std::string name;  // 1 to 32 lower-case letters, digits, - and _; not the name of a standard actor.
  ActorFactory factory;
  SpawnOptions spawn;
};

struct AgentOptions {
  std::string name;                   // Name of the agent in the team file.
  std::filesystem::path data_folder;  // Created if missing. Only one process may use it.
  MergeBackend merge_backend = MergeBackend::kAuto;
  std::string secret_key_file;         // Empty: the file beside the public key.
  std::filesystem::path clients_file;  // Empty: clients.yaml beside the team file.
  std::string version;                 // The version that status shows.
  // At most kOwnActorsMax. Own actors start after the standard actors and stop before them.
  std::vector<OwnActor> own_actors;
  // Called on any thread when a client requests a stop. The owner must then destroy the Agent on the thread that
  // created it, not in this call.
  std::function<void()> on_stop_requested;
  // Called on any thread when an actor has failed permanently.
  std::function<void(Error)> on_fatal;
  // Called every 10 s on any thread while no actor is stuck or has failed permanently. May be null.
  std::function<void()> on_healthy;
};

inline constexpr std::size_t kOwnActorsMax = 64;

class Agent {
 public:
  // Returns a running agent. Returns kInvalid if the team has no such agent, the name of an own actor or a key file is
  // invalid, or a path is too long for a socket. Returns kRefused if the data folder is in use, or the store belongs to
  // another agent, version or program. Returns kUnavailable if an address is in use, or if merge_backend is kGl but GL
  // is missing. Other errors are those of RecordStore::Open.
  static Result<std::unique_ptr<Agent>> Start(const TeamFile& team, AgentOptions options);

  ~Agent();  // Stops gracefully: accepts no new messages, waits for running handlers, closes the sockets.
  Agent(const Agent&) = delete;
  Agent& operator=(const Agent&) = delete;

  const std::string& client_endpoint() const;

  // Sends a message to an actor of this agent. Thread-safe while the agent exists. The sender is {self, "outside"}, to
  // which no actor can reply. If the actor's mailbox is full and its policy is Overflow::kBlock, blocks until there is
  // space.
  SendResult Post(const std::string& actor, proto::Message message);

  // Writes the latest activity of all actors to trace.txt in the data folder, to diagnose a failure.
  void WriteTrace() const;
  // Makes every fatal signal call WriteTrace while the agent exists. Requires: only one agent per process.
  void WriteTraceOnCrash() const;

 private:
  class Impl;
  explicit Agent(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
