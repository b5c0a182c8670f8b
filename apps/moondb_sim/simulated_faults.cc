#include "apps/moondb_sim/simulated_faults.h"

#include <cmath>
#include <iterator>

#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr std::uint64_t kEndedEarlyEvery = 3;  // One lease in three is ended early.
constexpr std::uint64_t kStartsInTroubleEvery = 3;
// Leader and survivor receive a rover's maps within this time if the links are up.
constexpr Duration kBroughtWithin = minutes(5);
constexpr Duration kPrunedAfter = seconds(30);  // Time from FillDisk to the operator's prune.
constexpr Duration kFullForPrune = minutes(4);
constexpr Duration kGoesToSleep = seconds(3);  // Time between a rover's sleeping lease and its power cut.

}  // namespace

void SimulatedFaults::Start() {
  for (const FaultKind& kind : FaultKinds()) ScheduleFault(kind);
}

void SimulatedFaults::End() {
  fail_next_ = 0;
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    world_.disk.SetRoom(SimulatedWorld::Prefix(agent), std::nullopt);
    world_.disk.SetFailing(SimulatedWorld::Prefix(agent), false);
  }
  world_.team.radio() = RadioOptions();
  deaf_.clear();
  world_.team.Heal();
}

Fault SimulatedFaults::AtHandler(AgentId agent) {
  if (fail_next_ != agent || world_.is_asking) return Fault::kNone;
  fail_next_ = 0;
  restarts_.ObserveFailure(agent);
  constexpr Fault kFaults[] = {Fault::kBeforeHandler, Fault::kAtFirstSend, Fault::kAfterFirstSend,
                               Fault::kAfterHandler};
  return kFaults[world_.rng() % std::size(kFaults)];
}

void SimulatedFaults::ScheduleFault(const FaultKind& kind) {
  const double per_hour = world_.options.FaultsPerHour(kind);
  if (per_hour <= 0) return;
  const double wait_s = -std::log(1 - world_.Draw()) * 3600 / per_hour;
  world_.In(std::chrono::duration_cast<Duration>(std::chrono::duration<double>(wait_s)), [this, &kind] {
    if (world_.is_quiet) return;
    ++world_.report.faults[kind.name];
    Strike(kind.name);
    ScheduleFault(kind);
  });
}

void SimulatedFaults::Strike(const std::string& fault) {
  if (fault == "weather") return ChangeWeather();
  if (fault == "late_copy") return RepeatLate();
  if (fault == "cut") return Cut();
  if (fault == "one_way") return Deafen();
  if (fault == "partition") return Divide();
  if (fault == "kill") return restarts_.Kill(world_.DrawAgent());
  if (fault == "kill_in_write") return KillInWrite();
  if (fault == "fail") {
    fail_next_ = world_.DrawAgent();
    return;
  }
  if (fault == "wipe" || fault == "old_disk" || fault == "backup" || fault.starts_with("damage")) {
    return restarts_.KillWithDisk(world_.DrawAgent(), fault);
  }
  if (fault == "long_kill") return KillLong();
  if (fault == "drive") return Drive();
  if (fault == "sleep") return Sleep();
  if (fault == "pause") return Pause();
  if (fault == "prune") return Prune();
  if (fault == "full_prune") return FillAndPrune();
  if (fault == "policy") return ChangePolicy();
  if (fault == "full" || fault == "failing") return TroubleDisk(fault == "full");
  if (fault == "clock") {
    const AgentId agent = world_.DrawAgent();
    world_.clock_offset[agent] = world_.rng() % 2 == 0 ? std::chrono::hours(6) : -std::chrono::hours(24 * 365 * 56);
    return world_.team.SetUtcOffset(agent, world_.clock_offset[agent]);
  }
  if (fault == "swap") {
    proto::RoleSetRequest request;
    request.set_is_swap(true);
    return SetRoles(world_.DrawAgent(), request);
  }
  if (fault == "reassign") {
    proto::RoleSetRequest request;
    request.set_leader(DrawRover());
    request.set_survivor(request.leader() % (world_.base - 1) + 1);
    return SetRoles(world_.DrawAgent(), request);
  }
}

