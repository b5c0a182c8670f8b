#include "apps/moonctl/health.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "apps/common/hash_text.h"
#include "apps/common/table.h"
#include "apps/common/team_clients.h"
#include "apps/moonctl/map_holdings.h"
#include "apps/moonctl/node_name.h"
#include "apps/moonctl/refused_sets.h"
#include "apps/moonctl/rover_places.h"
#include "apps/moonctl/unplaced.h"
#include "model/custom_types.h"
#include "model/event.h"
#include "model/odometry_scale.h"
#include "model/start_poses.h"
#include "model/team_member.h"
#include "model/term.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr std::uint64_t kRevisionsOfAnEraMax = 1000;

using Findings = std::vector<std::string>;

// Returns the newest assignment that any agent reports.
proto::RoleAssignment NewestOf(const std::map<std::uint32_t, AgentReport>& reports) {
  proto::RoleAssignment newest;
  for (const auto& [agent, report] : reports) {
    if (!report.status) continue;
    // An assignment that this agent could not store counts too, because another agent may have stored it.
    const proto::RoleAssignment& roles =
        report.status->has_unstored_roles() ? report.status->unstored_roles() : report.status->roles();
    if (!IsNewer(newest.term(), roles.term())) newest = roles;
  }
  return newest;
}

bool IsAsleep(const proto::AgentStatus& status, std::uint32_t agent) {
  return std::any_of(status.leases().begin(), status.leases().end(), [agent](const proto::AgentLease& lease) {
    return lease.agent_id() == agent && lease.sleeping_s() > 0;
  });
}

void JudgeRoles(const proto::TeamConfig& team, const proto::AgentStatus& status, const proto::RoleAssignment& newest,
                Findings& findings) {
  if (status.has_unstored_roles()) {
    findings.push_back(UnstoredText(team, status.unstored_roles()));
  } else if (OrderOf(status.roles().term()) != OrderOf(newest.term())) {
    findings.push_back("acts on the roles of term " + TermText(status.roles().term()) +
                       ", but another agent knows term " + TermText(newest.term()));
  } else if (status.agent_id() == newest.leader() && newest.survivor() == 0) {
    findings.push_back("leads without a designated survivor: name one with moonctl role set");
  }
  if (RevisionOf(newest.term()) >= kRevisionsOfAnEraMax && !newest.signature().empty()) {
    findings.push_back(
        "the roles changed " + FormatCount(static_cast<double>(RevisionOf(newest.term()))) +
        " times since the last operator command, and joining agents fetch every change: run moonctl role set once");
  }
  if (newest.leader() == 0) findings.push_back("knows no leader of team " + team.team());
  for (const auto& [agent, role] : {std::pair(newest.leader(), "leader"), std::pair(newest.survivor(), "survivor")}) {
    if (!HasLeft(team, agent)) continue;
    const std::string name = AgentName(team, agent);
    findings.push_back(name + " is " + role + " in term " + TermText(newest.term()) +
                       ", but has left the team: name another agent with moonctl role set");
  }
}

void JudgePeers(const proto::TeamConfig& team, const proto::AgentStatus& status, Findings& findings) {
  for (const proto::PeerStatus& peer : status.peers()) {
    if (peer.rejected_messages() > 0) {
      findings.push_back("refused " + FormatCount(peer.rejected_messages(), "message") + " that " +
                         AgentName(team, peer.agent_id()) + " may not send");
    }
    if (peer.cut_for_bytes() > 0) {
      findings.push_back("closed the link to " + AgentName(team, peer.agent_id()) + " " +
                         FormatCount(peer.cut_for_bytes(), "time") + ": " + AgentName(team, peer.agent_id()) +
                         " sent data over an outgoing connection of this agent");
    }
    if (peer.has_two_processes()) {
      const std::string name = AgentName(team, peer.agent_id());
      findings.push_back("two processes use " + name +
                         "'s key, perhaps on a copied disk: stop one of them; only records of the process at " + name +
                         "'s address are sure to be shared");
    }
    if (peer.is_connected() || IsAsleep(status, peer.agent_id())) continue;
    const double silent_s = peer.seconds_since_heard();
    findings.push_back("does not reach " + AgentName(team, peer.agent_id()) +
                       (silent_s < 0 ? ", never heard" : ", last heard " + FormatSeconds(silent_s) + " ago"));
  }
}

