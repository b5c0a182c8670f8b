#include "actors/registration/match_report.h"

#include <algorithm>

namespace moondb {

void AddCounts(const std::map<MatchVerdict, std::size_t>& counts,
               google::protobuf::RepeatedPtrField<proto::RegistrationCount>& out) {
  for (const auto& [verdict, count] : counts) {
    if (count == 0) continue;
    proto::RegistrationCount& added = *out.Add();
    added.set_verdict(ToString(verdict));
    added.set_count(static_cast<double>(count));
  }
}

void MatchReport::OnPlanned(const Inputs& inputs, bool has_pairs) {
  is_planned_ = true;
  inputs_ = inputs;
  pass_count_ += has_pairs ? 1 : 0;
}

proto::RegistrationReply MatchReport::ToReply(bool is_idle, std::size_t map_count) const {
  proto::RegistrationReply reply;
  reply.set_is_done(is_idle && is_planned_ && trouble_.empty());
  reply.set_map_count(static_cast<double>(inputs_.registered_count));
  // Maps may have been removed since the pass began.
  reply.set_other_map_count(static_cast<double>(map_count - std::min(map_count, inputs_.registered_count)));
  reply.set_unposed_map_count(static_cast<double>(inputs_.unposed_count));
  reply.set_removed_map_match_count(static_cast<double>(inputs_.removed_map_match_count));
  reply.set_pass_count(static_cast<double>(pass_count_));
  reply.set_stored_count(static_cast<double>(stored_count_));
  AddCounts(counts_, *reply.mutable_counts());
  reply.set_seconds(std::chrono::duration<double>(spent_).count());
  reply.set_text(trouble_);
  return reply;
}

}  // namespace moondb
