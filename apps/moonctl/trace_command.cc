#include <memory>

#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "runtime/trace_book.h"

namespace moondb {
namespace {

struct TraceArguments {
  std::uint32_t events_max = 50;
  std::string actor;
};

// Formats a handler's duration with a unit that suits short times: "2.125 s", "12.500 ms", "80 us".
std::string Took(double seconds) {
  if (seconds >= 1) return FormatFixed(seconds, 3) + " s";
  if (seconds >= 1e-3) return FormatFixed(seconds * 1e3, 3) + " ms";
  return FormatFixed(seconds * 1e6, 0) + " us";
}

std::string Other(double agent, const std::string& actor) {
  const std::string id = agent > kAgentIdMax ? "client" : FormatCount(agent);
  return actor.empty() ? id : id + "/" + actor;
}

std::string TraceText(const proto::TraceReply& reply) {
  Table events({"SECONDS AGO", "ACTOR", "DID", "WHAT", "TO OR FROM", "BYTES", "TOOK", "WHY NOT"});
  for (const proto::TraceEvent& event : reply.events()) {
    const bool has_other = event.other_agent() != 0;
    const bool is_handled = event.kind() == proto::TRACE_HANDLED || event.kind() == proto::TRACE_OVERRAN;
    events.Add({FormatFixed(event.age_s(), 6), event.actor(), TraceWord(event.kind()), event.body(),
                has_other ? Other(event.other_agent(), event.other_actor()) : "",
                event.bytes() > 0 ? FormatCount(event.bytes()) : "", is_handled ? Took(event.seconds()) : "",
                event.result()});
  }
  std::string text = events.Text();
  if (reply.dead_letter_count() == 0) return text + "No actor has failed.\n";
  Table letters({"SECONDS AGO", "ACTOR", "FAILED AT", "FROM", "BYTES", "ERROR"});
  for (const proto::DeadLetter& letter : reply.dead_letters()) {
    letters.Add({FormatFixed(letter.age_s(), 3), letter.actor(), letter.body().empty() ? "-" : letter.body(),
                 letter.from_agent() == 0 ? "" : Other(letter.from_agent(), letter.from_actor()),
                 FormatCount(letter.bytes()), letter.error().text()});
  }
  return text + "\n" + FormatCount(reply.dead_letter_count(), "failure") +
         " of actors since the agent started; the newest:\n" + letters.Text();
}

ExitCode ShowTrace(CommandContext& context, const TraceArguments& arguments) {
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  proto::TraceRequest request;
  request.set_events_max(arguments.events_max);
  request.set_actor(arguments.actor);
  auto reply = target->client->Trace(request);
  if (!reply) return context.Report(reply.error());
  return context.Done(ToJson(*reply), TraceText(*reply));
}

}  // namespace

void AddTraceCommand(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<TraceArguments>();
  Command& trace = AddCommand(app, "trace", "Show recent events and failures of the actors of the leader (or -a)",
                              {"moonctl trace -a rover1 --actor sync --events 20", kShows});
  trace.AddOption("--events", arguments->events_max, "Number of newest events to show; 0 for all (50)");
  trace.AddOption("--actor", arguments->actor, "Show only events of this actor");
  trace.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ShowTrace(context, *arguments); }; });
}

}  // namespace moondb
