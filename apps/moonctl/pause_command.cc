#include "apps/moonctl/pause_command.h"

#include <chrono>
#include <memory>
#include <string>

#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "model/leases.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;

// Returns the lease of `agent` from the agent's `reply`. The durations in the result are 0 if the agent holds no lease.
proto::AgentLease LeaseOf(const proto::AgentConfig& agent, const proto::LeaseReply& reply) {
  for (const proto::AgentLease& lease : reply.leases()) {
    if (lease.agent_id() == agent.id()) return lease;
  }
  proto::AgentLease none;
  none.set_agent_id(agent.id());
  return none;
}

// Pauses each chosen agent for `duration`, or resumes it if `duration` is 0. Continues if an agent is unreachable.
ExitCode SetPause(CommandContext& context, milliseconds duration) {
  const auto answers =
      context.CallEach([duration](Client& client) { return client.SetLease(proto::LEASE_KIND_PAUSED, duration); });
  if (!answers) return context.Report(answers.error());
  Table table({"AGENT", "SHARING"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const auto& asked : *answers) {
    const auto& [agent, reply] = asked;
    BeginAgent(asked, json);
    if (reply) {
      const proto::AgentLease lease = LeaseOf(*agent, *reply);
      const std::string text = ToString(lease);
      table.Add({agent->name(), text.empty() ? "not paused" : text});
      json.Key("lease").Raw(ToJson(lease));
    } else {
      table.Add({agent->name(), WhyNoAnswer(reply.error())}, Tone::kBad);
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text());
}

}  // namespace

void AddPauseCommands(Command& sync, CommandContext& context) {
  auto length = std::make_shared<std::string>("600");
  Command& pause =
      AddCommand(sync, "pause",
                 "Pause bulk data (graph, maps) with all agents, or with -a, until the pause expires or sync resume",
                 {"moonctl sync pause --for 10m"});
  pause.AddOption("--for", *length, "Duration of the pause: 40 (seconds), 10m, 2h; at most 24 h")
      .TypeName("DURATION")
      .DefaultShown();
  pause.Callback([&context, length] {
    context.action = [&context, length] {
      const auto duration = ParseLeaseDuration(*length);
      return duration ? SetPause(context, *duration) : context.Report(duration.error());
    };
  });
  AddCommand(sync, "resume", "Resume sharing after a pause", {"moonctl sync resume -a rover2"}).Callback([&context] {
    context.action = [&context] { return SetPause(context, milliseconds(0)); };
  });
}

}  // namespace moondb
