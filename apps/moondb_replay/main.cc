// moondb_replay: gives recorded or made missions to a running team, and scores what it made of them.
//
// Exit codes: 0 done, 1 failed, 2 the command line or an input file is wrong, 3 an agent is not running.

#include <CLI/CLI.hpp>
#include <cstdio>

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
  CLI::App app("Feeds a mission folder to a running team and scores the outcome.", "moondb_replay");
  app.require_subcommand(1);
  CLI::App& feed_command = *app.add_subcommand("feed", "Insert each agent's records at that agent");
  feed_command.add_option("--mission", feed.mission, "Mission folder")->required();
  feed_command.add_option("-t,--team", feed.team, "Team file")->envname("MOONDB_TEAM")->required();
  feed_command.add_option("--from", feed.from_s, "From this second of the mission on");
  feed_command.add_option("--to", feed.to_s, "Before this second of the mission");
  feed_command.add_option("--agents", feed.agents, "Only these");
  CLI::App& score_command = *app.add_subcommand("score", "Score what an agent holds, against the truth");
  score_command.add_option("--mission", score.mission, "Mission folder")->required();
  score_command.add_option("-t,--team", score.team, "Team file")->envname("MOONDB_TEAM")->required();
  score_command.add_option("-a,--agent", score.agent, "Whose records")->required();
  score_command.add_option("--out", score.out, "Folder for the pictures")->required();
  score_command.add_option("--json", score.json, "File for the figures");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::fprintf(stderr, "moondb_replay: %s\n", error.what());
    return 2;
  }
  return Finish(feed_command.parsed() ? Feed(feed) : ScoreAgent(score));
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) { return moondb::Run(argc, argv); }
