#include "apps/moondb_sim/simulated_clients.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <utility>

#include "apps/moondb_sim/answer_check.h"
#include "apps/moondb_sim/simulated_config.h"
#include "model/term.h"
#include "proto/types.pb.h"
#include "runtime/team/team_config.h"

namespace moondb::simulation {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

constexpr Duration kAskPeriod = seconds(15);  // Average time between requests.
constexpr std::uint64_t kSeveralEvery = 8;    // One call of Work in eight sends several requests.
constexpr std::uint64_t kSeveralMax = 5;
constexpr std::uint64_t kOtherWayEvery = 6;
constexpr std::uint64_t kSwapAmidFragmentsEvery = 2;
constexpr std::uint64_t kSamplesMax = 5;
constexpr double kWait_s = 15;  // Longest wait for new records, shorter than the gateways' timeout.
constexpr std::uint64_t kBundleBytesLeast = 1024;
constexpr std::uint64_t kBundleBytesSpan = 15 * 1024;
constexpr std::uint64_t kBundleBytesWhenIdle = 1024 * 1024;
constexpr int kBundlesWhenIdleMax = 64;
constexpr std::uint32_t kPageRecords = 1024;

proto::Record Sample(std::string payload) {
  proto::Record record;
  record.mutable_custom()->set_data_type(kSample);
  record.mutable_custom()->set_payload(std::move(payload));
  return record;
}

proto::MergeRequest Everything() { return {}; }

}  // namespace

// --- Workload ---

void SimulatedClients::Start() {
  world_.At(world_.start + kAskPeriod, [this] { Work(); });
}

void SimulatedClients::Work() {
  static constexpr Ask kKinds[] = {
      &SimulatedClients::RequestInsert,     &SimulatedClients::RequestInsert,
      &SimulatedClients::RequestInsert,     &SimulatedClients::RequestPage,
      &SimulatedClients::RequestPage,       &SimulatedClients::RequestChanges,
      &SimulatedClients::RequestWhatStands, &SimulatedClients::RequestWhatStands,
      &SimulatedClients::RequestSights,     &SimulatedClients::RequestMaps,
      &SimulatedClients::RequestNewTiles,   &SimulatedClients::RequestSolve,
      &SimulatedClients::RequestSwap,       &SimulatedClients::RequestLease,
      &SimulatedClients::RequestPrune,      &SimulatedClients::RequestBundles,
      &SimulatedClients::RequestWrongly,    &SimulatedClients::RequestTooManyInserts,
  };
  if (world_.is_quiet) return;
  world_.In(world_.DrawDuration(2 * kAskPeriod), [this] { Work(); });
  const AgentId agent = world_.DrawAgent();
  asks_several_ = world_.rng() % kSeveralEvery == 0;
  const std::uint64_t count = asks_several_ ? 2 + world_.rng() % (kSeveralMax - 1) : 1;
  for (std::uint64_t i = 0; i < count; ++i) (this->*kKinds[world_.rng() % std::size(kKinds)])(agent);
  calls_.Run();
  asks_several_ = false;
}

void SimulatedClients::RequestInsert(AgentId agent) {
  proto::ControlRequest request;
  for (std::uint64_t i = 0; i <= world_.rng() % kSamplesMax; ++i) {
    *request.mutable_insert()->add_records() = Sample(std::to_string(world_.rng()));
  }
  SendAnyWay(agent, request);
}

void SimulatedClients::RequestTooManyInserts(AgentId agent) {
  proto::ControlRequest request;
  *request.mutable_insert()->add_records() = Sample("good");
  *request.mutable_insert()->add_records() = Sample(std::string(kSampleBytesMax + 1, 'x'));
  Send(agent, request, [this](const Answer& answer) {
    if (!IsError(answer.reply.error())) world_.Violate("answer_true", "an insert of too much succeeds");
  });
}

void SimulatedClients::RequestPage(AgentId agent) {
  static constexpr DataType kTypes[] = {kSample, kBeacon, proto::POWER, proto::AGENT_EVENT, proto::POSE_GRAPH_NODE};
  proto::ControlRequest request;
  request.mutable_read()->add_data_types(kTypes[world_.rng() % std::size(kTypes)]);
  request.mutable_read()->set_records_max(kPageRecords);
  request.mutable_read()->set_is_newest_first(world_.rng() % 2 == 0);
  SendAnyWay(agent, request, [this, agent](const Answer& answer) {
    for (const proto::StoredRecord& record : answer.reply.read().records()) {
      if (record.key().seq() != 0) world_.invariants.ObserveRecord(FromProto(record.key()), record.content(), agent);
    }
  });
}

