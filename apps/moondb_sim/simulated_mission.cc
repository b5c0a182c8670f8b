#include "apps/moondb_sim/simulated_mission.h"

#include <xxhash.h>

#include <array>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "apps/moondb_agent/standard_actors.h"
#include "apps/moondb_sim/agent_restarts.h"
#include "apps/moondb_sim/budget_checker.h"
#include "apps/moondb_sim/byzantine_agent.h"
#include "apps/moondb_sim/byzantine_checker.h"
#include "apps/moondb_sim/client_message.h"
#include "apps/moondb_sim/done_checker.h"
#include "apps/moondb_sim/failover_checker.h"
#include "apps/moondb_sim/lease_checker.h"
#include "apps/moondb_sim/own_inserts.h"
#include "apps/moondb_sim/prune_checker.h"
#include "apps/moondb_sim/quiescence_checks.h"
#include "apps/moondb_sim/session_checker.h"
#include "apps/moondb_sim/simulated_clients.h"
#include "apps/moondb_sim/simulated_config.h"
#include "apps/moondb_sim/simulated_faults.h"
#include "apps/moondb_sim/simulated_robots.h"
#include "apps/moondb_sim/simulated_world.h"
#include "model/check.h"
#include "model/data_types.h"
#include "model/record_check.h"
#include "model/term.h"
#include "runtime/team/record_signature.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_config.h"

namespace moondb::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr double kMessagesMaxPerHour = 50'000;  // Limit for each agent; 500 is usual.
constexpr Duration kSharePeriod = seconds(60);
constexpr Duration kInspectPeriod = minutes(1);
constexpr double kQuietRatio = 1.0 / 6;  // Fraction at the end of the run that has no faults.

// Least simulated time between solves. A solve takes more computing time than all other work in a simulated minute.
constexpr Duration kSolveApart = minutes(5);

constexpr std::uint64_t kConfigHash = 1;
// After a prune has freed this many bytes of content on a full disk, the agent must store records again. More than
// twice the bytes that an agent with a full disk reserves for roles.
constexpr double kFreedBytesMin = 768 * 1024;
// Page size of have-sets in one seed of two. With the default size, the have-set after an hour would fit into one page.
constexpr std::size_t kSmallPageBytes = 1000;
// Actors that SimulatedActors::kSharing leaves out.
const std::set<std::string> kNoPartOfSharing = {actor_name::kEvent, actor_name::kDownlink, actor_name::kPgo,
                                                actor_name::kMerge, actor_name::kGateway};

class Mission {
 public:
  explicit Mission(const SimOptions& options)
      : world_(options),
        robots_(world_),
        restarts_(world_, robots_),
        faults_(world_, robots_, restarts_),
        clients_(world_),
        done_(world_),
        byzantine_checker_(world_.byzantine, [this](const std::string& rule,
                                                    std::string text) { world_.Violate(rule, std::move(text)); }),
        byzantine_(world_, byzantine_checker_),
        rest_(world_, restarts_, clients_, byzantine_checker_, prunes_),
        messages_max_(static_cast<std::uint64_t>(kMessagesMaxPerHour * options.hours * world_.base)) {
    restarts_.on_end = [this](AgentId agent) { OnAgentEnded(agent); };
    restarts_.on_disk_lost = [this](AgentId agent) {
      clients_.OnDiskLost(agent);
      done_.OnDiskLost(agent);
      world_.freed_on_full_disk.erase(agent);
    };
    world_.team.SetBaseStation(world_.base);
    world_.team.SetFault(
        [this](const Address& actor, const proto::Message& message) { return OnHandle(actor, message); });
    world_.team.SetFilter(
        [this](AgentId from, AgentId to, const proto::Message& message) { return OnRadio(from, to, message); });
    for (AgentId agent = 1; agent <= world_.base; ++agent) {
      world_.team.AddAgent(agent);
      // Four sessions per peer: sync and replication, in both directions.
      const double burst_bytes =
          4.0 * (world_.base - 1) * static_cast<double>(world_.options.session.unacked_bytes_max);
      prunes_.emplace(agent, PruneChecker(agent));
      budgets_.emplace(agent, BudgetChecker(world_.options.BudgetKbps() * 1000 / 8, burst_bytes));
    }
    for (AgentId agent = 1; agent <= world_.base; ++agent) {
      Check(restarts_.CheckStore(agent), "an empty disk can be written");
      Forget(agent);
      SpawnActors(agent);
    }
  }

