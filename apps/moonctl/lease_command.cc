#include <chrono>

#include "apps/common/proto_json.h"
#include "apps/common/utc.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/command_tree.h"
#include "apps/moonctl/commands.h"
#include "model/leases.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;

struct LeaseArguments {
  std::string duration;  // Examples: "40", "10m".
  std::string until;     // Example: "2026-11-22T06:00Z".
};

Result<milliseconds> DurationUntil(const std::string& time) {
  const auto until = ParseUtc(time);
  if (!until) {
    return Fail(ErrorCode::kInvalid, "expected a time in UTC such as 2026-11-22T06:00Z, got \"" + time + "\"",
                "--until");
  }
  const auto left = std::chrono::ceil<milliseconds>(*until - std::chrono::system_clock::now());
  if (left > milliseconds(0) && left <= std::chrono::hours(24)) return left;
  return Fail(ErrorCode::kInvalid, "\"" + time + "\" is not within the next 24 h", "--until");
}

Result<milliseconds> DurationOf(const LeaseArguments& arguments) {
  return arguments.until.empty() ? ParseLeaseDuration(arguments.duration) : DurationUntil(arguments.until);
}

ExitCode SetLease(CommandContext& context, proto::LeaseKind kind, const Result<milliseconds>& duration) {
  if (!duration) return context.Report(duration.error());
  const auto robot = context.ChosenOrOnlyHere();
  if (!robot) return context.Report(robot.error());
  const std::string& name = (*robot)->name();
  auto chosen = context.Connect(name);
  if (!chosen) return context.Report(chosen.error());
  auto reply = chosen->client->SetLease(kind, *duration);
  if (!reply) return context.Report(reply.error());
  std::string text = name + " neither drives nor sleeps";
  for (const proto::AgentLease& lease : reply->leases()) {
    if (lease.agent_id() == chosen->agent->id()) text = name + " " + ToString(lease);
  }
  return context.Done(ToJson(*reply), text);
}

void AddOff(Command& group, CommandContext& context, proto::LeaseKind kind, const std::string& description) {
  const std::string path = PathOf(group) + " off";
  AddCommand(group, "off", description, {"moonctl -a rover2 " + path}).Callback([&context, kind] {
    context.action = [&context, kind] { return SetLease(context, kind, milliseconds(0)); };
  });
}

}  // namespace

void AddLeaseCommands(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<LeaseArguments>();
  const auto act = [&context, arguments](proto::LeaseKind kind) {
    context.action = [&context, arguments, kind] { return SetLease(context, kind, DurationOf(*arguments)); };
  };

  Command& drive = app.AddSubcommand(
      "drive", "Start or end a drive lease of agent -a: no bulk data (graph, maps) is shared while it drives");
  drive.RequireSubcommand();
  Command& on = AddCommand(drive, "on", "Start a drive lease", {"moonctl -a rover2 drive on --for 40"});
  on.AddOption("--for", arguments->duration, "Duration of the lease: 40 (seconds), 10m, 2h")
      .TypeName("DURATION")
      .Required();
  on.Callback([act] { act(proto::LEASE_KIND_DRIVING); });
  AddOff(drive, context, proto::LEASE_KIND_DRIVING, "End the drive lease");

  Command& sleep = AddCommand(app, "sleep", "Start or end a sleep lease of agent -a: nothing is shared while it sleeps",
                              {"moonctl -a rover2 sleep --until 2026-11-22T06:00Z"});
  sleep.AllowSubcommand();
  Option& duration = sleep.AddOption("--for", arguments->duration, "Duration of the lease: 40 (seconds), 10m, 8h")
                         .TypeName("DURATION");
  sleep.AddOption("--until", arguments->until, "End of the lease in UTC: 2026-11-22T06:00Z")
      .TypeName("TIME")
      .Excludes(duration);
  AddOff(sleep, context, proto::LEASE_KIND_SLEEPING, "End the sleep lease");
  sleep.Callback([&context, &sleep, arguments, act] {
    const bool is_on = !arguments->duration.empty() || !arguments->until.empty();
    const bool is_off = sleep.GivenSubcommand() != nullptr;
    if (is_on == is_off) {
      context.action = [&context] {
        return context.Report(
            {ErrorCode::kInvalid, "expected sleep --for DURATION, sleep --until TIME or sleep off", {}});
      };
    } else if (is_on) {
      act(proto::LEASE_KIND_SLEEPING);
    }
  });
}

}  // namespace moondb
