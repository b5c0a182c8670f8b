// The program around an agent: command line, team file, log, signals, ready line, exit codes. moondb_agent is one with
// nothing added; yours adds actors of your own:
//
//   int main(int argc, char** argv) {
//     moondb::AgentProgram program;
//     program.name = "survey_agent";
//     program.version = "1.0";
//     program.make_actors = [](moondb::AgentId self, const moondb::proto::TeamConfig& team) { ... };
//     return moondb::RunAgentProgram(argc, argv, program);
//   }
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/moondb_agent/agent.h"

namespace moondb {

class Command;

struct AgentProgram {
  std::string name = "moondb_agent";  // In --help and before errors.
  std::string version;                // By --version and in the agent's status.

  // May be empty. Adds options to the command line before it is read (Command::AddOption in
  // apps/common/arguments.h).
  std::function<void(Command&)> add_options;

  // May be empty. Makes what AgentOptions::own_actors says, once command line and team file are read. An error is
  // printed and ends the program with exit code 2.
  std::function<Result<std::vector<OwnActor>>(AgentId self, const proto::TeamConfig& team)> make_actors;

  // May be empty. For threads of the program's own, such as a sensor's driver that calls Agent::Post: on_running,
  // called on the main thread once the agent runs, may start them; on_stopping, called before it ends, has to join
  // them.
  std::function<void(Agent&)> on_running;
  std::function<void()> on_stopping;
};

// Runs one agent until SIGTERM, SIGINT or a client's stop. Once it runs, prints a line that begins with "ready:".
// Call it on the main thread before any other thread is started: threads inherit the signals that it blocks; SIGPIPE is
// ignored from then on. Does not throw as long as the functions of `program` do not.
//
// Returns the exit code: 0 stopped as asked, 1 the world is wrong (ports, database, folder, GL), 2 the command line,
// the team file or make_actors is, 70 an actor was beyond help.
int RunAgentProgram(int argc, char** argv, const AgentProgram& program);

}  // namespace moondb
