// Agent: the whole runtime of one team member. It starts and stops the data folder, the actors and the transport in
// order.
//
//   storage (own thread), clock, role, lease, failover, sync, replica, retention, event, downlink, pgo (own),
//   merge (own), gateway, your own; then the transport
//
// Start detects faults of the environment (the folder, the database, keys, ports, a forced GL) before any actor runs
// and returns them as one error. Create and destroy an Agent on one thread. Callbacks run on other threads.
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

// A user's actor, supervised like the standard actors. Actors of this agent and of other agents send it Message.custom
// by its name; clients reach it with Client::Ask. It receives RecordsStored after each commit of new rows, and
// RolesChanged and LeasesChanged after each change of roles or leases. It may ignore these messages.
struct OwnActor {
  std::string name;  // 1 to 32 lower-case letters, digits, - and _; not the name of a standard actor.
  ActorFactory factory;
  SpawnOptions spawn;
};

struct AgentOptions {
  std::string name;                   // Name of the agent in the team file.
  std::filesystem::path data_folder;  // Created if missing. Only one process may use it.
  MergeBackend merge_backend = MergeBackend::kAuto;
  std::string secret_key_file;              // Empty: the file beside the public key.
  std::filesystem::path clients_file;       // Empty: clients.yaml beside the team file.
  std::string version;                      // The version that status shows.
  std::vector<OwnActor> own_actors;         // At most kOwnActorsMax. They start after the standard actors and stop
                                            // before them.
  std::function<void()> on_stop_requested;  // A client requested a stop. Called on any thread. Destroy the Agent on its
                                            // own thread.
  std::function<void(Error)> on_fatal;      // An actor failed permanently. Called on any thread.
};

inline constexpr std::size_t kOwnActorsMax = 64;

class Agent {
 public:
  // Returns a running agent. Returns kInvalid if the team has no such agent, an own actor's name is invalid, a key is
  // bad, or a path is too long for a socket. Returns kRefused if the data folder is in use, or the store belongs to
  // another agent, version or program. Returns kUnavailable if an address is in use, or GL is forced but missing. Other
  // errors are those of RecordStore::Open.
  static Result<std::unique_ptr<Agent>> Start(const TeamFile& team, AgentOptions options);

  ~Agent();  // Stops gracefully: accepts no new messages, waits for running handlers, closes the sockets.
  Agent(const Agent&) = delete;
  Agent& operator=(const Agent&) = delete;

  const std::string& client_endpoint() const;

  // Sends a message to an actor of this agent. Thread-safe while the agent exists. The sender is {self, "outside"}, to
  // which no actor can reply. If the actor's mailbox is full and its policy is Overflow::kBlock, blocks until there is
  // space.
  SendResult Post(const std::string& actor, proto::Message message);

  // Writes the latest activity of all actors to trace.txt in the data folder, so that the cause of a failure can be
  // found.
  void WriteTrace() const;
  // Makes every fatal signal call WriteTrace while the agent exists. Requires: only one agent per process.
  void WriteTraceOnCrash() const;

 private:
  class Impl;
  explicit Agent(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
