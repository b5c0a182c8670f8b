// LinkOrder: tells an agent's newest connection from its earlier ones by the link numbers in its frames (PeerFrame).
//
// An agent that connects again leaves its earlier connection behind. This side may not have seen that connection close,
// and frames may still arrive over it. Each agent numbers its own connections upwards, from a random start in each
// process, so a false number harms only the agent that sends it. File descriptors and routing ids play no part: the
// kernel reuses the former, and a peer can claim the latter.
//
// Two processes with the key of one agent, for example on a copied disk, replace each other's connection again and
// again. A replaced process that opens another connection returns; repeated returns are a sign of two processes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>

#include "model/ids.h"

namespace moondb {

class LinkOrder {
 public:
  // Records that a frame with this link number came from `agent`. Returns whether it is the agent's newest connection.
  bool IsNewest(AgentId agent, std::uint32_t link_number);
  // Returns how often a process of the agent has returned. A restart causes no return, or two if the first frame over a
  // connection of the previous process arrives after a frame of the new process.
  int returns(AgentId agent) const;

 private:
  static constexpr std::size_t kEarlierMax = 16;  // More than an agent may have open.

  struct Links {
    std::uint32_t newest = 0;  // 0: none yet.
    std::deque<std::uint32_t> earlier;
    int returns = 0;
  };
  std::map<AgentId, Links> links_;
};

}  // namespace moondb