// Requests the newest sample, then waits for newer samples.
void SimulatedClients::RequestChanges(AgentId agent) {
  proto::ControlRequest request;
  request.mutable_read()->add_data_types(kSample);
  request.mutable_read()->set_records_max(1);
  request.mutable_read()->set_is_newest_first(true);
  Send(agent, request, [this, agent](const Answer& newest) {
    if (!newest.is_at_once || newest.reply.read().row_ids().empty()) return;
    proto::ControlRequest news;
    news.mutable_read()->add_data_types(kSample);
    news.mutable_read()->set_after_row_id(newest.reply.read().row_ids(0));
    news.mutable_read()->set_wait_s(kWait_s);
    Send(agent, news, [this](const Answer& answer) {
      const bool is_in_time = !answer.reply.read().records().empty() && answer.took > Duration::zero();
      if (is_in_time) world_.rare_states.Count("feed_in_time");
    });
  });
}

void SimulatedClients::RequestWhatStands(AgentId agent) {
  proto::ControlRequest request;
  switch (world_.rng() % 3) {
    case 0:
      request.mutable_status();
      break;
    case 1:
      request.mutable_role_show()->set_with_history(true);
      break;
    default:
      request.mutable_have();
  }
  SendAnyWay(agent, request);
}

// Sends a random request of a kind whose answers are not checked.
void SimulatedClients::RequestSights(AgentId agent) {
  proto::ControlRequest request;
  switch (world_.rng() % 7) {
    case 0:
      request.mutable_share_status();
      break;
    case 1:
      request.mutable_graph_stats();
      break;
    case 2:
      request.mutable_trace()->set_events_max(20);
      break;
    case 3:
      request.mutable_map_stats();
      break;
    case 4:
      request.mutable_verify()->set_part(proto::VERIFY_PART_ROWS);
      break;
    case 5:
      request.mutable_acknowledge()->set_until_ns(std::max<std::int64_t>(1, world_.ClockOf(agent)));
      break;
    default:
      request.mutable_map_why()->set_x_m(100 * world_.Draw());
      request.mutable_map_why()->set_y_m(100 * world_.Draw());
  }
  SendAnyWay(agent, request);
}

// Sends the requests one at a time, so each answer can be checked.
void SimulatedClients::RequestMaps(AgentId) {
  calls_.Run();
  asks_several_ = false;
  for (AgentId agent = 1; agent <= world_.base; ++agent) CheckMap(agent);
}

void SimulatedClients::RequestNewTiles(AgentId agent) {
  proto::ControlRequest request;
  *request.mutable_map_tiles() = maps_.NextTiles(agent);
  request.mutable_map_tiles()->set_wait_s(60 * world_.Draw());
  Send(agent, request, [this](const Answer& answer) {
    const bool is_in_time = !answer.reply.map_tiles().tiles().empty() && answer.took > Duration::zero();
    if (is_in_time) world_.rare_states.Count("tiles_in_time");
  });
}

void SimulatedClients::RequestSolve(AgentId agent) {
  const std::set<AgentId> leaders = world_.Leaders();
  const AgentId asked = leaders.empty() || world_.rng() % 4 == 0 ? agent : *leaders.begin();
  proto::ControlRequest request;
  request.mutable_optimize()->set_from_scratch(world_.rng() % 8 == 0);
  Send(asked, request, [this, asked](const Answer& answer) {
    if (answer.is_at_once && !IsError(answer.reply.error())) CheckSolved(asked, answer.reply.optimize());
  });
}

void SimulatedClients::RequestSwap(AgentId agent) {
  if (agent == world_.byzantine) return;  // Honest operators change no roles through the Byzantine agent.
  proto::ControlRequest request;
  request.mutable_role_set()->set_is_swap(true);
  request.mutable_role_set()->set_is_dry_run(world_.rng() % 2 == 0);
  request.mutable_role_set()->set_reason("a simulated client");
  const std::set<AgentId> leaders = world_.Leaders();
  if (leaders.empty() || request.role_set().is_dry_run() || world_.rng() % 2 == 0) return SendAnyWay(agent, request);
  asks_several_ = true;
  RequestAmidChange(*leaders.begin(), request);
}

// Makes the leader solve, merge and execute `change` at the same instant.
void SimulatedClients::RequestAmidChange(AgentId leader, const proto::ControlRequest& change) {
  proto::ControlRequest solve;
  solve.mutable_optimize();
  proto::ControlRequest merge;
  *merge.mutable_merge() = Everything();
  Send(leader, solve);
  Send(leader, merge);
  Send(leader, change);
}

