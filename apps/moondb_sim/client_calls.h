// ClientCalls: simulated clients' requests to their agents' gateways, and the rules of the answers to all of them:
//
//   answered     each request is answered once, within its time, unless its agent or that one's gateway began a new
//   life clear_error  an error has a code and one line of text; kInternal is for the solver and for disks that fail
#pragma once

#include <cstdint>
#include <functional>
#include <map>

#include "apps/moondb_sim/client_message.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

// Of the simulated agents' gateways.
inline constexpr Duration kClientTimeout = std::chrono::seconds(20);
inline constexpr Duration kLongClientTimeout = std::chrono::seconds(60);

class ClientCalls {
 public:
  struct Answer {
    proto::ControlReply reply;
    bool is_at_once = false;  // At the instant of the question, and nothing else was asked meanwhile.
    Duration took{};
  };
  using Then = std::function<void(const Answer& answer)>;

  explicit ClientCalls(SimulatedWorld& world) : world_(world) {}

  // By a client of its own. `then` is called with the answer, unless none comes. Nothing where the agent does not run.
  void Ask(AgentId agent, const proto::ControlRequest& request, Then then);
  // Lets the team work on what was asked, and takes the answers that are there.
  void Run();

  // What was asked there is not answered any more.
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
