#include "apps/moondb_view/team_page.h"

#include <algorithm>
#include <vector>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/holdings.h"
#include "apps/moonctl/settled.h"
#include "model/agent_name.h"
#include "model/leases.h"

namespace moondb {
namespace {

constexpr char kAskTheTeam[] = "not known: ask the team";

const proto::AgentStatus* StatusOf(const TeamReports& reports, AgentId agent) {
  const auto known = reports.agents.find(agent);
  if (known == reports.agents.end() || known->second.age_s > kAnswerAgeMax_s) return nullptr;
  return known->second.report.status ? &*known->second.report.status : nullptr;
}

const proto::AgentStatus* OwnStatus(const TeamReports& reports) {
  return reports.why_silent.empty() ? StatusOf(reports, reports.agent) : nullptr;
}

const proto::PeerStatus* PeerOf(const proto::AgentStatus& status, AgentId agent) {
  const auto peer = std::ranges::find(status.peers(), agent, &proto::PeerStatus::agent_id);
  return peer == status.peers().end() ? nullptr : &*peer;
}

bool Sleeps(const proto::AgentStatus& status, AgentId agent) {
  return std::ranges::any_of(
      status.leases(), [agent](const auto& lease) { return lease.agent_id() == agent && lease.sleeping_s() > 0; });
}

// Returns the agents that have not left, in the order of the team file.
std::vector<const proto::AgentConfig*> MembersOf(const proto::TeamConfig& team) {
  std::vector<const proto::AgentConfig*> members;
  for (const proto::AgentConfig& agent : team.agents()) {
    if (!agent.left()) members.push_back(&agent);
  }
  return members;
}

Answer LeaderAnswer(const proto::TeamConfig& team, const proto::AgentStatus* own) {
  if (own == nullptr) return {false, false, "not known: the agent does not answer"};
  const proto::RoleAssignment& roles = own->roles();
  if (roles.leader() == 0) return {true, false, "nobody leads"};
  const std::string leader = AgentName(team, roles.leader()) + " leads";
  if (roles.survivor() == 0) return {true, false, leader + ", without a designated survivor"};
  return {true, true, leader + "; " + AgentName(team, roles.survivor()) + " is the designated survivor"};
}

void WriteAnswer(const std::string& name, const Answer& answer, JsonWriter& json) {
  json.Key(name).BeginObject().Key("is_known").Bool(answer.is_known);
  json.Key("is_good").Bool(answer.is_known && answer.is_good).Key("text").String(answer.text);
}

void WriteAnswers(const proto::TeamConfig& team, const TeamReports& reports, JsonWriter& json) {
  const proto::AgentStatus* own = OwnStatus(reports);
  json.Key("answers").BeginObject();
  WriteAnswer("leader", LeaderAnswer(team, own), json);
  if (own != nullptr && own->roles().leader() != 0) json.Key("leader").String(AgentName(team, own->roles().leader()));
  if (own != nullptr && own->roles().survivor() != 0) {
    json.Key("survivor").String(AgentName(team, own->roles().survivor()));
  }
  json.EndObject();
  WriteAnswer("loss", LossAnswer(team, reports), json);
  if (const auto* leader = own == nullptr ? nullptr : StatusOf(reports, own->roles().leader()); leader != nullptr) {
    json.Key("count").Number(leader->storage().one_copy().count());
    json.Key("age_s").Number(leader->storage().one_copy().age_s());
  }
  json.EndObject();
  WriteAnswer("silent", SilentAnswer(team, reports), json);
  json.Key("agents").BeginArray();
  for (const proto::AgentConfig* agent : MembersOf(team)) {
    const auto* peer = own == nullptr ? nullptr : PeerOf(*own, agent->id());
    if (peer != nullptr && !peer->is_connected() && !Sleeps(*own, agent->id())) json.String(agent->name());
  }
  json.EndArray().EndObject();
  WriteAnswer("maps", MapsAnswer(team, reports), json);
  json.EndObject();
  json.EndObject();
}

void WriteLink(const TeamReports& reports, AgentId agent, JsonWriter& json) {
  const proto::AgentStatus* own = OwnStatus(reports);
  const auto* peer = own == nullptr ? nullptr : PeerOf(*own, agent);
  const bool is_self = agent == reports.agent;
  json.Key("link").BeginObject().Key("state");
  if (is_self && own != nullptr) {
    json.String("self");
  } else if (peer == nullptr) {
    json.String("unknown");
  } else {
    json.String(peer->is_connected() ? "connected" : "silent");
  }
  json.Key("heard_s");
  if (is_self) {
    json.Number(reports.agents.contains(agent) ? reports.agents.at(agent).age_s : -1);
  } else if (peer == nullptr || peer->seconds_since_heard() < 0) {
    json.Null();
  } else {
    json.Number(peer->seconds_since_heard());
  }
  json.EndObject();
}

void WriteInstruments(const TeamReports& reports, AgentId agent, JsonWriter& json) {
  const proto::AgentStatus* own = OwnStatus(reports);
  json.Key("battery");
  if (const auto battery = reports.batteries.find(agent); battery != reports.batteries.end() && battery->second.ratio) {
    json.BeginObject().Key("ratio").Number(*battery->second.ratio);
    json.Key("age_s").Number(battery->second.age_s).EndObject();
  } else {
    json.Null();
  }
  json.Key("clock");
  const proto::PeerClockOffset* clock = nullptr;
  if (own != nullptr) {
    for (const proto::PeerClockOffset& peer : own->storage().peer_clocks()) {
      if (peer.agent_id() == agent) clock = &peer;
    }
  }
  if (clock != nullptr) {
    json.BeginObject().Key("offset_s").Number(clock->offset_s()).Key("age_s").Number(clock->age_s()).EndObject();
  } else {
    json.Null();
  }
  json.Key("disk");
  const proto::AgentStatus* status = StatusOf(reports, agent);
  if (status != nullptr) {
    json.BeginObject().Key("free_bytes").Number(status->storage().disk_free_bytes());
    json.Key("database_bytes").Number(status->storage().database_bytes());
    json.Key("age_s").Number(reports.agents.at(agent).age_s).EndObject();
  } else {
    json.Null();
  }
  std::string lease;
  if (own != nullptr) {
    for (const proto::AgentLease& known : own->leases()) {
      if (known.agent_id() == agent) lease = ToString(known);
    }
  }
  json.Key("lease").String(lease);
}

std::string RoleText(const proto::AgentStatus* own, const proto::AgentConfig& agent) {
  if (agent.left()) return "has left";
  if (own == nullptr) return "";
  if (own->roles().leader() == agent.id()) return RoleName(proto::ROLE_LEADER);
  if (own->roles().survivor() == agent.id()) return RoleName(proto::ROLE_DESIGNATED_SURVIVOR);
  return RoleName(agent.kind() == proto::AGENT_KIND_BASE_STATION ? proto::ROLE_BASE_STATION : proto::ROLE_ROVER);
}

void WriteAgents(const proto::TeamConfig& team, const TeamReports& reports, JsonWriter& json) {
  json.Key("agents").BeginArray();
  for (const proto::AgentConfig& agent : team.agents()) {
    json.BeginObject().Key("id").Number(agent.id()).Key("name").String(agent.name());
    json.Key("role").String(RoleText(OwnStatus(reports), agent)).Key("is_left").Bool(agent.left());
    WriteLink(reports, agent.id(), json);
    WriteInstruments(reports, agent.id(), json);
    json.Key("is_placed");
    const auto placed = reports.is_placed.find(agent.id());
    placed == reports.is_placed.end() ? json.Null() : json.Bool(placed->second);
    json.EndObject();
  }
  json.EndArray();
}

struct HeldCell {
  double held = 0;
  std::optional<double> missing;
  std::optional<double> eta_s;
};

// Returns the time until a peer has what the session sends it.
std::optional<double> EtaOf(const proto::ShareStatus& shares, AgentId destination) {
  std::optional<double> eta_s;
  for (const proto::ShareSession& session : shares.sessions()) {
    if (session.destination() != destination || !session.is_open() || !session.is_remaining_known()) continue;
    if (session.session_s() <= 0 || session.session_acknowledged_records() <= 0) continue;
    const double rate = session.session_acknowledged_records() / session.session_s();
    eta_s = std::max(eta_s.value_or(0), session.remaining() / rate);
  }
  return eta_s;
}

using Row = std::map<AgentId, HeldCell>;  // By origin.

// Adds what the agents hold and lack to their rows. Requires: `holders` are the agents of `haves`.
void AddRows(const std::vector<AgentId>& holders, const std::vector<HaveSet>& haves, std::map<AgentId, Row>& rows) {
  for (const auto& [series, holdings] : HoldingsOf(haves)) {
    for (std::size_t i = 0; i < holders.size(); ++i) {
      HeldCell& cell = rows[holders[i]][series.first];
      cell.held += static_cast<double>(holdings[i].held);
      // One agent alone cannot know what exists elsewhere.
      if (holders.size() > 1) cell.missing = cell.missing.value_or(0) + static_cast<double>(holdings[i].lacking);
    }
  }
}

// Returns what each agent holds of each origin. An agent whose have-set is not known has a row only for what the own
// agent knows of it.
std::map<AgentId, Row> RowsOf(const TeamReports& reports) {
  std::vector<AgentId> holders;
  std::vector<HaveSet> haves;
  std::optional<HaveSet> own_then;
  for (const auto& [agent, reported] : reports.agents) {
    if (!reported.holds || reported.age_s > kAnswerAgeMax_s) continue;
    holders.push_back(agent);
    haves.push_back(*reported.holds);
    if (reported.own_holds_then) own_then = reported.own_holds_then;
  }
  std::map<AgentId, Row> rows;
  AddRows(holders, haves, rows);
  if (own_then) {
    // The others' gaps are those at the time at which they were asked.
    const Row own_row = rows[reports.agent];
    const auto own = std::ranges::find(holders, reports.agent);
    if (own != holders.end()) haves[static_cast<std::size_t>(own - holders.begin())] = *own_then;
    rows.clear();
    AddRows(holders, haves, rows);
    rows[reports.agent] = own_row;
  }
  const auto own = reports.agents.find(reports.agent);
  const proto::AgentStatus* status = OwnStatus(reports);
  if (status == nullptr || own == reports.agents.end() || !rows.contains(reports.agent)) return rows;
  HeldCell& held = rows[reports.agent][reports.agent];
  held.missing = 0;  // An agent has its own records.
  for (const proto::PeerBacklog& backlog : status->storage().backlogs()) {
    HeldCell& cell = rows[backlog.agent_id()][reports.agent];
    if (cell.missing) continue;  // Its own have-set says more.
    cell.held = std::max(0.0, held.held - backlog.own_count());
    cell.missing = backlog.own_count();
  }
  if (!own->second.report.shares) return rows;
  for (auto& [agent, row] : rows) {
    for (auto& [origin, cell] : row) {
      if (agent != reports.agent && cell.missing.value_or(0) > 0) cell.eta_s = EtaOf(*own->second.report.shares, agent);
    }
  }
  return rows;
}

void WriteOptional(const std::optional<double>& value, JsonWriter& json) { value ? json.Number(*value) : json.Null(); }

void WriteHoldings(const proto::TeamConfig& team, const TeamReports& reports, JsonWriter& json) {
  const std::vector<const proto::AgentConfig*> members = MembersOf(team);
  const std::map<AgentId, Row> rows = RowsOf(reports);
  json.Key("holdings").BeginObject().Key("origins").BeginArray();
  for (const proto::AgentConfig* origin : members) json.String(origin->name());
  json.EndArray().Key("rows").BeginArray();
  for (const proto::AgentConfig* holder : members) {
    const auto reported = reports.agents.find(holder->id());
    const bool is_known = reported != reports.agents.end() && reported->second.holds.has_value() &&
                          reported->second.age_s <= kAnswerAgeMax_s;
    json.BeginObject().Key("agent").String(holder->name()).Key("is_known").Bool(is_known).Key("age_s");
    is_known ? json.Number(reported->second.age_s) : json.Null();
    json.Key("cells").BeginArray();
    const auto row = rows.find(holder->id());
    for (const proto::AgentConfig* origin : members) {
      const bool has_row = row != rows.end();
      const auto cell = has_row ? row->second.find(origin->id()) : Row::const_iterator();
      if (!has_row || cell == row->second.end()) {
        // An agent whose have-set is known holds nothing of this origin.
        is_known ? json.BeginObject().Key("held").Number(0).Key("missing").Null().Key("eta_s").Null().EndObject()
                 : json.Null();
        continue;
      }
      json.BeginObject().Key("held").Number(cell->second.held).Key("missing");
      WriteOptional(cell->second.missing, json);
      json.Key("eta_s");
      WriteOptional(cell->second.eta_s, json);
      json.EndObject();
    }
    json.EndArray().EndObject();
  }
  json.EndArray().EndObject();
}

void WriteFindings(const proto::TeamConfig& team, const TeamReports& reports, JsonWriter& json) {
  std::map<std::uint32_t, AgentReport> known;
  for (const auto& [agent, reported] : reports.agents) {
    if (StatusOf(reports, agent) != nullptr) known[agent] = reported.report;
  }
  json.Key("findings").BeginArray();
  for (const auto& [agent, findings] : FindingsOn(team, known)) {
    for (const std::string& text : findings) {
      json.BeginObject().Key("agent").String(AgentName(team, agent)).Key("text").String(text).EndObject();
    }
  }
  json.EndArray();
}

}  // namespace

Answer LossAnswer(const proto::TeamConfig& team, const TeamReports& reports) {
  const proto::AgentStatus* own = OwnStatus(reports);
  if (own == nullptr || own->roles().leader() == 0) return {false, false, "not known"};
  const std::string name = AgentName(team, own->roles().leader());
  const proto::AgentStatus* leader = StatusOf(reports, own->roles().leader());
  if (leader == nullptr) {
    const proto::PeerStatus* peer = PeerOf(*own, own->roles().leader());
    const bool is_silent = peer != nullptr && !peer->is_connected();
    return {false, false, is_silent ? "not known: " + name + ", which leads, is silent" : kAskTheTeam};
  }
  const proto::OneCopy& one_copy = leader->storage().one_copy();
  if (one_copy.count() == 0) return {true, true, "nothing: other agents have all records that " + name + " holds"};
  const bool is_one = one_copy.count() == 1;
  return {true, false,
          FormatCount(one_copy.count()) + (is_one ? " record, " : " records, the oldest ") +
              FormatSeconds(one_copy.age_s()) + (is_one ? " old, exists on " : " old, exist on ") + name +
              "'s disk only"};
}

Answer SilentAnswer(const proto::TeamConfig& team, const TeamReports& reports) {
  const proto::AgentStatus* own = OwnStatus(reports);
  if (own == nullptr) return {false, false, "not known: the agent does not answer"};
  std::string silent;
  std::string asleep;
  for (const proto::AgentConfig* agent : MembersOf(team)) {
    const proto::PeerStatus* peer = PeerOf(*own, agent->id());
    if (peer == nullptr || peer->is_connected()) continue;
    const std::string since = peer->seconds_since_heard() < 0
                                  ? " was never heard"
                                  : " is silent for " + FormatSeconds(peer->seconds_since_heard());
    std::string& list = Sleeps(*own, agent->id()) ? asleep : silent;
    list += (list.empty() ? "" : ", ") + agent->name() + (&list == &asleep ? " sleeps" : since);
  }
  if (!silent.empty()) return {true, false, silent + (asleep.empty() ? "" : ", " + asleep)};
  return {true, true, asleep.empty() ? "nobody: " + own->name() + " hears every agent" : "nobody, but " + asleep};
}

Answer MapsAnswer(const proto::TeamConfig& team, const TeamReports& reports) {
  const proto::AgentStatus* own = OwnStatus(reports);
  if (own == nullptr) return {false, false, "not known: the agent does not answer"};
  if (team.radio().sync_period_s() <= 0) {
    return {false, false, "not known: in this team, records move on command (moonctl sync now)"};
  }
  TeamActivity activity;
  bool has_leader = false;
  bool has_all = true;
  for (const proto::AgentConfig* agent : MembersOf(team)) {
    const auto reported = reports.agents.find(agent->id());
    const bool is_known = StatusOf(reports, agent->id()) != nullptr && reported->second.report.shares;
    if (is_known) activity.sharing.emplace_back(agent->id(), *reported->second.report.shares);
    const auto* peer = PeerOf(*own, agent->id());
    if (peer != nullptr && !peer->is_connected()) activity.away.insert(agent->id());
    has_all = has_all && (is_known || activity.away.contains(agent->id()));
    if (!is_known || agent->id() != own->roles().leader()) continue;
    has_leader = true;
    if (reported->second.graph) activity.graph = *reported->second.graph;
    if (reported->second.report.registration) activity.registration = *reported->second.report.registration;
  }
  if (!has_leader) activity.registration.set_is_done(true);  // Its solves and matches are not known.
  const std::string why = WhyNotSettled(team, activity);
  if (!why.empty()) return {true, false, "no: " + why};
  if (!has_leader) return {false, false, kAskTheTeam};
  if (!has_all) return {false, false, kAskTheTeam};
  return {true, true, "yes: each agent has its records"};
}

std::string TeamPageJson(const proto::TeamConfig& team, const TeamReports& reports) {
  JsonWriter json;
  json.BeginObject().Key("time_s").Number(reports.now_s).Key("team").String(team.team());
  json.Key("agent").String(AgentName(team, reports.agent));
  const auto own = reports.agents.find(reports.agent);
  json.Key("source").BeginObject().Key("is_reachable").Bool(reports.why_silent.empty()).Key("age_s");
  own == reports.agents.end() ? json.Null() : json.Number(own->second.age_s);
  json.Key("text").String(reports.why_silent).EndObject();
  json.Key("viewers").Number(static_cast<double>(reports.viewers));
  WriteAnswers(team, reports, json);
  WriteAgents(team, reports, json);
  WriteHoldings(team, reports, json);
  WriteFindings(team, reports, json);
  json.Key("ask").BeginObject().Key("is_on").Bool(reports.ask.is_on).Key("cost_bytes").Number(reports.ask.cost_bytes);
  json.Key("spent_bytes").Number(reports.ask.spent_bytes).Key("period_s").Number(reports.ask.period_s);
  json.Key("trouble").String(reports.ask.trouble).EndObject();
  return json.EndObject().text();
}

}  // namespace moondb