// When the leader sends the first fragment of a large record, swaps the roles in half of the cases. The survivor then
// has only this fragment.
void SimulatedClients::OnRadio(AgentId from, const proto::Message& message) {
  const bool is_first_fragment = message.batch().has_fragment() && message.batch().fragment().first_byte() == 0;
  if (!is_first_fragment || message.source_actor() != actor_name::kReplica || !world_.Leaders().contains(from)) return;
  if (world_.is_quiet || world_.rng() % kSwapAmidFragmentsEvery != 0) return;
  world_.In(seconds(0), [this, from] { SwapAmidFragments(from); });
}

void SimulatedClients::SwapAmidFragments(AgentId leader) {
  if (world_.is_quiet) return;
  asks_several_ = true;
  proto::ControlRequest swap;
  swap.mutable_role_set()->set_is_swap(true);
  swap.mutable_role_set()->set_reason("a simulated client, amid a large record");
  Send(leader, swap);
  calls_.Run();
  asks_several_ = false;
}

void SimulatedClients::RequestLease(AgentId agent) {
  proto::ControlRequest request;
  request.mutable_lease()->set_kind(agent == world_.base ? proto::LEASE_KIND_PAUSED : proto::LEASE_KIND_DRIVING);
  request.mutable_lease()->set_seconds(static_cast<double>(world_.rng() % 60));
  SendAnyWay(agent, request);
}

void SimulatedClients::RequestPrune(AgentId agent) {
  static const FaultKind kPrune = *std::find_if(FaultKinds().begin(), FaultKinds().end(),
                                                [](const FaultKind& kind) { return kind.name == "prune"; });
  proto::ControlRequest request;
  proto::PruneOrder& order = *request.mutable_prune();
  order.set_is_dry_run(world_.options.FaultsPerHour(kPrune) <= 0 || world_.rng() % 2 == 0);
  order.set_occluded_maps(world_.rng() % 2 == 0);
  if (!order.occluded_maps()) order.set_older_than_s(600 + 1200 * world_.Draw());
  Send(agent, request);
}

// Sends a request that cannot succeed or that clients may not send.
void SimulatedClients::RequestWrongly(AgentId agent) {
  proto::ControlRequest request;
  switch (world_.rng() % 8) {
    case 0:
      request.mutable_prune()->set_older_than_s(-1);
      break;
    case 1:
      request.mutable_role_set();
      break;
    case 2:
      request.mutable_share();
      break;
    case 3:
      request.mutable_status();
      request.set_for_agent(world_.base + 1);
      break;
    case 4:
      request.mutable_custom()->set_actor("nobody");
      break;
    case 5:
      request.mutable_map_why()->set_x_m(1e12);
      break;
    case 6:
      request.mutable_status();
      request.set_team_id(std::string(16, 'x'));
      break;
    default:
      request.mutable_downlink()->set_bytes_max(1);
  }
  Send(agent, request, [this, request](const Answer& answer) {
    if (!IsError(answer.reply.error())) world_.Violate("answer_true", "a wrong " + NameOf(request) + " succeeds");
  });
}

// --- Requests and answers ---

void SimulatedClients::Send(AgentId agent, proto::ControlRequest request, ClientCalls::Then then) {
  if (!world_.team.is_running(agent)) return;
  const std::optional<HaveSet> before = asks_several_ ? std::nullopt : world_.HaveOf(agent);
  calls_.Ask(agent, request, [this, agent, request, before, then = std::move(then)](const Answer& answer) {
    CheckAnswer(agent, request, before, answer);
    if (then) then(answer);
  });
}

void SimulatedClients::SendAnyWay(AgentId agent, proto::ControlRequest request, ClientCalls::Then then) {
  const AgentId other = world_.DrawOther(agent);
  if (world_.rng() % kOtherWayEvery != 0 || !world_.team.is_running(other)) {
    return Send(agent, std::move(request), std::move(then));
  }
  request.set_for_agent(agent);
  calls_.Ask(other, request, [this, then = std::move(then)](const Answer& answer) {
    if (answer.reply.error().text().find("disconnected before it answered") != std::string::npos) {
      world_.rare_states.Count("relay_lost");
    }
    if (then) then(answer);
  });
}

void SimulatedClients::CheckAnswer(AgentId agent, const proto::ControlRequest& request,
                                   const std::optional<HaveSet>& before, const Answer& answer) {
  if (!answer.is_at_once || IsError(answer.reply.error()) || !before) return;
  const std::optional<HaveSet> after = world_.HaveOf(agent);
  if (!after || !world_.roles.contains(agent)) return;
  const AgentFacts facts{agent, *before, *after, world_.roles[agent], world_.durable_term[agent]};
  const std::optional<std::string> wrong = WhyUntrue(request, answer.reply, facts);
  if (wrong) world_.Violate("answer_true", "agent " + std::to_string(agent) + ", " + NameOf(request) + ": " + *wrong);
}

