// LinkOrder: recognises each peer's newest connection by the link numbers in the peer's frames (PeerFrame).
//
// After a peer reconnects, frames from its earlier connection may still arrive. Each process of a peer numbers its
// connections upwards from a random number. A false number harms only the peer that sends it. File descriptors and
// routing ids are not used: the kernel reuses descriptors, and a peer can claim any routing id.
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
  // Records that a frame with this link number arrived from `agent`. Returns true if the number is that of the agent's
  // newest connection.
  bool IsNewest(AgentId agent, std::uint32_t link_number);
  // Returns how often a replaced process of the agent has returned. A restart causes no return, or two if a connection
  // of the old process delivers its first frame after a frame of the new process.
  int returns(AgentId agent) const;

 private:
  static constexpr std::size_t kEarlierMax = 16;  // Exceeds the number of connections that an agent may have open.

  struct Links {
    std::uint32_t newest = 0;  // 0: no connection yet.
    std::deque<std::uint32_t> earlier;
    int returns = 0;
  };
  std::map<AgentId, Links> links_;
};

}  // namespace moondb