void JudgeSelf(const proto::AgentStatus& status, Findings& findings) {
  for (const proto::HealthFinding& finding : status.findings()) {
    findings.push_back(FormatUtc(finding.timestamp_ns()) + ": " + OneLine(finding.text(), kEventTextBytesMax) +
                       " (not acknowledged)");
  }
  if (!status.storage().clock_suspect().empty()) {
    findings.push_back("clock suspect: " + status.storage().clock_suspect());
  }
  if (!status.storage().write_trouble().empty()) {
    findings.push_back("stores nothing: " + status.storage().write_trouble());
  } else if (!status.storage().refused_inserts().empty()) {
    findings.push_back(status.storage().refused_inserts());
  } else if (!status.storage().space_low().empty()) {
    findings.push_back("space low: " + status.storage().space_low());
  }
  for (const proto::ActorStatus& actor : status.actors()) {
    if (actor.restarts() > 0) {
      findings.push_back(actor.name() + " failed and was restarted " + FormatCount(actor.restarts(), "time"));
    }
    if (actor.dropped() > 0) {
      findings.push_back(actor.name() + " dropped " + FormatCount(actor.dropped(), "message") +
                         " because its mailbox was full");
    }
  }
}

void JudgeRisk(const proto::TeamConfig& team, const proto::StorageStatus& storage, Findings& findings) {
  const proto::OneCopy& one_copy = storage.one_copy();
  const proto::AtRiskConfig& limits = team.at_risk();
  const bool is_many = limits.records() > 0 && one_copy.count() > limits.records();
  const bool is_old = limits.age_s() > 0 && one_copy.count() > 0 && one_copy.age_s() > limits.age_s();
  if (!is_many && !is_old) return;
  findings.push_back("no other agent is known to hold " + FormatCount(one_copy.count(), "record") +
                     ", the oldest for " + FormatSeconds(one_copy.age_s()) +
                     ": copy with moonctl sync now and replicate now, list with moonctl risk");
}

// Adds a finding for each rover whose maps the agent should hold and lacks for longer than team_map_age_s. Compares
// timestamps of that rover only, because clocks may differ.
void JudgeMapAges(const proto::TeamConfig& team, const proto::AgentStatus& status, const AgentReport& leader,
                  Findings& findings) {
  const double limit_s = team.map().team_map_age_s();
  if (limit_s <= 0 || !leader.status || !GetsAllMaps(team, status.agent_id())) return;
  std::map<AgentId, std::int64_t> last_ns;
  for (const proto::MapTimes& times : status.storage().map_times()) last_ns[times.origin_agent()] = times.last_ns();
  std::set<AgentId> unplaced;
  if (leader.map_stats) {
    for (const proto::UnplacedRover& rover : leader.map_stats->unplaced()) unplaced.insert(rover.agent_id());
  }
  for (const proto::MapTimes& times : leader.status->storage().map_times()) {
    const AgentId origin = times.origin_agent();
    const auto held = last_ns.find(origin);
    const std::int64_t known_ns = held == last_ns.end() ? times.first_ns() : held->second;
    const double behind_s = static_cast<double>(times.last_ns() - known_ns) * 1e-9;
    const bool is_known = times.last_ns() != 0 && known_ns != 0;
    if (origin == status.agent_id() || unplaced.contains(origin) || !is_known || behind_s <= limit_s) continue;
    findings.push_back(
        (held == last_ns.end() ? "holds no map of " + AgentName(team, origin) +
                                     ", but the leader holds maps of that rover over a span of "
                               : "its newest map of " + AgentName(team, origin) + " is older than the leader's by ") +
        FormatSeconds(behind_s) + ": moonctl db holdings --maps shows the missing maps, moonctl sync now fetches them");
  }
}

void JudgeTimestamps(const proto::TeamConfig& team, const proto::StorageStatus& storage, Findings& findings) {
  if (!storage.has_suspect_timestamp()) return;
  const proto::SuspectTimestamp& suspect = storage.suspect_timestamp();
  findings.push_back("its software uses a wrong clock: a record of type " +
                     DataTypeName(suspect.data_type(), team.custom_types()) + " has the timestamp " +
                     FormatUtc(suspect.timestamp_ns()) +
                     "; records with such timestamps have no age, and their maps never win a cell by being newer");
}