  SimReport Run() {
    const Duration length =
        std::chrono::duration_cast<Duration>(std::chrono::duration<double, std::ratio<3600>>(world_.options.hours));
    const MonotonicTime end = world_.start + length;
    const MonotonicTime quiet_from =
        end - Duration(static_cast<Duration::rep>(kQuietRatio * static_cast<double>(length.count())));
    late_from_ = end - 2 * kSharePeriod;
    robots_.Start();
    world_.At(world_.start + seconds(30), [this] { Operate(); });
    world_.At(world_.start + kInspectPeriod, [this] { Inspect(); });
    faults_.Start();
    byzantine_.Start();
    if (world_.options.has_all_actors()) clients_.Start();
    world_.At(quiet_from, [this] { BecomeQuiet(); });
    while (!world_.schedule.empty() && !world_.HasEnough() && !is_stormy_) {
      const auto next = world_.schedule.begin();
      if (next->first > EndFrom(end)) break;
      const auto action = std::move(next->second);
      AdvanceTo(next->first);
      world_.schedule.erase(next);
      action();
    }
    if (world_.report.violations.empty()) {
      AdvanceTo(EndFrom(end));
      rest_.Check();
    }
    world_.report.radio_bytes = world_.team.radio_bytes();
    world_.report.rare = world_.rare_states.counts();
    world_.report.trace_hash = XXH64(&hash_, sizeof hash_, world_.team.trace_hash());
    if (world_.options.measures_refill && world_.report.violations.empty()) MeasureRefill();
    return std::move(world_.report);
  }

 private:
  // Advances time. Stops at each instant at which an answer to the operator arrives, and checks the answer.
  void AdvanceTo(MonotonicTime time) {
    while (time > world_.team.now() &&
           world_.team.RunUntil([this] { return done_.HasAnswers(); }, time - world_.team.now())) {
      done_.CheckAnswers();
    }
    world_.AdvanceTo(time);
  }

  // Returns `end`, or a later time if a leader solved shortly before. The leader then has time to replicate the results
  // to its survivor.
  MonotonicTime EndFrom(MonotonicTime end) const {
    return std::min(std::max(end, derived_at_ + 2 * kSharePeriod), end + 10 * kSharePeriod);
  }

  // --- Actors of the team ---

  std::vector<StandardActor> ActorsOf(AgentId agent, const proto::TeamConfig& config) {
    StandardActorOptions options;
    options.storage.path = SimulatedWorld::PathOf(agent);
    options.storage.vfs = world_.disk.name();
    options.storage.is_checked = true;  // AgentRestarts::CheckStore has checked the store.
    options.sharing.session = world_.options.session;
    if (world_.options.seed % 2 == 0) options.sharing.have_page_bytes_max = kSmallPageBytes;
    options.pgo.solver.thread_count = 1;
    options.pgo.solve_apart = kSolveApart;
    options.merge.backend = MergeBackend::kCpu;
    if (world_.options.seed % 3 == 0) options.merge.maps_max = kFewMaps;
    options.gateway.timeout = kClientTimeout;
    options.gateway.long_timeout = kLongClientTimeout;
    if (HasSigningKeys(world_.config)) {
      options.role.sign = [this, key = SigningKeyOf(agent)](const proto::RoleAssignment& roles) {
        return key.Sign(SignedBytes(world_.config, roles));
      };
      options.storage.sign = [this, key = SigningKeyOf(agent)](const RecordKey& name, const proto::Record& record) {
        return key.Sign(SignedBytes(world_.config, name, record));
      };
    }
    return StandardActors(config, agent, kConfigHash, std::move(options));
  }

