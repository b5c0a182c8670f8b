#include "apps/moonctl/team_reach.h"

#include <algorithm>

#include "apps/common/local_endpoint.h"
#include "apps/common/table.h"
#include "apps/common/team_clients.h"
#include "model/term.h"
#include "proto/status.pb.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

constexpr std::chrono::seconds kNeighborsAgeMax(2);

// Returns the age as text, such as "0.2 s" or "34 s".
std::string AgeText(double seconds) { return seconds < 10 ? FormatFixed(seconds, 1) + " s" : FormatSeconds(seconds); }

bool IsSilence(const Error& error) {
  return error.code == ErrorCode::kUnavailable || error.code == ErrorCode::kTimedOut;
}

}  // namespace

bool TeamReach::Neighbor::IsConnectedTo(AgentId peer) const {
  const auto known = peers.find(peer);
  return known != peers.end() && known->second.is_connected;
}

Client::Options TeamReach::ClientOptionsFor(const proto::AgentConfig& agent) const {
  Client::Options options = options_.client;
  if (options_.on_config_hash) {
    options.on_config_hash = [this, &agent](std::uint64_t hash) { options_.on_config_hash(agent, hash); };
  }
  return options;
}

Result<AgentClient> TeamReach::ConnectHere(const proto::AgentConfig& agent) {
  Absence absence;
  return ConnectHere(agent, &absence);
}

Result<AgentClient> TeamReach::ConnectHere(const proto::AgentConfig& agent, Absence* absence) {
  if (options_.client.secret_key.empty()) {
    const auto here = FindLocalEndpoint(team_, agent);
    if (!here) return tl::unexpected(here.error());
    if (here->endpoint.empty()) {
      *absence = {true, here->was_here, here->pid != 0, here->why};
      return Fail(ErrorCode::kUnavailable, here->why);
    }
  }
  auto client = ConnectTo(team_, agent, ClientOptionsFor(agent));
  if (client) return AgentClient{&agent, std::move(*client)};
  // With a key, moonctl inspects no local socket or data folder, so moonctl does not know whether the agent is on
  // this machine.
  if (!options_.client.secret_key.empty() && IsSilence(client.error())) {
    *absence = {true, true, false, client.error().text};
  }
  return tl::unexpected(client.error());
}

Result<AgentClient> TeamReach::Through(const proto::AgentConfig& via, const proto::AgentConfig& agent) {
  auto client = ConnectTo(team_, agent, ClientOptionsFor(agent), &via);
  if (!client) return tl::unexpected(client.error());
  // The connection only proves that the relay answers. Send a request to `agent` itself.
  if (auto there = (*client)->Roles(); !there) return tl::unexpected(there.error());
  last_via_ = &via;
  if (options_.on_relay) options_.on_relay(via);
  return AgentClient{&agent, std::move(*client), &via};
}

Result<AgentClient> TeamReach::Connect(const proto::AgentConfig& agent) {
  if (options_.via != nullptr) return Through(*options_.via, agent);
  Absence absence;
  auto here = ConnectHere(agent, &absence);
  if (here || !absence.is_absent) return here;
  const proto::AgentConfig* via = ChooseVia(agent);
  if (via == nullptr) return Fail(ErrorCode::kUnavailable, WhereText(agent, absence));
  auto through = Through(*via, agent);
  if (!through && IsSilence(through.error())) {
    return Fail(through.error().code, WhereText(agent, absence) + ": " + through.error().text);
  }
  if (through && absence.runs_here && options_.on_remark) options_.on_remark(absence.why);
  return through;
}

const std::vector<TeamReach::Neighbor>& TeamReach::Neighbors() {
  const auto now = std::chrono::steady_clock::now();
  const bool is_known = neighbors_at_ != std::chrono::steady_clock::time_point{};
  if (is_known && now - neighbors_at_ < kNeighborsAgeMax) return neighbors_;
  neighbors_.clear();
  for (const proto::AgentConfig& agent : team_.config.agents()) {
    if (agent.left()) continue;
    auto here = ConnectHere(agent);
    if (!here) continue;
    const auto status = here->client->Status();
    if (!status) continue;
    Neighbor& neighbor = neighbors_.emplace_back(Neighbor{&agent, {}});
    for (const proto::PeerStatus& peer : status->peers()) {
      neighbor.peers[peer.agent_id()] = {peer.is_connected(), peer.seconds_since_heard()};
    }
  }
  neighbors_at_ = std::chrono::steady_clock::now();
  return neighbors_;
}