bool IsFarOff(const proto::PeerClockOffset& clock) { return std::abs(clock.offset_s()) > kClockOffsetMax_s; }

// Returns the agents whose clocks differ by more than kClockOffsetMax_s from the clocks of most of their peers.
std::set<std::uint32_t> WrongClocksIn(const std::map<std::uint32_t, AgentReport>& reports) {
  std::set<std::uint32_t> wrong;
  for (const auto& [agent, report] : reports) {
    if (!report.status) continue;
    const auto& clocks = report.status->storage().peer_clocks();
    const auto far_off = std::count_if(clocks.begin(), clocks.end(), IsFarOff);
    if (2 * far_off > clocks.size()) wrong.insert(agent);
  }
  return wrong;
}

void JudgeClocks(const proto::TeamConfig& team, const proto::AgentStatus& status,
                 const std::set<std::uint32_t>& wrong_clocks, Findings& findings) {
  for (const proto::PeerClockOffset& clock : status.storage().peer_clocks()) {
    if (!IsFarOff(clock)) continue;
    const bool is_of_the_other = wrong_clocks.contains(clock.agent_id()) && !wrong_clocks.contains(status.agent_id());
    if (is_of_the_other) continue;
    findings.push_back("its clock is " + FormatSeconds(std::abs(clock.offset_s())) +
                       (clock.offset_s() > 0 ? " behind " : " ahead of ") + AgentName(team, clock.agent_id()) +
                       "'s (reported " + FormatSeconds(clock.age_s()) + " ago)");
  }
}

// Describes the messages or records of one sender that an agent refused, and the reason.
std::string RefusedText(const proto::TeamConfig& team, const proto::RefusedFrom& refused) {
  const std::string sender = AgentName(team, refused.agent_id());
  const std::string origin = refused.origin_agent() == 0 ? sender : AgentName(team, refused.origin_agent());
  const std::string records = FormatCount(refused.count(), "record");
  switch (refused.cause()) {
    case proto::REFUSAL_CAUSE_COMMAND:
      return "refused " + FormatCount(refused.count(), "command") + " relayed by " + sender +
             ", which is not in command_from of the team file";
    case proto::REFUSAL_CAUSE_ORIGIN:
      return "refused " + records + " of " + origin + " sent by " + sender +
             ", which has never been leader or survivor";
    case proto::REFUSAL_CAUSE_OWN_EPOCH:
      return sender +
             " reports records of this agent that this agent's disk never held: if the disk was replaced or restored, "
             "'moonctl "
             "sync now' returns them; otherwise " +
             sender + " reports false records";
    case proto::REFUSAL_CAUSE_STREAMS:
      return "refused " + records + " of " + origin + " sent by " + sender + ", because " + origin +
             " has too many streams";
    case proto::REFUSAL_CAUSE_STATEMENT:
      return "refused " + records + " of " + sender + " about other agents, which only those agents may make";
    case proto::REFUSAL_CAUSE_UNCOUNTED:
      return "ignores " + records + " of " + sender + " (poses, verdicts, quarantines of others' maps): " + sender +
             " did not lead in their term and is not in command_from";
    case proto::REFUSAL_CAUSE_NO_ROOM:
      return "excludes the oldest " + records + " of " + sender + " from the map or the pose graph, because " + sender +
             " exceeds its share of the memory; if the records are wrong: moonctl map quarantine --agent " + sender;
    case proto::REFUSAL_CAUSE_DISK_ROOM:
      return "refused " + records + " of " + sender +
             ", which exceed its share of this disk: free space with 'moonctl db prune', then " + sender +
             " sends them again";
    case proto::REFUSAL_CAUSE_ROLES:
      return "refused " + FormatCount(refused.count(), "role assignment") + " of " + sender +
             ", which may not assign these roles";
    default:
      return "refused " + FormatCount(refused.count(), "message") + " of " + sender;
  }
}

