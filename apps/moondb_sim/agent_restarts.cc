#include "apps/moondb_sim/agent_restarts.h"

#include <iterator>
#include <memory>
#include <optional>

#include "actors/storage/have_ledger.h"
#include "actors/storage/own_epochs.h"
#include "actors/storage/storage_actor.h"
#include "apps/moondb_sim/disk_damage.h"
#include "proto/trace.pb.h"
#include "runtime/system_status.h"

namespace moondb::simulation {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

// After this time the transport reports a dead link as down. A working link carries a message at least every 30 s, and
// the transport waits 3 s longer.
constexpr Duration kLinkDeadline = seconds(33);
// A mailbox may queue at most this many messages, plus four per agent of the team. In a team of four, ten are usual.
constexpr double kMailboxMax = 48;

}  // namespace

AgentRestarts::AgentRestarts(SimulatedWorld& world, SimulatedRobots& robots) : world_(world), robots_(robots) {
  world_.disk.on_cut = [this](const std::string& prefix) { OnPowerCut(prefix); };
}

AgentRestarts::~AgentRestarts() {
  world_.disk.on_cut = [](const std::string&) {};
  for (AgentId agent = 1; agent <= world_.base; ++agent) world_.disk.CutPower(SimulatedWorld::Prefix(agent));
  for (AgentId agent = 1; agent <= world_.base; ++agent) world_.team.Crash(agent);
}

bool AgentRestarts::CheckStore(AgentId agent) {
  if (!world_.options.is_store_checked) return true;
  StorageActor::Options storage;
  storage.path = SimulatedWorld::PathOf(agent);
  storage.vfs = world_.disk.name();
  storage.self = agent;
  storage.team = world_.ConfigOf(agent);
  was_cut_ = false;
  const Result<std::unique_ptr<RecordStore>> store = RecordStore::Open(StorageActor::StoreOptions(storage));
  // A store that must be repaired or rebuilt cannot open before its disk accepts writes again.
  const bool is_broken = broken_.contains(agent) && world_.disk.IsInTrouble(SimulatedWorld::Prefix(agent));
  if (store) broken_.erase(agent);
  if (!store && !was_cut_ && !is_broken) {
    world_.Violate("starts", "agent " + std::to_string(agent) + " does not start: " + ToString(store.error()));
  }
  if (store && !(*store)->set_aside().empty()) damaged_.erase(agent);
  return store.has_value() && !was_cut_;
}

void AgentRestarts::Kill(AgentId agent) {
  if (world_.team.is_running(agent)) world_.disk.CutPower(SimulatedWorld::Prefix(agent));
}

void AgentRestarts::KillWithDisk(AgentId agent, const std::string& fault) {
  Kill(agent);
  disk_fault_[agent] = fault;
}

void AgentRestarts::KillFor(AgentId agent, Duration down) {
  if (!world_.team.is_running(agent)) return;
  down_for_[agent] = down;
  Kill(agent);
}

// Crashes the running agent whose files have the path prefix `prefix`. May be called while an actor handles a message.
void AgentRestarts::OnPowerCut(const std::string& prefix) {
  was_cut_ = true;
  for (AgentId agent = 1; agent <= world_.base; ++agent) {
    if (SimulatedWorld::Prefix(agent) != prefix || !world_.team.is_running(agent)) continue;
    CheckMailboxes(agent);
    world_.team.Crash(agent);
    OnEnded(agent);
  }
}

void AgentRestarts::OnEnded(AgentId agent) {
  robots_.OnAgentEnded(agent);
  world_.roles.erase(agent);
  if (on_end) on_end(agent);
  if (world_.rng() % 2 == 0) NotifyOthers(agent, false);
  to_restart_.insert(agent);
  const auto down = down_for_.find(agent);
  if (down != down_for_.end()) {
    world_.In(kLinkDeadline, [this, agent] {
      if (!world_.team.is_running(agent)) NotifyOthers(agent, false);
    });
    world_.In(down->second, [this, agent] { Restart(agent); });
    down_for_.erase(down);
    return;
  }
  world_.In(seconds(1) + world_.DrawDuration(minutes(2)), [this, agent] { Restart(agent); });
}

// Takes the links between `agent` and the other agents up or down, and notifies both agents of each link.
// Skips agents in `gone_`.
void AgentRestarts::NotifyOthers(AgentId agent, bool is_up) {
  if (is_up) gone_.erase(agent);
  if (!is_up) gone_.insert(agent);
  for (AgentId other = 1; other <= world_.base; ++other) {
    if (other != agent && !gone_.contains(other)) world_.team.SetLink(agent, other, is_up);
  }
}

void AgentRestarts::Restart(AgentId agent) {
  if (world_.team.is_running(agent)) return;
  const auto fault = disk_fault_.find(agent);
  if (fault != disk_fault_.end()) {
    BreakDisk(agent, fault->second);
    broken_.insert(agent);
    disk_fault_.erase(fault);
  } else if (world_.rng() % 4 == 0) {
    old_disks_[agent] = world_.disk.Save(SimulatedWorld::Prefix(agent));
  }
  if (!CheckStore(agent)) return world_.In(seconds(1), [this, agent] { Restart(agent); });
  to_restart_.erase(agent);
  failures_[agent] = world_.team.restarts(agent);
  world_.team.Restart(agent);
  robots_.OnAgentStarted(agent);
  NotifyOthers(agent, true);
  CheckHave(agent);
}

