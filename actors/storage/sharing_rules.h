// SharingRules: how much of which data type this store keeps and passes on.
//
// A type of the team has a policy. A custom type that this agent's team file does not declare (any more) is *carried*:
// nobody here knows its policy, so what other agents sent of it is kept as they sent it, passed on to who lacks it, and
// dropped where they say that it is superseded. This agent's own rows of such a type stay, and stay here. Plain values.
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
  Policies policies;         // Of the built-in types; those without one are not shared.
  CustomTypes custom_types;  // Complete: with policy and priority.
  // Of which the ground wants all, at the agent that brings it there; elsewhere none.
  std::set<DataType> for_ground = {};

  // POLICY_NONE for a type that the team does not know.
  proto::Policy PolicyOf(DataType type) const;
  bool IsLatest(DataType type) const { return PolicyOf(type) == proto::POLICY_LATEST; }
  bool IsCarried(DataType type) const;
  // Whether records of the type may be dropped because a peer says so.
  bool MayBeDropped(DataType type) const { return IsLatest(type) || IsCarried(type); }
  // Whether peers that lack records of this stream may have them from here.
  bool IsShared(const StreamKey& stream) const;
  // A smaller one goes first: SharingRank, then the custom type's priority.
  std::pair<int, std::uint32_t> RankOf(DataType type) const;
};

}  // namespace moondb