  void SpawnActors(AgentId agent) {
    const std::vector<StandardActor> actors = ActorsOf(agent, world_.config);
    const std::vector<StandardActor> with_all_notes = ActorsOf(agent, world_.config_with_all_notes);
    for (std::size_t i = 0; i < actors.size(); ++i) {
      const std::string& name = actors[i].name;
      if (!world_.options.has_all_actors() && kNoPartOfSharing.contains(name)) continue;
      const auto make = [this, agent, before = actors[i], after = with_all_notes[i]]() -> std::unique_ptr<Actor> {
        std::unique_ptr<Actor> made = (world_.keeps_all_notes.contains(agent) ? after : before).factory();
        return world_.options.wrap ? world_.options.wrap(agent, before.name, std::move(made)) : std::move(made);
      };
      world_.team.Spawn(agent, name, make);
    }
  }

  // --- Observed messages ---

  Fault OnHandle(const Address& actor, const proto::Message& message) {
    if (++world_.report.messages == messages_max_) {
      world_.Violate("comes_to_rest", std::to_string(messages_max_) + " messages and no end");
      is_stormy_ = true;
    }
    const std::array<std::uint64_t, 4> step = {
        actor.agent, static_cast<std::uint64_t>(message.body_case()), message.request_id(),
        static_cast<std::uint64_t>(world_.team.now().time_since_epoch().count())};
    hash_ = XXH64(step.data(), sizeof step, hash_);
    world_.AddEvent(actor, message);
    byzantine_.OnHandle(actor, message);
    See(actor, message);
    WatchWindows(actor, message);
    world_.rare_states.OnHandle(actor, message);
    const Fault fault = faults_.AtHandler(actor.agent);
    if (fault != Fault::kNone) {
      if (actor.actor == actor_name::kGateway) clients_.OnGatewayFailed(actor.agent);
      if (actor.actor == actor_name::kRole) world_.invariants.ForgetUnstoredRoles(actor.agent);
      leases_.at(actor.agent).OnFailure(actor.actor);
      failovers_.at(actor.agent).OnFailure(actor.actor, world_.team.now());
    }
    return fault;
  }

  bool IsByzantine(AgentId agent) const { return agent != 0 && agent == world_.byzantine; }

  void ObserveRoles(AgentId agent, const proto::RoleAssignment& roles) {
    byzantine_checker_.OnRoles(agent, roles);
    world_.invariants.ObserveRoles(agent, roles, /*is_durable=*/!IsNewer(roles.term(), world_.durable_term[agent]));
  }

  void See(const Address& actor, const proto::Message& message) {
    switch (message.body_case()) {
      case proto::Message::kStoreRequest:
        byzantine_checker_.OnStoreRequest(actor.agent, message);
        store_senders_[{actor.agent, message.request_id()}] = static_cast<AgentId>(message.store_request().sender());
        if (IsByzantine(static_cast<AgentId>(message.store_request().sender()))) break;
        for (const proto::StoredRecord& record : message.store_request().records()) ObserveRecord(record, actor.agent);
        break;
      case proto::Message::kStoreReply: {
        const auto asked = store_senders_.extract({actor.agent, message.request_id()});
        const AgentId sender = asked.empty() ? 0 : asked.mapped();
        if (IsError(message.store_reply().error()) && world_.HadDiskTrouble(actor.agent)) {
          world_.rare_states.Count("batch_on_bad_disk");
        }
        if (byzantine_checker_.OnStoreReply(actor.agent, message) || IsByzantine(actor.agent)) break;
        if (message.store_reply().rejected_count() == 0) break;
        // An agent with little room refuses records of an origin that takes more than its share of the room.
        if (world_.HadDiskTrouble(actor.agent)) break;
        if (HasSigningKeys(world_.config) && world_.invariants.HasHadRole(sender)) break;
        world_.Violate("nothing_refused", "agent " + std::to_string(actor.agent) + " refuses " +
                                              std::to_string(message.store_reply().rejected_count()) +
                                              " records of agent " + std::to_string(sender));
        break;
      }
      case proto::Message::kInsertRequest:
        if (actor.actor == actor_name::kStorage && world_.options.has_all_actors()) {
          own_inserts_.OnRequest(actor.agent, message);
        }
        break;
      case proto::Message::kInsertReply:
        ObserveInserted(actor.agent, message);
        break;
      case proto::Message::kRoleShowReply:
        if (actor.actor == actor_name::kRetention) prunes_.at(actor.agent).OnRoles(message.role_show_reply().roles());
        break;
      case proto::Message::kPruneRequest:
        prunes_.at(actor.agent).OnPruneRequest();
        break;
      case proto::Message::kPruneReply:
        for (const proto::PrunedType& pruned : message.prune_reply().pruned()) {
          if (actor.actor == actor_name::kRetention) world_.report.pruned += pruned.record_count();
        }
        ObserveFreed(actor, message.prune_reply());
        break;
      case proto::Message::kHave:
        if (IsByzantine(static_cast<AgentId>(message.hop_sender()))) break;
        checkers_[{actor.agent, actor.actor, message.hop_sender()}].OnHave(message.have());
        break;
      case proto::Message::kRolesChanged:
        if (world_.roles[actor.agent].SerializeAsString() != message.roles_changed().roles().SerializeAsString()) {
          done_.OnRoles(actor.agent);
        }
        world_.roles[actor.agent] = message.roles_changed().roles();
        ObserveRoles(actor.agent, message.roles_changed().roles());
        break;
      case proto::Message::kLoadRolesReply: {
        const auto& history = message.load_roles_reply().history();
        world_.durable_term[actor.agent] = history.empty() ? proto::Term() : history.rbegin()->term();
        break;
      }
      case proto::Message::kSaveRolesRequest:
        saving_term_[actor.agent] = message.save_roles_request().roles().term();
        byzantine_checker_.OnRolesStored(actor.agent, message.save_roles_request().roles());
        break;
      case proto::Message::kSaveRolesReply:
        if (!IsError(message.save_roles_reply().error())) world_.durable_term[actor.agent] = saving_term_[actor.agent];
        break;
      default:
        break;
    }
  }

