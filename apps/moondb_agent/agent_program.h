// The main program of an agent: reads the command line and the team file, opens the log, and runs an Agent until a
// signal or a client stops it. A program that adds its own actors:
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
  std::string name = "moondb_agent";  // Name in --help and in front of errors.
  std::string version;                // Shown by --version and in the agent's status.

  // Optional. Adds options of your program to the command line before it is read (Command::AddOption in
  // apps/common/arguments.h).
  std::function<void(Command&)> add_options;

  // Optional. Makes the actors for AgentOptions::own_actors after the command line and the team file are read. An error
  // is printed and ends the program with exit code 2.
  std::function<Result<std::vector<OwnActor>>(AgentId self, const proto::TeamConfig& team)> make_actors;

  // Optional. The main thread calls on_running when the agent runs, and on_stopping before the agent stops. on_running
  // may start threads, such as a sensor driver that calls Agent::Post. on_stopping must join these threads.
  std::function<void(Agent&)> on_running;
  std::function<void()> on_stopping;
};

// Runs one agent until SIGTERM, SIGINT or a client's stop request. Prints a line that begins with "ready:" once the
// agent runs. Requires: called on the main thread before any other thread starts, because new threads inherit the
// signals that RunAgentProgram blocks. Makes the process ignore SIGPIPE. Throws only if a function of `program` throws.
//
// Returns the exit code. 0: stopped on request. 1: a fault of the environment (ports, database, folder, GL). 2: the
// command line, the team file or make_actors is wrong. 70: an actor failed permanently.
int RunAgentProgram(int argc, char** argv, const AgentProgram& program);

}  // namespace moondb
