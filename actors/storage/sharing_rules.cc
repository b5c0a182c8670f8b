#include "actors/storage/sharing_rules.h"

#include "model/data_types.h"

namespace moondb {

namespace {

constexpr std::uint32_t kCarriedPriority = 10;  // Carried types are sent after all declared types.

}  // namespace

proto::Policy SharingRules::PolicyOf(DataType type) const {
  if (const proto::CustomType* custom = FindCustomType(custom_types, type)) return custom->share();
  const auto policy = policies.find(type);
  return policy == policies.end() ? proto::POLICY_NONE : policy->second;
}

bool SharingRules::IsCarried(DataType type) const {
  return IsCustom(type) && FindCustomType(custom_types, type) == nullptr;
}

bool SharingRules::IsShared(const StreamKey& stream) const {
  if (IsCarried(stream.type)) return stream.origin != self;
  return PolicyOf(stream.type) != proto::POLICY_NONE;
}

std::pair<int, std::uint32_t> SharingRules::RankOf(DataType type) const {
  const proto::CustomType* custom = FindCustomType(custom_types, type);
  const std::uint32_t priority = custom ? custom->priority() : IsCarried(type) ? kCarriedPriority : 0;
  return {SharingRank(type), priority};
}

}  // namespace moondb
