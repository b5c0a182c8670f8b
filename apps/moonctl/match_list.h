// The map matches that an agent holds, for `moonctl graph matches`.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "actors/pgo/known_graph.h"
#include "apps/common/json_writer.h"
#include "model/geometry.h"
#include "model/record_key.h"
#include "proto/record.pb.h"
#include "proto/registration.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// The valid match of two nodes.
struct ListedMatch {
  RecordKey key;
  proto::MapMatch body;
  NodeKey from;
  NodeKey to;
  Pose from_from_to;
  // Pose of `to` by the match, relative to its pose by odometry. Nullopt if a node is missing.
  std::optional<Pose> correction;
  bool is_quarantined = false;              // True if a quarantine leaves out the match.
  std::optional<PublishedVerdict> verdict;  // The last solve's decision. Nullopt if no solve has used a match yet.
};

// Collects the valid match of each pair of nodes, that with the highest (term, run). The result depends only on the set
// of added records, not on their order. Not thread-safe.
class MatchList {
 public:
  // Adds a map match, and ignores records of other types. Requires: KnownGraph::Add accepts the record.
  void Add(const RecordKey& key, const proto::Record& record);

  // Returns the valid matches: first the rejected ones by falling distance, then the others, sorted by their nodes.
  // `known` must hold the same matches.
  std::vector<ListedMatch> List(const KnownGraph& known) const;

 private:
  using Version = std::pair<std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>, RecordKey>;
  std::map<std::pair<NodeKey, NodeKey>, std::pair<Version, proto::MapMatch>> matches_;
};

// Describes the state of registration in one line: "matched 12 pairs of 8 maps in 1 passes: 9 accepted, ...", and adds
// one line for each pair of agents with pairs of maps that the last pass left out.
std::string RegistrationText(const proto::TeamConfig& team, const proto::RegistrationReply& state);

// Describes the work that is left: "2,551 pairs of maps are left to match". Empty: none.
std::string MatchingLeftText(const proto::RegistrationReply& state);

// Returns "kept", "rejected (9.3 sigmas)", "not solved yet" or "quarantined".
std::string VerdictText(const ListedMatch& match);

// Returns a table with the first `rows_max` matches, and the number of the others.
std::string MatchesText(const proto::TeamConfig& team, const std::vector<ListedMatch>& matches, std::size_t rows_max);

// Writes an array with all matches.
void WriteMatches(const std::vector<ListedMatch>& matches, JsonWriter& json);

}  // namespace moondb
