// SimulatedClients: sends requests of operators, planners and people at consoles to the simulated agents' gateways, and
// checks each answer (answer_check.h, map_checker.h, bundle_checker.h). Only for runs with SimulatedActors::kAll.
//
// Usually one request is sent at an instant, sometimes several. Some requests are sent to another agent, which relays
// them to the agent that they are for.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "apps/moondb_sim/bundle_checker.h"
#include "apps/moondb_sim/client_calls.h"
#include "apps/moondb_sim/map_checker.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

class SimulatedClients {
 public:
  explicit SimulatedClients(SimulatedWorld& world) : world_(world), calls_(world) {}

  void Start();  // Sends requests until SimulatedWorld::is_quiet.

  void OnAgentEnded(AgentId agent);
  void OnGatewayFailed(AgentId agent) { calls_.Forget(agent); }
  // Called when `from` sends a message to another agent.
  void OnRadio(AgentId from, const proto::Message& message);
  void OnDiskLost(AgentId agent) { bundles_[agent].OnDiskLost(); }

  // Checks the maps of all agents. Checks that the base station packs every record for the ground station into a
  // bundle. Requires: the team is quiescent.
  void CheckQuiescent();

 private:
  using Answer = ClientCalls::Answer;
  using Ask = void (SimulatedClients::*)(AgentId agent);

  void Work();

  // Each of these functions sends one kind of request.
  void RequestInsert(AgentId agent);
  void RequestTooManyInserts(AgentId agent);
  void RequestPage(AgentId agent);
  void RequestChanges(AgentId agent);
  void RequestWhatStands(AgentId agent);
  void RequestSights(AgentId agent);
  void RequestMaps(AgentId agent);  // Requests the maps of all agents; ignores `agent`.
  void RequestNewTiles(AgentId agent);
  void RequestSolve(AgentId agent);
  void RequestSwap(AgentId agent);
  void SwapAmidFragments(AgentId leader);
  void RequestAmidChange(AgentId leader, const proto::ControlRequest& change);
  void RequestLease(AgentId agent);
  void RequestPrune(AgentId agent);
  void RequestBundles(AgentId agent);
  void RequestWrongly(AgentId agent);

  void Send(AgentId agent, proto::ControlRequest request, ClientCalls::Then then = {});
  // Sends the request to `agent`, sometimes through another agent that relays it.
  void SendAnyWay(AgentId agent, proto::ControlRequest request, ClientCalls::Then then = {});
  void CheckAnswer(AgentId agent, const proto::ControlRequest& request, const std::optional<HaveSet>& before,
                   const Answer& answer);
  void CheckMap(AgentId agent);
  void CheckMapsAreAlike();
  void CheckSolved(AgentId leader, const proto::OptimizeReply& reply);

  void Order(AgentId agent, const proto::DownlinkRequest& order);
  void OnDownlinkReply(AgentId agent, const proto::DownlinkRequest& order, const Answer& answer);
  void FetchUnknown(AgentId agent);  // Fetches all bundles that were not fetched yet, one after the other.
  void Fetch(AgentId agent, std::uint32_t number, const std::string& begin);
  void CheckBundlesWhenIdle(AgentId agent);
  void Report(AgentId agent, const BundleChecker::Broken& broken);

  SimulatedWorld& world_;
  ClientCalls calls_;
  // True while several requests are sent at one instant, so that their answers cannot be checked one by one.
  bool asks_several_ = false;
  MapChecker maps_;
  std::map<AgentId, BundleChecker> bundles_;
};

}  // namespace moondb::simulation
