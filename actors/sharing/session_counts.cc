#include "actors/sharing/session_counts.h"

#include "proto/share_status.pb.h"

namespace moondb {

void SessionCounts::ObserveAnswer(Time now) {
  answered_ = now;
  records_since_answer_ = 0;
  bytes_since_answer_ = 0;
}

void SessionCounts::ObserveSent(std::size_t records, std::size_t coded_bytes, proto::Codec codec) {
  sent_records_ += static_cast<double>(records);
  coded_bytes_ += static_cast<double>(coded_bytes);
  codec_ = codec;
}

void SessionCounts::ObserveAcknowledged(std::size_t records, std::size_t coded_bytes) {
  acknowledged_records_ += static_cast<double>(records);
  records_since_answer_ += static_cast<double>(records);
  bytes_since_answer_ += static_cast<double>(coded_bytes);
}

void SessionCounts::ObserveEnd(Ending ending, Time last_progress) {
  if (ending == Ending::kCompleted) {
    ++completed_;
    last_end_ = last_progress;
  }
  if (ending == Ending::kClosed) ++closed_;
  if (ending == Ending::kLimited) ++limited_;
}

void SessionCounts::AddTo(proto::ShareSession& status, Time now) const {
  status.set_sent_records(sent_records_);
  status.set_acknowledged_records(acknowledged_records_);
  status.set_coded_bytes(coded_bytes_);
  status.set_codec(codec_);
  status.set_completed_sessions(completed_);
  if (completed_ > 0) status.set_seconds_since_end(std::chrono::duration<double>(now - last_end_).count());
  status.set_closed_sessions(closed_);
  status.set_limited_sessions(limited_);
  status.set_resends(resends_);
  status.set_refused_haves(refused_haves_);
}

void SessionCounts::AddSinceAnswerTo(proto::ShareSession& status, Time now) const {
  status.set_session_s(std::chrono::duration<double>(now - answered_).count());
  status.set_session_acknowledged_records(records_since_answer_);
  status.set_session_acknowledged_bytes(bytes_since_answer_);
}

}  // namespace moondb
