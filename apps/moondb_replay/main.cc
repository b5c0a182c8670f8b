// moondb_replay: feeds recorded or generated missions to a running team, and scores the team's results.
//
// Exit codes: 0 done, 1 failed, 2 the command line or an input file is wrong, 3 an agent is not running.

#include <cstdio>

#include "apps/common/arguments.h"
#include "apps/moondb_replay/feed_command.h"
#include "apps/moondb_replay/score_command.h"

namespace moondb {
namespace {

int Finish(const Result<void>& result) {
  if (result) return 0;
  std::fprintf(stderr, "moondb_replay: %s\n", ToString(result.error()).c_str());
  switch (result.error().code) {
    case ErrorCode::kInvalid:
      return 2;
    case ErrorCode::kUnavailable:
      return 3;
    default:
      return 1;
  }
}

int Run(int argc, char** argv) {
  FeedArguments feed;
  ScoreArguments score;
  Command app("moondb_replay", "Feeds a mission folder to a running team and scores the outcome.");
  app.RequireSubcommand();
  Command& feed_command = app.AddSubcommand("feed", "Insert each agent's records at that agent");
  feed_command.AddOption("--mission", feed.mission, "Mission folder").Required();
  feed_command.AddOption("-t,--team", feed.team, "Team file").EnvName("MOONDB_TEAM").Required();
  feed_command.AddOption("--from", feed.from_s, "From this second of the mission on");
  feed_command.AddOption("--to", feed.to_s, "Before this second of the mission");
  feed_command.AddOption("--agents", feed.agents, "Only these");
  feed_command.AddOption(
      "--speed", feed.speed,
      "Insert each record when it is due, this many times as fast as the mission was (10: six minutes "
      "take 36 s); without it, all at once");
  Command& score_command = app.AddSubcommand("score", "Score what an agent holds, against the truth");
  score_command.AddOption("--mission", score.mission, "Mission folder").Required();
  score_command.AddOption("-t,--team", score.team, "Team file").EnvName("MOONDB_TEAM").Required();
  score_command.AddOption("-a,--agent", score.agent, "Whose records").Required();
  score_command.AddOption("--out", score.out, "Folder for the pictures").Required();
  score_command.AddOption("--json", score.json, "File for the figures");
  score_command.AddFlag("--align", score.is_aligned,
                        "First move the whole team to where it fits the truth best, as for teams without starts");
  if (const std::optional<ParseStop> stop = app.Parse(argc, argv)) {
    if (stop->exit_code == 0) return 0;
    std::fprintf(stderr, "moondb_replay: %s\n", stop->error.c_str());
    return 2;
  }
  return Finish(feed_command.is_given() ? Feed(feed) : ScoreAgent(score));
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) { return moondb::Run(argc, argv); }
