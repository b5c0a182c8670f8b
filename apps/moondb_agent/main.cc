// moondb_agent: the process of one team member, with only the standard actors.

#include "apps/moondb_agent/agent_program.h"

int main(int argc, char** argv) {
  moondb::AgentProgram program;
  program.version = MOONDB_VERSION;
  return moondb::RunAgentProgram(argc, argv, program);
}
