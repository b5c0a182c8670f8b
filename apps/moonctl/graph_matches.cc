#include "apps/common/graph_reading.h"
#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/graph_commands.h"
#include "apps/moonctl/match_list.h"
#include "model/control_request.h"
#include "model/duration.h"

namespace moondb {
namespace {

constexpr std::size_t kRowsMax = 50;  // Fits on a few screens.

struct MatchesArguments {
  std::string wait;
  bool is_all = false;
};

// Returns zero without --wait.
Result<std::chrono::milliseconds> WaitOf(const MatchesArguments& arguments) {
  if (arguments.wait.empty()) return std::chrono::milliseconds(0);
  const auto wait = ParseDuration(arguments.wait);
  if (wait && *wait > std::chrono::milliseconds(0) &&
      *wait <= BoundedWait(kRegistrationWaitMax_s, kRegistrationWaitMax_s))
    return *wait;
  return Fail(ErrorCode::kInvalid, "expected a duration of at most 10m such as 90s, got \"" + arguments.wait + "\"",
              "--wait");
}

// Returns the reason for which the agent ended its wait before all pairs were matched; nullopt if none is left.
std::optional<Error> WhyNotDone(const proto::RegistrationReply& state) {
  if (state.is_done()) return std::nullopt;
  if (!state.text().empty()) {
    return Error{ErrorCode::kUnavailable, "map matching ended before all maps were matched: " + state.text(), {}};
  }
  return Error{
      ErrorCode::kTimedOut,
      "the time limit passed before all maps were matched: " + FormatCount(state.left_count()) + " pairs are left",
      {}};
}

ExitCode ShowMatches(CommandContext& context, const MatchesArguments& arguments) {
  const auto wait = WaitOf(arguments);
  if (!wait) return context.Report(wait.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  const auto state = target->client->Registration(*wait);
  const bool is_waiting = *wait > std::chrono::milliseconds(0);
  // An agent that does not lead matches nothing, but holds the matches that it received.
  const bool is_refusal = !state && state.error().code == ErrorCode::kRefused && !is_waiting;
  if (!state && !is_refusal) return context.Report(state.error());
  if (const auto error = is_waiting ? WhyNotDone(*state) : std::nullopt) return context.Report(*error);
  MatchList held;
  const auto known = ReadGraphOf(*target->client, team,
                                 [&held](const RecordKey& key, const proto::Record& record) { held.Add(key, record); });
  if (!known) return context.Report(known.error());
  const std::vector<ListedMatch> matches = held.List(*known);
  JsonWriter json;
  json.BeginObject().Key("registration");
  state ? json.Raw(ToJson(*state)) : json.Null();
  json.Key("refusal").String(state ? "" : state.error().text).Key("matches");
  WriteMatches(matches, json);
  json.EndObject();
  const std::string heading = state ? RegistrationText(team, *state) : state.error().text + "\n";
  return context.Done(json.text(), heading + MatchesText(team, matches, arguments.is_all ? matches.size() : kRowsMax));
}

}  // namespace

void AddGraphMatches(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<MatchesArguments>();
  Command& command = AddCommand(group, "matches", "Show the matches of local maps at the leader (or -a)",
                                {"moonctl graph matches --wait 5m", kShows});
  command
      .AddOption("--wait", arguments->wait,
                 "Match the maps stored now, and wait at most this long until all pairs are matched")
      .TypeName("DURATION");
  command.AddFlag("--all", arguments->is_all, "List all matches, not only the first " + std::to_string(kRowsMax));
  command.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ShowMatches(context, *arguments); }; });
}

}  // namespace moondb