// Checks that `leader` stores at least as many poses of its newest run as `reply` reports. Exempts the Byzantine agent.
void SimulatedClients::CheckSolved(AgentId leader, const proto::OptimizeReply& reply) {
  if (leader == world_.byzantine) return;
  std::map<std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>, double> counts;
  for (const auto& [key, content] : world_.ReadAll(leader)) {
    proto::Record record;
    if (key.stream.type != proto::OPTIMIZED_POSE || key.stream.origin == world_.byzantine) continue;
    if (!record.ParseFromString(content)) continue;
    ++counts[{OrderOf(record.optimized_pose().term()), record.optimized_pose().run()}];
  }
  const double newest_count = counts.empty() ? 0 : counts.rbegin()->second;
  if (reply.updated_pose_count() <= newest_count) return;
  world_.Violate("answer_true", "agent " + std::to_string(leader) + " optimizes " +
                                    std::to_string(reply.updated_pose_count()) + " poses and stores " +
                                    std::to_string(newest_count));
}

// --- Maps ---

void SimulatedClients::CheckMap(AgentId agent) {
  proto::ControlRequest tiles;
  *tiles.mutable_map_tiles() = maps_.NextTiles(agent);
  const auto is_followed = std::make_shared<bool>(false);
  Send(agent, tiles, [this, agent, is_followed](const Answer& answer) {
    *is_followed = answer.is_at_once && !IsError(answer.reply.error());
    if (!*is_followed) return;
    if (const auto wrong = maps_.OnTiles(agent, answer.reply.map_tiles())) world_.Violate("map_of_records", *wrong);
  });
  calls_.Run();
  if (!*is_followed) return;
  proto::ControlRequest merge;
  *merge.mutable_merge() = Everything();
  Send(agent, merge, [this, agent](const Answer& answer) {
    const std::optional<HaveSet> have = world_.HaveOf(agent);
    if (!answer.is_at_once || IsError(answer.reply.error()) || !have) return;
    const auto wrong = maps_.OnMap(agent, *have, Everything(), answer.reply.merge());
    if (wrong) world_.Violate("map_of_records", *wrong);
  });
  calls_.Run();
}

// --- Bundles ---

// Sends a random downlink request, mostly to the base station, which has the link to the ground station.
void SimulatedClients::RequestBundles(AgentId agent) {
  const AgentId asked = world_.rng() % 4 == 0 ? agent : world_.base;
  proto::DownlinkRequest order;
  const std::uint64_t draw = world_.rng() % 8;
  if (draw < 3) order.set_bytes_max(kBundleBytesLeast + world_.rng() % kBundleBytesSpan);
  if (draw == 5 || draw == 6) order.set_acknowledge(bundles_[asked].FetchedBundle());
  Order(asked, order);
}

void SimulatedClients::Order(AgentId agent, const proto::DownlinkRequest& order) {
  proto::ControlRequest request;
  *request.mutable_downlink() = order;
  bundles_[agent].OnAsked(order);
  Send(agent, request, [this, agent, order](const Answer& answer) { OnDownlinkReply(agent, order, answer); });
}

void SimulatedClients::OnDownlinkReply(AgentId agent, const proto::DownlinkRequest& order, const Answer& answer) {
  BundleChecker& checker = bundles_[agent];
  const proto::ControlReply& reply = answer.reply;
  const bool is_unknown = reply.error().code() == proto::ERROR_CODE_NOT_FOUND;
  if (is_unknown && order.acknowledge() != 0) return Report(agent, checker.OnNotFound(order.acknowledge()));
  if (IsError(reply.error())) return;
  if (order.acknowledge() != 0 && checker.OutlivedProcess(order.acknowledge())) {
    world_.rare_states.Count("bundle_outlives");
  }
  Report(agent, checker.OnReply(order, reply.downlink(), answer.is_at_once));
  FetchUnknown(agent);
}

void SimulatedClients::FetchUnknown(AgentId agent) {
  if (const std::uint32_t number = bundles_[agent].UnknownBundle(); number != 0) Fetch(agent, number, "");
}