void SimulatedFaults::KillInWrite() {
  const std::string prefix = SimulatedWorld::Prefix(world_.DrawAgent());
  world_.disk.CutPowerAfter(prefix, 1 + static_cast<int>(world_.rng() % 60));
}

void SimulatedFaults::ChangeWeather() {
  RadioOptions& radio = world_.team.radio();
  radio.loss_ratio = world_.rng() % 3 == 0 ? 0 : 0.3 * world_.Draw();
  radio.duplicate_ratio = world_.rng() % 2 == 0 ? 0 : 0.1 * world_.Draw();
  radio.latency = milliseconds(1) + world_.DrawDuration(milliseconds(50));
  radio.latency_jitter = world_.rng() % 2 == 0 ? Duration::zero() : world_.DrawDuration(milliseconds(200));
  radio.bytes_per_second = world_.rng() % 4 == 0 ? 0 : 125'000 / (1 + 3 * world_.Draw());
}

void SimulatedFaults::RepeatLate() {
  world_.team.radio().duplicate_ratio = 0.1;
  world_.team.radio().duplicate_delay_max = minutes(10);
  world_.In(minutes(1) + world_.DrawDuration(minutes(10)), [this] {
    world_.team.radio().duplicate_ratio = 0;
    world_.team.radio().duplicate_delay_max = RadioOptions().duplicate_delay_max;
  });
}

void SimulatedFaults::Cut() {
  const AgentId a = world_.DrawAgent();
  const AgentId b = world_.DrawOther(a);
  world_.team.SetLink(a, b, false, world_.rng() % 2 == 0);
  world_.In(seconds(5) + world_.DrawDuration(minutes(5)), [this, a, b] { Join(a, b); });
}

void SimulatedFaults::Deafen() {
  const AgentId from = world_.DrawAgent();
  const AgentId to = world_.DrawOther(from);
  deaf_.insert({from, to});
  world_.In(seconds(5) + world_.DrawDuration(minutes(3)), [this, from, to] { deaf_.erase({from, to}); });
}

void SimulatedFaults::Divide() {
  std::set<AgentId> part;
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    if (world_.rng() % 2 == 0) part.insert(agent);
  }
  JoinParts(part);
  world_.In(minutes(1) + world_.DrawDuration(minutes(10)), [this] { JoinParts({}); });
}

void SimulatedFaults::Join(AgentId a, AgentId b) {
  if (!restarts_.is_gone(a) && !restarts_.is_gone(b)) world_.team.SetLink(a, b, true);
}

void SimulatedFaults::JoinParts(const std::set<AgentId>& part) {
  for (AgentId a = 1; a <= world_.base; ++a) {
    for (AgentId b = a + 1; b <= world_.base; ++b) {
      if (part.contains(a) == part.contains(b)) Join(a, b);
      if (part.contains(a) != part.contains(b)) world_.team.SetLink(a, b, false);
    }
  }
}

void SimulatedFaults::KillLong() {
  const std::set<AgentId> leaders = world_.Leaders();
  const AgentId any = world_.DrawAgent();
  const bool is_leader = world_.rng() % 2 == 0 && !leaders.empty();
  restarts_.KillFor(is_leader ? *leaders.begin() : any, minutes(5) + world_.DrawDuration(minutes(10)));
}

void SimulatedFaults::Drive() {
  const AgentId rover = DrawRover();
  const Duration length = seconds(10) + world_.DrawDuration(seconds(110));
  robots_.SetLease(rover, proto::LEASE_KIND_DRIVING, length);
  if (world_.rng() % kEndedEarlyEvery != 0) return;
  world_.In(world_.DrawDuration(length),
            [this, rover] { robots_.SetLease(rover, proto::LEASE_KIND_DRIVING, Duration::zero()); });
}

void SimulatedFaults::Sleep() {
  const AgentId rover = DrawRover();
  const Duration length = minutes(1) + world_.DrawDuration(minutes(19));
  robots_.SetLease(rover, proto::LEASE_KIND_SLEEPING, length);
  if (world_.rng() % 2 == 0) {
    return world_.In(kGoesToSleep, [this, rover, length] { restarts_.KillFor(rover, length - kGoesToSleep); });
  }
  if (world_.rng() % kEndedEarlyEvery != 0) return;
  world_.In(world_.DrawDuration(length),
            [this, rover] { robots_.SetLease(rover, proto::LEASE_KIND_SLEEPING, Duration::zero()); });
}

