#include "apps/moonctl/match_list.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/node_name.h"
#include "apps/moonctl/rover_places.h"
#include "model/agent_name.h"

namespace moondb {
namespace {

std::string OffsetText(const Pose& offset) {
  return FormatFixed(offset.position_m.norm(), 2) + " m " + FormatFixed(offset.Yaw() * 180 / std::numbers::pi, 1) +
         " deg";
}

bool IsRejected(const ListedMatch& match) {
  return !match.is_quarantined && match.verdict && !match.verdict->is_inlier;
}

std::string VerdictName(const ListedMatch& match) {
  if (match.is_quarantined) return "quarantined";
  if (!match.verdict) return "not solved yet";
  return IsRejected(match) ? "rejected" : "kept";
}

// Returns whether a pass will begin that has maps to match.
bool IsMatchingDue(const proto::RegistrationReply& state) {
  return state.is_due() && state.map_count() + state.other_map_count() > 0;
}

}  // namespace

void MatchList::Add(const RecordKey& key, const proto::Record& record) {
  if (!record.has_map_match()) return;
  const proto::MapMatch& match = record.map_match();
  const Version version{{OrderOf(match.term()), match.run()}, key};
  const auto [entry, is_new] =
      matches_.try_emplace({FromProto(match.from()), FromProto(match.to())}, std::pair{version, match});
  if (!is_new && version > entry->second.first) entry->second = {version, match};
}

std::vector<ListedMatch> MatchList::List(const KnownGraph& known) const {
  const PoseGraph graph = known.graph();
  std::map<NodeKey, const Pose*> raw;
  for (const GraphNode& node : graph.nodes) raw[node.key] = &node.map_from_node;
  std::map<std::pair<NodeKey, NodeKey>, const LoopClosure*> used;
  for (const LoopClosure& closure : graph.closures) {
    if (closure.source == kRegistrationSource) used[{closure.from, closure.to}] = &closure;
  }
  std::vector<ListedMatch> list;
  for (const auto& [ends, versioned] : matches_) {
    ListedMatch& match = list.emplace_back();
    match.key = versioned.first.second;
    match.body = versioned.second;
    std::tie(match.from, match.to) = ends;
    // KnownGraph::Add has accepted the pose.
    match.from_from_to = FromProto(match.body.relative_pose().from_from_to()).value_or(Pose());
    match.is_quarantined = !used.contains(ends);
    const auto from = raw.find(match.from), to = raw.find(match.to);
    if (from != raw.end() && to != raw.end()) {
      match.correction = (from->second->Inverse() * *to->second).Inverse() * match.from_from_to;
    }
    const FactorKey factor{FactorKind::kLoopClosure, match.from, match.to, std::string(kRegistrationSource)};
    if (const PublishedVerdict* const verdict = known.FindVerdict(factor)) match.verdict = *verdict;
  }
  std::ranges::stable_sort(list, [](const ListedMatch& a, const ListedMatch& b) {
    const auto distance = [](const ListedMatch& match) {
      return IsRejected(match) ? std::abs(match.verdict->residual_sigmas) : -1;
    };
    return distance(a) > distance(b);
  });
  return list;
}

std::string RegistrationText(const proto::TeamConfig& team, const proto::RegistrationReply& state) {
  double count = 0;
  std::string counts;
  for (const proto::RegistrationCount& one : state.counts()) {
    count += one.count();
    counts += (counts.empty() ? ": " : ", ") + FormatCount(one.count()) + " " + one.verdict();
  }
  std::string text = "matched " + FormatCount(count, "pair") + " of " + FormatCount(state.map_count(), "map") + " in " +
                     FormatCount(state.pass_count(), "pass", "passes") + counts + "; " +
                     FormatCount(state.stored_count(), "match", "matches") + " stored; " +
                     FormatCount(state.left_count(), "pair") + " left; " + FormatFixed(state.seconds(), 1) + " s";
  if (state.unposed_map_count() > 0) {
    text += "; " + FormatCount(state.unposed_map_count(), "map") + " had no optimized pose yet";
  }
  if (const double quarantined = state.other_map_count() - state.unposed_map_count(); quarantined > 0) {
    text += "; " + FormatCount(quarantined, "map") + " quarantined, or newer than the last pass";
  }
  if (IsMatchingDue(state)) text += "; the next pass will begin";
  text += (state.text().empty() ? "" : "; " + state.text()) + "\n";
  for (const proto::LeftOutPairs& pairs : state.left_out()) {
    const bool is_one_agent = pairs.agent_id() == pairs.other_agent_id();
    text += "excluded " + FormatCount(pairs.count()) + " pairs of maps of " + AgentName(team, pairs.agent_id()) +
            (is_one_agent ? "" : " and " + AgentName(team, pairs.other_agent_id())) +
            " from the last pass, because they exceed their share of a pass\n";
  }
  if (state.removed_map_match_count() > 0) {
    text += FormatCount(state.removed_map_match_count(), "stored match", "stored matches") +
            " of maps that were removed since: the solver still uses them\n";
  }
  return text + PlacesText(team, state);
}

std::string MatchingLeftText(const proto::RegistrationReply& state) {
  if (state.left_count() > 0) return FormatCount(state.left_count(), "pair") + " of maps left to match";
  return IsMatchingDue(state) ? "the matching of maps will begin" : "";
}

std::string VerdictText(const ListedMatch& match) {
  const std::string name = VerdictName(match);
  return IsRejected(match) ? name + " (" + FormatFixed(std::abs(match.verdict->residual_sigmas), 1) + " sigmas)" : name;
}

std::string MatchesText(const proto::TeamConfig& team, const std::vector<ListedMatch>& matches, std::size_t rows_max) {
  if (matches.empty()) return "this agent holds no map match\n";
  Table table({"FROM", "TO", "OFFSET", "CORRECTION", "MATCHED", "OVERLAP", "SECOND BEST", "VERDICT"});
  const std::size_t rows = std::min(rows_max, matches.size());
  for (std::size_t i = 0; i < rows; ++i) {
    const ListedMatch& match = matches[i];
    table.Add({NodeName(team, match.from), NodeName(team, match.to), OffsetText(match.from_from_to),
               match.correction ? OffsetText(*match.correction) : "-", FormatFixed(match.body.matched(), 2),
               FormatFixed(match.body.overlap(), 2), FormatFixed(match.body.second_best(), 2), VerdictText(match)});
  }
  return table.Text() + (rows == matches.size()
                             ? ""
                             : "and " + std::to_string(matches.size() - rows) + " more matches; --all lists all\n");
}

void WriteMatches(const std::vector<ListedMatch>& matches, JsonWriter& json) {
  json.BeginArray();
  for (const ListedMatch& match : matches) {
    json.BeginObject().Key("key").String(ToString(match.key)).Key("match").Raw(ToJson(match.body));
    json.Key("offset_m").Number(match.from_from_to.position_m.norm());
    json.Key("offset_yaw_rad").Number(match.from_from_to.Yaw());
    json.Key("correction_m").Number(match.correction ? match.correction->position_m.norm() : NAN);
    json.Key("correction_yaw_rad").Number(match.correction ? match.correction->Yaw() : NAN);
    json.Key("is_quarantined").Bool(match.is_quarantined);
    json.Key("verdict").String(VerdictName(match));
    json.Key("residual_sigmas").Number(match.verdict ? match.verdict->residual_sigmas : NAN).EndObject();
  }
  json.EndArray();
}

}  // namespace moondb