  void ObserveFreed(const Address& actor, const proto::PruneReply& reply) {
    const auto known = world_.freed_on_full_disk.find(actor.agent);
    if (actor.actor != actor_name::kRetention || known == world_.freed_on_full_disk.end()) return;
    SimulatedWorld::FreedOnFullDisk& freed = known->second;
    for (const proto::PrunedType& pruned : reply.pruned()) freed.content_bytes += pruned.content_bytes();
    if (freed.since || freed.content_bytes < kFreedBytesMin) return;
    freed.since = world_.team.now();
  }

  // Call when an actor of the agent handles the reply to its insert. Used only with SimulatedActors::kAll. Otherwise
  // only robots insert, and SimulatedRobots reports their inserts.
  void ObserveInserted(AgentId agent, const proto::Message& message) {
    if (!world_.options.has_all_actors()) return;
    for (const auto& [key, record] : own_inserts_.OnReply(agent, message)) {
      world_.invariants.ObserveInserted(agent, key, record);
      if (record.has_agent_event() && world_.team.now() > late_from_) world_.invariants.ExcuseLate(key);
      if (IsDerived(TypeOf(record))) derived_at_ = world_.team.now();
    }
  }

  void OnAgentEnded(AgentId agent) {
    Forget(agent);
    if (own_inserts_.Forget(agent)) world_.rare_states.Count("insert_unanswered");
    clients_.OnAgentEnded(agent);
    world_.rare_states.OnAgentEnded(agent);
  }

  // Resets the checkers that cover one process lifetime of the agent.
  void Forget(AgentId agent) {
    world_.invariants.ForgetUnstoredRoles(agent);
    leases_.insert_or_assign(agent, LeaseChecker(agent));
    failovers_.erase(agent);
    failovers_.emplace(agent, FailoverChecker(agent, world_.config, world_.team.now()));
  }

  void WatchWindows(const Address& actor, const proto::Message& message) {
    LeaseChecker& leases = leases_.at(actor.agent);
    leases.OnHandle(actor.actor, message, world_.team.now());
    FailoverChecker& failover = failovers_.at(actor.agent);
    const std::optional<std::string> wrong = failover.OnHandle(actor.actor, message, leases, world_.team.now());
    if (FailoverChecker::IsFailover(actor.actor, message)) ObserveFailover();
    if (wrong) Violate("failover_has_cause", actor.agent, "takes the lead, but " + *wrong);
  }