void SimulatedFaults::Pause() {
  const AgentId agent = world_.DrawAgent();
  const Duration length = seconds(10) + world_.DrawDuration(seconds(590));
  robots_.SetLease(agent, proto::LEASE_KIND_PAUSED, length);
  if (world_.rng() % kEndedEarlyEvery != 0) return;
  world_.In(world_.DrawDuration(length),
            [this, agent] { robots_.SetLease(agent, proto::LEASE_KIND_PAUSED, Duration::zero()); });
}

void SimulatedFaults::Prune() {
  const AgentId agent = world_.DrawAgent();
  proto::Message message;
  proto::PruneOrder& order = *message.mutable_prune_order();
  if (world_.rng() % 2 == 0) order.set_older_than_s(600 * world_.Draw());
  if (world_.rng() % 2 == 0) order.set_content_bytes_max(20'000 * world_.Draw());
  if (world_.rng() % 2 == 0) {
    order.add_data_types(proto::LOCAL_TRAVERSABILITY_MAP);
    order.add_data_types(proto::POSE_GRAPH_NODE);
  }
  (void)world_.team.Post({agent, "operator"}, {agent, actor_name::kRetention}, std::move(message));
}

void SimulatedFaults::FillAndPrune() {
  const AgentId rover = DrawRover();
  robots_.LearnPlainMaps(rover);
  world_.In(kBroughtWithin, [this, rover] {
    if (world_.is_quiet) return;
    FillDisk(rover, kFullForPrune);
    world_.In(kPrunedAfter, [this, rover] {
      if (world_.is_quiet) return;
      world_.freed_on_full_disk[rover] = {};
      proto::Message message;
      message.mutable_prune_order()->add_data_types(proto::LOCAL_TRAVERSABILITY_MAP);
      (void)world_.team.Post({rover, "operator"}, {rover, actor_name::kRetention}, std::move(message));
    });
    world_.In(kFullForPrune, [this, rover] { world_.freed_on_full_disk.erase(rover); });
  });
}

void SimulatedFaults::FillDisk(AgentId agent, Duration length) {
  const std::string prefix = SimulatedWorld::Prefix(agent);
  world_.disk_trouble_until[agent] = std::max(world_.disk_trouble_until[agent], world_.team.now() + length);
  world_.disk.SetRoom(prefix, 0);
  // Another program may take the room that a prune has freed.
  world_.freed_on_full_disk.erase(agent);
  world_.In(length, [this, prefix] { world_.disk.SetRoom(prefix, std::nullopt); });
}

void SimulatedFaults::ChangePolicy() {
  const AgentId agent = world_.DrawAgent();
  if (world_.keeps_all_notes.insert(agent).second) restarts_.Kill(agent);
}

void SimulatedFaults::TroubleDisk(bool is_full) {
  const AgentId agent = world_.DrawAgent();
  const std::string prefix = SimulatedWorld::Prefix(agent);
  const Duration length = minutes(1) + world_.DrawDuration(minutes(9));
  if (world_.rng() % kStartsInTroubleEvery == 0) restarts_.Kill(agent);
  if (is_full) return FillDisk(agent, length);
  world_.disk_trouble_until[agent] = std::max(world_.disk_trouble_until[agent], world_.team.now() + length);
  world_.disk.SetFailing(prefix, true);
  world_.In(length, [this, prefix] { world_.disk.SetFailing(prefix, false); });
}

AgentId SimulatedFaults::DrawRover() { return 1 + static_cast<AgentId>(world_.rng() % (world_.base - 1)); }

// Honest operators give the Byzantine agent no role, and change no roles through it.
void SimulatedFaults::SetRoles(AgentId agent, proto::RoleSetRequest request) {
  if (world_.byzantine != 0 &&
      (agent == world_.byzantine || request.leader() == world_.byzantine || request.survivor() == world_.byzantine)) {
    return;
  }
  proto::Message message;
  *message.mutable_role_set_request() = std::move(request);
  (void)world_.team.Post({agent, "operator"}, {agent, actor_name::kRole}, std::move(message));
}

}  // namespace moondb::simulation