void JudgeRefused(const proto::TeamConfig& team, const proto::AgentStatus& status, Findings& findings) {
  for (const proto::RefusedFrom& refused : status.refused()) findings.push_back(RefusedText(team, refused));
}

void JudgeShares(const proto::TeamConfig& team, const proto::ShareStatus& shares, Findings& findings) {
  for (const proto::ShareSession& session : shares.sessions()) {
    const std::string to = (session.kind() == proto::SHARING_KIND_REPLICATION ? "replication to " : "sync to ") +
                           AgentName(team, session.destination());
    const bool is_stuck =
        session.is_open() && session.waits_for().empty() && session.seconds_since_progress() > kNoProgressMax_s;
    if (is_stuck)
      findings.push_back(to + " has made no progress for " + FormatSeconds(session.seconds_since_progress()));
    if (!session.other_schema_types().empty())
      findings.push_back(to + " excludes data types, because the schemas of both agents differ");
  }
  if (shares.rejected_records() > 0) {
    findings.push_back("refused " + FormatCount(shares.rejected_records(), "record") + " of peers");
  }
  for (const std::uint32_t other : shares.other_config_agents()) {
    findings.push_back(AgentName(team, other) + " has another team file");
  }
}

// Adds a finding to each agent of which the last solve refused measurements, or to the agent that solved (`solver`) if
// `reports` lacks the agent. Matches of maps have no producer; the agents of both maps get the finding.
void JudgeRefusedSets(const proto::TeamConfig& team, const proto::OptimizeReply& solve, std::uint32_t solver,
                      const std::map<std::uint32_t, AgentReport>& reports, std::map<std::uint32_t, Findings>& all) {
  std::map<std::uint32_t, std::string> refused;
  for (const proto::RefusedSet& set : solve.refused_sets()) {
    std::vector<std::uint32_t> named(set.agent_ids().begin(), set.agent_ids().end());
    if (set.producer() != 0) named = {set.producer()};
    for (const std::uint32_t agent : named) {
      std::string& text = refused[agent];
      text += (text.empty() ? "" : ", ") + RefusedCount(set);
      for (const std::uint32_t other : set.agent_ids()) {
        if (other != agent) text += " with " + AgentName(team, other);
      }
    }
  }
  for (const auto& [agent, text] : refused) {
    all[reports.contains(agent) ? agent : solver].push_back(
        "the last solve refused " + text + ", which contradict the measurements of other agents: check " +
        AgentName(team, agent) + "'s sensors, or exclude its measurements with 'moonctl graph quarantine --agent " +
        AgentName(team, agent) + "'");
  }
}

// Adds a finding to each rover with an implausible odometry scale or a far node, not to the leader that solved.
void JudgeSolve(const proto::TeamConfig& team, const proto::OptimizeReply& solve,
                std::map<std::uint32_t, Findings>& all) {
  for (const proto::RoverSolution& rover : solve.rovers()) {
    if (IsPlausibleOdometryScale(rover.odometry_scale())) continue;
    all[rover.agent_id()].push_back(
        "its odometry scale is " + FormatFixed(rover.odometry_scale(), 3) +
        " in the last solve: check the units of its odometry, and that its software inserts only odometry as odometry");
  }
  for (const proto::FarNode& far : solve.far_nodes()) {
    const NodeKey node = FromProto(far.node());
    all[node.agent].push_back("node " + NodeName(team, node) + " lies " + FormatFixed(far.distance_m() / 1000, 0) +
                              " km from the team in the last solve: check that its pose is in metres");
  }
}

// Returns a time as the options --from and --to take it: "2026-11-22T06:00:30Z".
std::string FormatIso(std::int64_t timestamp_ns) {
  const std::string utc = FormatUtc(timestamp_ns);
  return utc.substr(0, 10) + "T" + utc.substr(11, 8) + "Z";
}

