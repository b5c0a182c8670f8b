#include "actors/registration/match_report.h"

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

void MatchReport::OnPlanned(std::size_t registered_count, bool has_pairs) {
  registered_count_ = registered_count;
  pass_count_ += has_pairs ? 1 : 0;
}

proto::RegistrationReply MatchReport::ToReply(bool is_idle, std::size_t map_count) const {
  proto::RegistrationReply reply;
  reply.set_is_done(is_idle && trouble_.empty());
  reply.set_map_count(static_cast<double>(registered_count_));
  reply.set_other_map_count(static_cast<double>(map_count - registered_count_));
  reply.set_pass_count(static_cast<double>(pass_count_));
  reply.set_stored_count(static_cast<double>(stored_count_));
  AddCounts(counts_, *reply.mutable_counts());
  reply.set_seconds(std::chrono::duration<double>(spent_).count());
  reply.set_text(trouble_);
  return reply;
}

}  // namespace moondb
