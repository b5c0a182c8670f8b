// ClientCalls: sends simulated clients' requests to their agents' gateways, and checks every answer:
//
// - answered: Each request is answered once and in time, unless its agent or the agent's gateway has restarted.
// - clear_error: An error has a code and one line of text. Only the solver and failing disks may cause kInternal.
#pragma once

#include <cstdint>
#include <functional>
#include <map>

#include "apps/moondb_sim/client_message.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

// Timeouts of the simulated agents' gateways.
inline constexpr Duration kClientTimeout = std::chrono::seconds(20);
inline constexpr Duration kLongClientTimeout = std::chrono::seconds(60);

class ClientCalls {
 public:
  struct Answer {
    proto::ControlReply reply;
    // True if the answer arrived at the instant of the request, and no other request was sent at that instant.
    bool is_at_once = false;
    Duration took{};
  };
  using Then = std::function<void(const Answer& answer)>;

  explicit ClientCalls(SimulatedWorld& world) : world_(world) {}

  // Sends `request` from a new client to the agent's gateway. Calls `then` with the answer, if an answer arrives. Does
  // nothing if the agent does not run.
  void Ask(AgentId agent, const proto::ControlRequest& request, Then then);
  // Runs the team until it is idle, and calls `then` for each answer that has arrived. Runs again every second while
  // requests are open.
  void Run();

  // Drops the open requests to `agent`. Call when its process or its gateway has ended.
  void Forget(AgentId agent);

 private:
  struct Call {
    AgentId agent = 0;
    proto::ControlRequest request;
    MonotonicTime asked;
    MonotonicTime answer_by;
    bool is_alone = true;
    Then then;
  };

  static Address ClientOf(std::uint64_t call) { return {kClients, "client" + std::to_string(call)}; }
  void TakeAnswers();
  void CheckOverdue();
  void CheckError(const Call& call, const proto::ControlReply& reply);

  SimulatedWorld& world_;
  std::map<std::uint64_t, Call> calls_;
  std::uint64_t last_call_ = 0;
  bool is_polling_ = false;
};

}  // namespace moondb::simulation
