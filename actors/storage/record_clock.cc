#include "actors/storage/record_clock.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "model/record_check.h"
#include "proto/status.pb.h"

namespace moondb {

bool RecordClock::Judge(std::int64_t utc_ns, Time now) {
  ClockJudge::Verdict verdict = judge_.Judge(utc_ns, now);
  if (verdict.suspect.empty() != suspect_.empty()) {
    spdlog::warn("storage: this agent's clock is {}",
                 verdict.suspect.empty() ? "not suspect any more" : "suspect: " + verdict.suspect);
  }
  suspect_ = std::move(verdict.suspect);
  return verdict.has_jumped;
}

std::optional<proto::InsertRequest> RecordClock::Mark(const proto::InsertRequest& request, std::int64_t utc_ns,
                                                      Time now) {
  const auto is_suspect = [&](const proto::Record& record) {
    return !suspect_.empty() || IsSuspectTimestamp(record.timestamp_ns(), utc_ns);
  };
  const auto first = std::find_if(request.records().begin(), request.records().end(), is_suspect);
  if (first == request.records().end()) return std::nullopt;
  if (suspect_.empty()) suspect_timestamp_ = {TypeOf(*first), first->timestamp_ns(), now};
  proto::InsertRequest marked = request;
  for (proto::Record& record : *marked.mutable_records()) {
    if (is_suspect(record)) record.set_is_clock_suspect(true);
  }
  return marked;
}

void RecordClock::Describe(std::int64_t utc_ns, Time now, proto::StorageStatus& status) const {
  status.set_clock_suspect(suspect_);
  if (suspect_timestamp_ && now - suspect_timestamp_->seen < kShownFor) {
    status.mutable_suspect_timestamp()->set_data_type(suspect_timestamp_->type);
    status.mutable_suspect_timestamp()->set_timestamp_ns(suspect_timestamp_->timestamp_ns);
  }
  for (const ClockJudge::PeerOffset& offset : judge_.PeerOffsets(utc_ns, now)) {
    proto::PeerClockOffset& added = *status.add_peer_clocks();
    added.set_agent_id(offset.peer);
    added.set_offset_s(offset.offset_s);
    added.set_age_s(offset.age_s);
  }
}

}  // namespace moondb
