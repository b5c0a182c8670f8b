#include "apps/moonctl/command_notes.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>

#include "apps/moonctl/command_tree.h"

namespace moondb {
namespace {

constexpr bool kShows = true;

constexpr CommandNote kNotes[] = {
    {"", "moonctl -t team.yaml status"},
    {"up", "moonctl up"},
    {"down", "moonctl down"},
    {"status", "moonctl status --watch=5", kShows},
    {"health", "moonctl health --json", kShows},
    {"health acknowledge", "moonctl health acknowledge -a rover2"},
    {"role show", "moonctl role show", kShows},
    {"role history", "moonctl role history -a rover2", kShows},
    {"role set", "moonctl role set rover2 leader rover3 survivor --reason \"rover1 is lost\""},
    {"role swap", "moonctl role swap rover1 rover2 --dry-run"},
    {"sync now", "moonctl sync now --from rover2 --wait"},
    {"sync pause", "moonctl sync pause --for 10m"},
    {"sync resume", "moonctl sync resume -a rover2"},
    {"sync status", "moonctl sync status --watch", kShows},
    {"replicate now", "moonctl replicate now --wait --timeout 10m"},
    {"replicate status", "moonctl replicate status", kShows},
    {"drive on", "moonctl -a rover2 drive on --for 40"},
    {"drive off", "moonctl -a rover2 drive off"},
    {"sleep", "moonctl -a rover2 sleep --until 2026-11-22T06:00Z"},
    {"sleep off", "moonctl -a rover2 sleep off"},
    {"clients add", "moonctl clients add anna --rights command"},
    {"clients list", "moonctl clients list"},
    {"clients revoke", "moonctl clients revoke anna"},
    {"graph import", "moonctl graph import mission.pyfg"},
    {"graph export", "moonctl graph export graph.g2o --format g2o"},
    {"graph optimize", "moonctl graph optimize --covariance-of rover2:17"},
    {"graph stats", "moonctl graph stats --edges", kShows},
    {"graph solve", "moonctl graph solve plaza.pyfg --fix L0 --out solved.pyfg"},
    {"map export", "moonctl map export maps --format geotiff"},
    {"map why", "moonctl map why 10 -5.25", kShows},
    {"map stats", "moonctl map stats", kShows},
    {"map quarantine", "moonctl map quarantine --agent rover2 --from 2026-11-21T10:00Z --reason \"wheel slip\""},
    {"record insert", "moonctl -a rover2 record insert temperature '{\"celsius\": -40.5}'"},
    {"record get", "moonctl -a rover1 record get 2.5f3c9a1e0b7d4c21.30.17", kShows},
    {"record list", "moonctl -a rover1 record list temperature --limit 5", kShows},
    {"db info", "moonctl db info", kShows},
    {"db holdings", "moonctl db holdings", kShows},
    {"db verify", "moonctl db verify -a rover2"},
    {"db prune", "moonctl -a rover2 db prune --older-than 30d --dry-run"},
    {"db diff", "moonctl db diff rover1 rover2", kShows},
    {"db query", "moonctl -a rover1 db query \"select * from v_event\" --csv --out events.csv", kShows},
    {"db backup", "moonctl -a rover1 db backup rover1.sqlite"},
    {"downlink", "moonctl downlink --budget-kb 64"},
    {"downlink list", "moonctl downlink list", kShows},
    {"downlink get", "moonctl downlink get 7 --out pass-12.bundle"},
    {"downlink ack", "moonctl downlink ack 7 --file pass-12.bundle"},
    {"downlink show", "moonctl downlink show pass-12.bundle --json"},
    {"log", "moonctl log --events 20", kShows},
    {"trace", "moonctl trace -a rover1 --actor sync --events 20", kShows},
    {"config check", "moonctl config check team.yaml"},
    {"config show", "moonctl config show team.yaml"},
    {"config schema", "moonctl config schema > team.schema.json"},
    {"config init", "moonctl config init --agents 4 my-team/team.yaml"},
    {"completion", "moonctl completion bash > ~/.local/share/bash-completion/completions/moonctl"},
    {"man", "moonctl man > moonctl.1"},
    {"version", "moonctl version --json"},
};

}  // namespace

const CommandNote* NoteOf(const CLI::App& command) {
  const std::string path = PathOf(command);
  const auto* note = std::find_if(std::begin(kNotes), std::end(kNotes),
                                  [&path](const CommandNote& candidate) { return candidate.path == path; });
  if (note != std::end(kNotes)) return note;
  const auto subcommands = SubcommandsOf(command);
  return subcommands.empty() ? nullptr : NoteOf(*subcommands.front());
}

void AddExamples(CLI::App& command) {
  if (const CommandNote* note = NoteOf(command)) command.footer("Example: " + std::string(note->example));
  for (CLI::App* sub : command.get_subcommands([](CLI::App*) { return true; })) AddExamples(*sub);
}

}  // namespace moondb
