// SharingRules decides which records of each data type this store keeps and passes on.
//
// Each type of the team has a policy. A custom type that this agent's team file does not declare (any more) is
// *carried*: its policy is unknown here. Other agents' records of the type are kept unchanged and passed on to agents
// that lack them. A carried record is dropped if a peer reports that it is superseded. This agent's own rows of a
// carried type are kept and not shared.
#pragma once

#include <map>
#include <set>
#include <utility>

#include "model/custom_types.h"
#include "model/record_key.h"

namespace moondb {

struct SharingRules {
  using Policies = std::map<DataType, proto::Policy>;

  AgentId self = 0;
  Policies policies;         // Policies of the built-in types. Types without a policy are not shared.
  CustomTypes custom_types;  // All custom types of the team file, with policy and priority.
  // Types of which a ground station wants all records. Empty, except on the base station.
  std::set<DataType> for_ground = {};

  // Returns POLICY_NONE if the team does not know the type.
  proto::Policy PolicyOf(DataType type) const;
  bool IsLatest(DataType type) const { return PolicyOf(type) == proto::POLICY_LATEST; }
  bool IsCarried(DataType type) const;
  // Returns whether records of the type may be dropped because a peer reports them as dropped.
  bool MayBeDropped(DataType type) const { return IsLatest(type) || IsCarried(type); }
  // Returns whether this agent offers records of the stream to peers that lack them.
  bool IsShared(const StreamKey& stream) const;
  // Returns the sort key of a type: its SharingRank, then the custom type's priority. Types with smaller keys are sent
  // first.
  std::pair<int, std::uint32_t> RankOf(DataType type) const;
};

}  // namespace moondb
