// Agent: one team member's whole runtime: data folder, actors, transport, put together and taken apart in order.
//
//   storage (own thread), clock, role, lease, failover, sync, replica, retention, event, downlink, pgo (own),
//   merge (own), gateway, your own; then the transport
//
// What can be wrong with the world (the folder, the database, keys, ports, a forced GL) is found before anything runs
// and comes back as one error. Create and destroy it on one thread; the callbacks come on others.
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

// An actor of the user's, supervised like the standard ones. Others reach it by its name: actors of this agent and of
// others with Message.custom, clients with Client::Ask. It is told, as it may
// ignore, RecordsStored after each commit of new rows, RolesChanged and LeasesChanged after each change of these.
struct OwnActor {
  std::string name;  // 1 to 32 lower-case letters, digits, - and _; none of the standard actors'.
  ActorFactory factory;
  SpawnOptions spawn;
};

struct AgentOptions {
  std::string name;                   // Of the team's agents.
  std::filesystem::path data_folder;  // Made if it is missing; one process at a time.
  MergeBackend merge_backend = MergeBackend::kAuto;
  std::string secret_key_file;              // Empty: beside the public key.
  std::filesystem::path clients_file;       // Empty: clients.yaml beside the team file.
  std::string version;                      // Shown in status.
  std::vector<OwnActor> own_actors;         // At most kOwnActorsMax. Started after the standard ones, ended before.
  std::function<void()> on_stop_requested;  // A client asked; some thread. Destroy the Agent elsewhere.
  std::function<void(Error)> on_fatal;      // An actor is beyond help; some thread.
};

inline constexpr std::size_t kOwnActorsMax = 64;

class Agent {
 public:
  // Returns a running agent. kInvalid: no such agent, an own actor's name, a bad key, a path too long for a socket.
  // kRefused: the data folder is in use, the store is of another agent, version or program. kUnavailable: an
  // address in use, no GL where it is forced. Others as RecordStore::Open says.
  static Result<std::unique_ptr<Agent>> Start(const TeamFile& team, AgentOptions options);

  ~Agent();  // Stops it gracefully: no new messages, running handlers end, sockets close.
  Agent(const Agent&) = delete;
  Agent& operator=(const Agent&) = delete;

  const std::string& client_endpoint() const;

  // Any thread, while the agent lives: sends to an actor of this agent; the sender is {self, "outside"}, which nobody
  // can answer. Waits for room where the actor's mailbox is full and Overflow::kBlock.
  SendResult Post(const std::string& actor, proto::Message message);

  // Writes what the actors did last to trace.txt in the data folder, for whoever looks for the cause of a failure.
  void WriteTrace() const;
  // From now on a fatal signal does that, as long as the agent lives. One agent a process.
  void WriteTraceOnCrash() const;

 private:
  class Impl;
  explicit Agent(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