void AgentRestarts::BreakDisk(AgentId agent, const std::string& fault) {
  if (fault == "damage_record" || fault == "damage_interval") return BreakDatabase(agent, fault);
  const auto old = old_disks_.find(agent);
  if (fault == "damage") {
    world_.disk.Damage(SimulatedWorld::Prefix(agent));
    damaged_.insert(agent);
  } else if ((fault == "old_disk" || fault == "backup") && old != old_disks_.end()) {
    world_.disk.Restore(SimulatedWorld::Prefix(agent), old->second);
    if (fault == "backup") MarkBackup(agent);
  } else {
    world_.disk.Wipe(SimulatedWorld::Prefix(agent));
  }
  world_.invariants.ForgetDisk(agent);
  world_.invariants.ForgetRoles(agent);
  if (on_disk_lost) on_disk_lost(agent);
}

// Marks the agent's database as a backup, as `moonctl db backup` marks its copy. Leaves a damaged database unchanged.
void AgentRestarts::MarkBackup(AgentId agent) {
  world_.disk.CutPowerAfter(SimulatedWorld::Prefix(agent), 0);
  Result<std::unique_ptr<Database>> database = Database::Open(SimulatedWorld::PathOf(agent), 0, world_.disk.name());
  if (database && (*database)->QuickCheck()) (void)(*database)->Execute(kForgetIncarnationSql);
}

// Damages the agent's database: one record if `fault` is "damage_record", otherwise one interval of the have-set. The
// invariants still require the agent to hold all undamaged records.
void AgentRestarts::BreakDatabase(AgentId agent, const std::string& fault) {
  world_.disk.CutPowerAfter(SimulatedWorld::Prefix(agent), 0);
  // The disk must accept the writes that damage the database.
  world_.disk.SetRoom(SimulatedWorld::Prefix(agent), std::nullopt);
  world_.disk.SetFailing(SimulatedWorld::Prefix(agent), false);
  Result<std::unique_ptr<Database>> database = Database::Open(SimulatedWorld::PathOf(agent), 0, world_.disk.name());
  HaveLedger ledger;
  // Return if the database is already damaged, or if the agent lost power before it created the tables.
  if (!database || !(*database)->QuickCheck() || !ledger.Load(**database)) return;
  world_.invariants.ObserveHave(agent, ledger.have());
  if (fault == "damage_record") {
    const std::optional<RecordKey> key = DamageRecord(**database, world_.rng);
    if (key) world_.invariants.ForgetRecord(agent, *key);
  } else {
    const std::optional<DamagedInterval> damaged = DamageInterval(**database, world_.rng);
    if (damaged) world_.invariants.ForgetDropped(agent, damaged->stream.origin, damaged->stream.type);
  }
}

// Checks the agent's have-set. If the StorageActor does not answer, because it has just failed, tries again later.
void AgentRestarts::CheckHave(AgentId agent) {
  if (!world_.team.is_running(agent)) return;
  const std::optional<HaveSet> have = world_.HaveOf(agent);
  if (have) return world_.invariants.CheckHave(agent, *have);
  world_.In(seconds(10), [this, agent] { CheckHave(agent); });
}

// Reports a violation if an actor of the agent failed without an injected fault. Exempts the agents in `damaged_`.
// Schedules a restart of the agent if its process has ended.
void AgentRestarts::CheckFailures(AgentId agent) {
  const bool is_ended = !world_.team.is_running(agent) && !to_restart_.contains(agent);
  const bool is_failing = world_.team.restarts(agent) > failures_[agent];
  failures_[agent] = world_.team.restarts(agent);
  if ((is_ended || is_failing) && !damaged_.contains(agent)) {
    const proto::TraceReply trace = world_.team.GetTrace(agent);
    const std::string last =
        trace.dead_letters().empty() ? "none" : std::prev(trace.dead_letters().end())->ShortDebugString();
    world_.Violate("starts",
                   "an actor of agent " + std::to_string(agent) + " failed by itself; the last that failed: " + last);
  }
  if (is_ended) OnEnded(agent);
}

// Checks that the agent's mailboxes stayed within the limit and dropped no message. Exempts runs with a Byzantine
// agent, because it may flood mailboxes.
void AgentRestarts::CheckMailboxes(AgentId agent) {
  if (world_.byzantine != 0) return;
  for (const proto::ActorStatus& actor : world_.team.GetSystemStatus(agent).actors) {
    if (actor.queued_max() <= kMailboxMax + 4 * world_.base && actor.dropped() == 0) continue;
    world_.Violate("mailbox_bounded", "agent " + std::to_string(agent) + ": " + actor.ShortDebugString());
  }
}

}  // namespace moondb::simulation