  void ObserveFailover() {
    ++world_.report.failovers;
    world_.rare_states.Count("failover");
  }

  void Violate(const std::string& rule, AgentId agent, const std::string& text) {
    world_.Violate(rule, "agent " + std::to_string(agent) + " " + text);
  }

  bool OnRadio(AgentId from, AgentId to, const proto::Message& message) {
    if (byzantine_.OnRadio(from, to, message)) return !is_stormy_ && !faults_.IsDeaf(from, to);
    world_.rare_states.OnRadio(from, to, message);
    if (world_.options.has_all_actors()) clients_.OnRadio(from, message);
    const std::string who = "agent " + std::to_string(from) + " to " + std::to_string(to) + ": ";
    // A Byzantine agent may lie about its leases, so messages to and from it are exempt.
    const auto wrong = leases_.at(from).WhyQuiet(message.source_actor(), to, message, world_.team.now());
    if (wrong && !IsByzantine(from) && !IsByzantine(to)) {
      world_.Violate("quiet_window", who + *wrong);
    }
    const bool is_honest = !IsByzantine(from) && !IsByzantine(to);
    if (message.has_hello()) checkers_[{from, message.source_actor(), to}].OnHello(message.hello());
    if (message.has_batch()) {
      world_.report.batch_bytes += message.ByteSizeLong();
      for (const AgentId end : {from, to}) {
        const auto beyond = budgets_.at(end).OnBatch(message.ByteSizeLong(), world_.team.now());
        if (beyond) Violate("within_budget", end, *beyond);
      }
      for (const auto& [rule, text] : checkers_[{from, message.source_actor(), to}].OnBatch(message)) {
        if (is_honest) world_.Violate(rule, who + text);
      }
    }
    if (message.has_refusal()) {
      const Error error = FromProto(message.refusal().error());
      // A refusal is usual if its sender no longer knows the session, or if the sender's store failed.
      const bool is_usual =
          error.code == ErrorCode::kNotFound ||
          (error.code == ErrorCode::kUnavailable && (restarts_.is_damaged(from) || world_.HadDiskTrouble(from)));
      if (!is_usual && is_honest) world_.Violate("nothing_refused", who + ToString(error));
    }
    if (const std::optional<HaveSet> have = HaveInAnswer(message)) {
      prunes_.at(to).OnAnswer(from, *have);
      world_.invariants.ObserveHave(from, *have);
    }
    if (message.has_have()) {
      world_.report.have_bytes += message.ByteSizeLong();
      const Result<HaveSet> have = FromProto(message.have().have());
      if (have) world_.invariants.ObserveHave(from, *have);
      if (!have) world_.Violate("nothing_refused", who + "a malformed have-set");
    }
    return !is_stormy_ && !faults_.IsDeaf(from, to);
  }

  void ObserveRecord(const proto::StoredRecord& record, AgentId where) {
    world_.invariants.ObserveRecord(FromProto(record.key()), record.content(), where);
  }

  // --- Operator and periodic checks ---

  void Operate() {
    world_.In(kSharePeriod, [this] { Operate(); });
    for (const AgentId leader : world_.Leaders()) {
      done_.Order(leader, proto::SHARING_KIND_SYNC);
      world_.In(kSharePeriod / 2, [this, leader] { done_.Order(leader, proto::SHARING_KIND_REPLICATION); });
    }
  }

  void Inspect() {
    world_.In(kInspectPeriod / 2 + world_.DrawDuration(kInspectPeriod), [this] { Inspect(); });
    for (AgentId agent = 1; agent <= world_.base; ++agent) {
      restarts_.CheckFailures(agent);
      if (!world_.team.is_running(agent)) continue;
      restarts_.CheckMailboxes(agent);
      CheckSteppedDown(agent);
      if (const auto wrong = failovers_.at(agent).WhyOverdue(leases_.at(agent), world_.team.now())) {
        Violate("failover_happens", agent, *wrong);
      }
      if (const std::optional<HaveSet> have = world_.HaveOf(agent)) {
        world_.invariants.CheckHave(agent, *have);
        byzantine_checker_.CheckHave(agent, *have);
        CheckPruned(agent, *have);
      }
    }
  }

