#include "apps/moonctl/node_name.h"

#include "model/agent_name.h"
#include "model/text.h"

namespace moondb {

std::string NodeName(const proto::TeamConfig& team, const NodeKey& node) {
  return AgentName(team, node.agent) + ":" + std::to_string(node.index);
}

Result<NodeKey> ParseNodeName(const proto::TeamConfig& team, const std::string& text, const std::string& option) {
  const std::size_t colon = text.find(':');
  const auto index = colon == std::string::npos ? std::nullopt : ParseUnsigned(text.substr(colon + 1));
  for (const proto::AgentConfig& agent : team.agents()) {
    if (index && agent.name() == text.substr(0, colon)) return NodeKey{agent.id(), *index};
  }
  return Fail(ErrorCode::kInvalid, "'" + text + "' is not a node of the team; expected AGENT:INDEX such as rover2:17",
              option);
}

}  // namespace moondb
