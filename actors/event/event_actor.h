// EventActor ("event"): writes down what happened at this agent, as records of the type `agent_event`.
//
// It tells that the agent started; each change of roles that this agent issued; and, once a minute, what went wrong
// since the last time: actors that failed and were made anew, records and messages that were refused or damaged,
// sharing sessions that ended early. What happens a thousand times in a minute is one event with a count: a flood from
// outside never becomes a flood of records. Commands are GatewayActor's to write down.
//
// Events are records like others: shared by the policy `agent_event`, so that the leader has the whole team's story.
// Where storage refuses one it is lost. A restart of this actor is one too; what was counted before it counts as told.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>

#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb {

class EventActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Complete and checked.
    std::string version;     // Told at the start.
    Duration period = std::chrono::minutes(1);
  };

  explicit EventActor(Options options) : options_(std::move(options)) {}

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  void OnRoles(Context& context, const proto::RoleAssignment& roles);
  void OnPeriod(Context& context);
  void OnStorageStatus(Context& context, const proto::StorageStatus& status);
  void OnShareStatus(Context& context, const std::string& actor, const proto::ShareStatus& status);

  void Ask(Context& context, const std::string& actor, proto::Message message) const;
  void Tell(Context& context, proto::EventKind kind, const std::string& text) const;
  // `counter` names a number that only rises; told is by how much it rose: "3 TEXT". What `source` said first was
  // before this actor's life.
  void TellRise(Context& context, proto::EventKind kind, const std::string& source, const std::string& counter,
                double count, const std::string& text);

  const Options options_;
  std::map<std::pair<std::string, std::string>, double> counts_;  // By source and counter.
  std::set<std::string> heard_;                                   // Sources.
  proto::RoleAssignment roles_;
};

}  // namespace moondb