void SimulatedClients::Fetch(AgentId agent, std::uint32_t number, const std::string& begin) {
  proto::ControlRequest request;
  request.mutable_read_bundle()->set_number(number);
  request.mutable_read_bundle()->set_first_byte(begin.size());
  Send(agent, request, [this, agent, number, begin](const Answer& answer) {
    const proto::ReadBundleReply& reply = answer.reply.read_bundle();
    if (IsError(answer.reply.error())) return;
    const std::string file = begin + reply.part();
    if (static_cast<double>(file.size()) < reply.bundle().bytes() && !reply.part().empty()) {
      return Fetch(agent, number, file);
    }
    const BundleChecker::Broken broken = bundles_[agent].OnFile(number, file);
    if (broken) return Report(agent, broken);
    FetchUnknown(agent);
  });
}

void SimulatedClients::Report(AgentId agent, const BundleChecker::Broken& broken) {
  if (broken) world_.Violate(broken->first, "agent " + std::to_string(agent) + ": " + broken->second);
}

// --- Quiescent team ---

// Checks each agent's map before and after a restart of its MergeActor. The restarted actor reads all records again,
// and must build the same map.
void SimulatedClients::CheckQuiescent() {
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    CheckMap(agent);
    world_.team.CrashActor({agent, actor_name::kMerge});
    CheckMap(agent);
  }
  CheckMapsAreAlike();
  CheckBundlesWhenIdle(world_.base);
}

// With the policies that bring each rover all records of the merged map, all rovers merge the same one. Two kinds of
// rovers are excused: those that pruned nodes or maps, and those that hold what the leader lacks. After disks were
// lost, a plain rover may have the last copy of another agent's record, but the leader does not accept it from that
// rover.
void SimulatedClients::CheckMapsAreAlike() {
  const bool has_all = RoversPolicyOf(world_.config, proto::LOCAL_TRAVERSABILITY_MAP) == proto::POLICY_ALL &&
                       RoversPolicyOf(world_.config, proto::POSE_GRAPH_NODE) == proto::POLICY_ALL &&
                       RoversPolicyOf(world_.config, proto::OPTIMIZED_POSE) != proto::POLICY_NONE;
  const std::optional<HaveSet> leaders = world_.HaveOf(world_.roles[1].leader());
  if (!has_all || world_.byzantine != 0 || !leaders) return;
  const auto is_excused = [&](const auto& stream) {
    const auto& [key, seqs] = stream;
    const bool is_pose = key.type == proto::OPTIMIZED_POSE;
    if (!is_pose && key.type != proto::POSE_GRAPH_NODE && key.type != proto::LOCAL_TRAVERSABILITY_MAP) return false;
    const bool is_pruned = !is_pose && !seqs.dropped.is_empty();
    return is_pruned || !seqs.held.Minus(leaders->Get(key).Covered()).is_empty();
  };
  std::vector<AgentId> rovers;
  for (AgentId agent = 1; agent < world_.base; ++agent) {
    const std::optional<HaveSet> have = world_.HaveOf(agent);
    if (have && std::ranges::none_of(have->streams(), is_excused)) rovers.push_back(agent);
  }
  if (const auto wrong = maps_.WhyNotAlike(rovers)) world_.Violate("same_map", *wrong);
}

// Fetches and acknowledges all waiting bundles. Then orders bundles of the remaining records, and fetches and
// acknowledges these bundles. Reports records that are in no bundle.
void SimulatedClients::CheckBundlesWhenIdle(AgentId agent) {
  BundleChecker& checker = bundles_[agent];
  const auto order = [&](std::uint64_t bytes_max, std::uint32_t acknowledge) {
    proto::DownlinkRequest request;
    request.set_bytes_max(bytes_max);
    request.set_acknowledge(acknowledge);
    Order(agent, request);
    // Each fetched file triggers the request for the next file. Run until all files are fetched.
    for (int i = 0; i < kBundlesWhenIdleMax && (i == 0 || checker.UnknownBundle() != 0); ++i) calls_.Run();
  };
  order(0, 0);
  for (int i = 0; i < kBundlesWhenIdleMax && checker.FetchedBundle() != 0; ++i) order(0, checker.FetchedBundle());
  for (int i = 0; i < kBundlesWhenIdleMax; ++i) {
    order(kBundleBytesWhenIdle, 0);
    if (checker.FetchedBundle() == 0) break;
    order(0, checker.FetchedBundle());
  }
  HaveSet wanted;
  const std::optional<HaveSet> have = world_.HaveOf(agent);
  if (!have) return;
  for (const auto& [key, stream] : have->streams()) {
    if (GroundPolicyOf(world_.config, key.type) != proto::POLICY_NONE) wanted[key].held = stream.held;
  }
  Report(agent, checker.WhyLost(wanted));
}

void SimulatedClients::OnAgentEnded(AgentId agent) {
  calls_.Forget(agent);
  bundles_[agent].OnRestart();
}

}  // namespace moondb::simulation