  void CheckSteppedDown(AgentId agent) {
    proto::Message question;
    question.mutable_role_show_request();
    const proto::Message answer = world_.RequestActor(agent, actor_name::kRole, std::move(question));
    if (!answer.role_show_reply().has_unstored() || !world_.roles.contains(agent)) return;
    const proto::RoleAssignment& roles = world_.roles[agent];
    if (roles.leader() != agent && roles.survivor() != agent) return;
    Violate("steps_down", agent,
            "acts on a role of term " + std::to_string(roles.term().number()) + " and cannot store term " +
                std::to_string(answer.role_show_reply().unstored().term().number()));
  }

  void CheckPruned(AgentId agent, const HaveSet& have) {
    if (const auto wrong = prunes_.at(agent).OnHave(have)) Violate("pruned_is_covered", agent, *wrong);
  }

  void BecomeQuiet() {
    world_.is_quiet = true;
    faults_.End();
    for (AgentId agent = 1; agent <= world_.base; ++agent) {
      world_.disk.CutPowerAfter(SimulatedWorld::Prefix(agent), 0);
      restarts_.CheckFailures(agent);
      restarts_.Restart(agent);
    }
    for (AgentId rover = 1; rover < world_.base; ++rover) {
      robots_.TakeInsertReplies(rover);
      robots_.SetLease(rover, proto::LEASE_KIND_DRIVING, Duration::zero());
      robots_.SetLease(rover, proto::LEASE_KIND_SLEEPING, Duration::zero());
    }
  }

  void MeasureRefill() {
    const SimReport run = world_.report;
    const AgentId leader = world_.roles[1].leader();
    const AgentId survivor = world_.roles[1].survivor();
    world_.team.radio().latency = milliseconds(5);
    world_.team.radio().bytes_per_second = 125'000;
    restarts_.KillWithDisk(survivor, "wipe");
    restarts_.Restart(survivor);
    const MonotonicTime start = world_.team.now();
    const std::uint64_t bytes = world_.team.radio_bytes();
    done_.Order(leader, proto::SHARING_KIND_REPLICATION);
    while (world_.HaveOf(survivor) != world_.HaveOf(leader) && world_.team.now() - start < std::chrono::hours(24)) {
      world_.team.AdvanceTime(milliseconds(100));
    }
    world_.report.have_bytes = run.have_bytes;
    world_.report.batch_bytes = run.batch_bytes;
    const bool is_full = world_.HaveOf(survivor) == world_.HaveOf(leader);
    world_.report.refill_s = is_full ? std::chrono::duration<double>(world_.team.now() - start).count() : -1;
    world_.report.refill_bytes = world_.team.radio_bytes() - bytes;
  }

  std::uint64_t hash_ = 0;
  MonotonicTime derived_at_{};  // When poses or verdicts were last stored.
  MonotonicTime late_from_{};   // Events inserted after this time need not reach other agents.
  // True after too many messages were handled. The radio then drops all messages, and the run ends.
  bool is_stormy_ = false;
  // Checker of each session, by sending agent, sending actor and receiving agent.
  std::map<std::tuple<AgentId, std::string, AgentId>, SessionChecker> checkers_;
  std::map<AgentId, BudgetChecker> budgets_;
  std::map<AgentId, proto::Term> saving_term_;
  std::map<AgentId, PruneChecker> prunes_;
  std::map<AgentId, LeaseChecker> leases_;
  std::map<AgentId, FailoverChecker> failovers_;
  SimulatedWorld world_;
  SimulatedRobots robots_;
  AgentRestarts restarts_;
  SimulatedFaults faults_;
  SimulatedClients clients_;
  DoneChecker done_;
  OwnInserts own_inserts_;
  ByzantineChecker byzantine_checker_;
  // Senders of store requests, by receiver and request id.
  std::map<std::pair<AgentId, std::uint64_t>, AgentId> store_senders_;
  ByzantineAgent byzantine_;
  QuiescenceChecks rest_;
  const std::uint64_t messages_max_;
};

}  // namespace

SimReport RunSimulatedMission(const SimOptions& options) { return Mission(options).Run(); }

}  // namespace moondb::simulation
