// moondb_agent: one team member's process, with the standard actors alone.

#include "apps/moondb_agent/agent_program.h"

int main(int argc, char** argv) {
  moondb::AgentProgram program;
  program.version = MOONDB_VERSION;
  return moondb::RunAgentProgram(argc, argv, program);
}
