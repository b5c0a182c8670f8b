// LinkOrder: distinguishes an agent's newest connection from its earlier ones by the link numbers in its frames
// (PeerFrame).
//
// When an agent reconnects, this side may not have noticed that the earlier connection closed, and may still receive
// frames from it. Each agent numbers its connections upwards, from a random start in each process. A false number harms
// only the agent that sends it. File descriptors and routing ids are not used: the kernel reuses descriptors, and a
// peer can claim any routing id.
//
// Two processes with the key of one agent, for example from a copied disk, replace each other's connection again and
// again. A "return" is a new connection of a process that was replaced before. Repeated returns indicate two processes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>

#include "model/ids.h"

namespace moondb {

class LinkOrder {
 public:
  // Records that a frame with this link number arrived from `agent`. Returns true if it is the agent's newest
  // connection.
  bool IsNewest(AgentId agent, std::uint32_t link_number);
  // Returns how often a replaced process of the agent has returned. A restart causes no return, or two if the first
  // frame over a connection of the old process arrives after a frame of the new process.
  int returns(AgentId agent) const;

 private:
  static constexpr std::size_t kEarlierMax = 16;  // More than the connections that an agent may have open.

  struct Links {
    std::uint32_t newest = 0;  // 0: no connection yet.
    std::deque<std::uint32_t> earlier;
    int returns = 0;
  };
  std::map<AgentId, Links> links_;
};

}  // namespace moondb