const proto::AgentConfig* TeamReach::ChooseVia(const proto::AgentConfig& agent) {
  const proto::AgentConfig* chosen = nullptr;
  for (const Neighbor& neighbor : Neighbors()) {
    if (neighbor.agent == &agent || !neighbor.IsConnectedTo(agent.id())) continue;
    // Prefer the relay used last, so that one relay serves all agents.
    if (chosen == nullptr || neighbor.agent == last_via_) chosen = neighbor.agent;
  }
  return chosen;
}

bool TeamReach::IsHeard(const proto::AgentConfig& agent) {
  return std::any_of(Neighbors().begin(), Neighbors().end(),
                     [&agent](const Neighbor& neighbor) { return neighbor.IsConnectedTo(agent.id()); });
}

std::string TeamReach::WhereText(const proto::AgentConfig& agent, const Absence& absence) {
  const std::vector<Neighbor>& neighbors = Neighbors();
  const bool is_elsewhere = !absence.was_here && !HasSecretKey(team_.config, team_.folder, agent);
  if (neighbors.empty() && is_elsewhere) {
    return "agent " + agent.name() + " is not on this machine, and no agent of team " + team_.config.team() +
           " runs here: give --key, or run moonctl on a robot";
  }
  // An agent that ran on this machine counts as stopped unless a neighbor is connected to it.
  if (neighbors.empty() || (absence.was_here && !IsHeard(agent))) return absence.why;
  const std::string where = absence.was_here ? absence.why : "agent " + agent.name() + " is not on this machine";
  const Neighbor* last = nullptr;  // The neighbor that heard the agent last.
  double age_s = -1;
  for (const Neighbor& neighbor : neighbors) {
    const auto peer = neighbor.peers.find(agent.id());
    if (peer == neighbor.peers.end()) continue;
    const double heard_s = peer->second.seconds_since_heard;
    const bool is_later = heard_s >= 0 && (age_s < 0 || heard_s < age_s);
    if (last != nullptr && !is_later) continue;
    last = &neighbor;
    age_s = heard_s;
  }
  if (last == nullptr) return where;
  const std::string& by = last->agent->name();
  if (age_s < 0) return where + "; " + by + " has never heard it";
  const bool is_connected = last->IsConnectedTo(agent.id());
  return is_connected ? where + ", " + by + " heard it " + AgeText(age_s) + " ago"
                      : where + "; " + by + " has not heard it for " + AgeText(age_s);
}

Result<proto::RoleAssignment> TeamReach::NewestRoles() {
  std::optional<proto::RoleAssignment> newest;
  std::optional<Error> refusal;
  const auto add = [&newest](const proto::RoleAssignment& roles) {
    if (!newest || IsNewer(roles.term(), newest->term())) newest = roles;
  };
  for (const proto::AgentConfig& agent : team_.config.agents()) {
    if (agent.left()) continue;
    const bool is_itself = options_.via == nullptr;
    auto client = is_itself ? ConnectHere(agent).map([](AgentClient&& here) { return std::move(here.client); })
                            : ConnectTo(team_, agent, ClientOptionsFor(agent), options_.via);
    if (!client) {
      if (client.error().code == ErrorCode::kRefused) refusal = client.error();
      continue;
    }
    const auto shown = (*client)->Roles();
    if (shown) add(shown->roles());
    if (!shown && !IsSilence(shown.error())) refusal = shown.error();
  }
  if (newest) return *newest;
  if (refusal) return tl::unexpected(*refusal);
  return Fail(ErrorCode::kUnavailable, "no agent of team " + team_.config.team() + " answers");
}

}  // namespace moondb