// Adds a finding to each rover that is not placed, and to each agent whose maps make many hazards of the others free.
void JudgeMap(const proto::TeamConfig& team, const proto::MapStatsReply& stats,
              const proto::RegistrationReply& registration, std::map<std::uint32_t, Findings>& all) {
  const auto remedy = [&](AgentId rover) {
    const std::string searched = SearchText(team, registration, rover);
    return searched.empty() ? ": " + std::string(kHowToPlace)
                            : "; " + searched + ", or set its start pose (start in the team file)";
  };
  if (stats.frame_of() != 0) {
    all[stats.frame_of()].push_back("not placed in the team's map" + remedy(stats.frame_of()));
  }
  for (const proto::UnplacedRover& rover : stats.unplaced()) {
    all[rover.agent_id()].push_back("not placed, " + FormatCount(rover.map_count(), "map") +
                                    " excluded from the team's map" + remedy(rover.agent_id()));
  }
  for (const proto::ClearedHazards& cleared : stats.cleared()) {
    const std::string name = AgentName(team, cleared.agent_id());
    // Maps of unknown age have no times to choose them by.
    const bool is_dated = cleared.from_ns() > 0;
    const std::string times =
        is_dated ? " --from " + FormatIso(cleared.from_ns()) + " --to " + FormatIso(cleared.to_ns() + 999'999'999) : "";
    all[cleared.agent_id()].push_back(
        "within one minute, its maps marked as free " + FormatCount(cleared.cell_count()) + " of the " +
        FormatCount(cleared.hazard_count()) + " cells that other agents hold as hazards: 'moonctl map why " +
        FormatFixed(cleared.x_m(), 2) + " " + FormatFixed(cleared.y_m(), 2) +
        "' explains one of the cells; if the maps are wrong: moonctl map quarantine --agent " + name + times);
  }
}

}  // namespace

std::string IssuedTermText(const proto::TeamConfig& team, const proto::Term& term) {
  return TermText(term) + (term.issuer() == 0 ? "" : " by " + AgentName(team, term.issuer()));
}

std::string UnstoredText(const proto::TeamConfig& team, const proto::RoleAssignment& unstored) {
  return "cannot store term " + TermText(unstored.term()) + " (leader " + AgentName(team, unstored.leader()) +
         ", survivor " + AgentName(team, unstored.survivor()) +
         "); until it stores the term, it acts neither as leader nor as survivor";
}

std::string OtherConfigText(std::uint64_t theirs, std::uint64_t here) {
  return "hash " + HashText(theirs) + ", here " + HashText(here);
}

std::map<std::uint32_t, std::vector<std::string>> FindingsOn(const proto::TeamConfig& team,
                                                             const std::map<std::uint32_t, AgentReport>& reports,
                                                             std::uint64_t config_hash) {
  const proto::RoleAssignment newest = NewestOf(reports);
  const std::set<std::uint32_t> wrong_clocks = WrongClocksIn(reports);
  const auto leader = reports.find(newest.leader());
  std::map<std::uint32_t, Findings> all;
  for (const auto& [agent, report] : reports) {
    Findings findings;
    if (report.status) {
      JudgeRoles(team, *report.status, newest, findings);
      JudgePeers(team, *report.status, findings);
      JudgeSelf(*report.status, findings);
      JudgeRefused(team, *report.status, findings);
      JudgeClocks(team, *report.status, wrong_clocks, findings);
      JudgeRisk(team, report.status->storage(), findings);
      JudgeTimestamps(team, report.status->storage(), findings);
      if (leader != reports.end()) JudgeMapAges(team, *report.status, leader->second, findings);
    }
    if (report.shares) JudgeShares(team, *report.shares, findings);
    if (config_hash != 0 && report.config_hash != 0 && report.config_hash != config_hash) {
      findings.push_back("runs with another team file: " + OtherConfigText(report.config_hash, config_hash));
    }
    if (!findings.empty()) all[agent] = std::move(findings);
  }
  for (const auto& [agent, report] : reports) {
    if (!report.last_solve) continue;
    JudgeRefusedSets(team, *report.last_solve, agent, reports, all);
    JudgeSolve(team, *report.last_solve, all);
  }
  for (const auto& [rover, other] : CoincidingStarts(team)) all[rover].push_back(CoincidingText(team, rover, other));
  for (const auto& [agent, report] : reports) {
    const proto::RegistrationReply registration = report.registration.value_or(proto::RegistrationReply());
    if (report.map_stats) JudgeMap(team, *report.map_stats, registration, all);
    for (const auto& [rover, what] : FindContradicted(team, registration)) all[rover].push_back(what);
  }
  return all;
}

}  // namespace moondb
