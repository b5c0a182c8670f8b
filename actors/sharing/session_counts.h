// SessionCounts: counters of one session for status reports. The counters of AddSinceAnswerTo restart at 0 each time
// the destination answers a Hello. All other counters start at 0 with the actor. Plain value.
#pragma once

#include <chrono>
#include <cstddef>

#include "proto/sharing.pb.h"

namespace moondb::proto {
class ShareSession;
}  // namespace moondb::proto

namespace moondb {

// How an order ended: all records were acknowledged, the order was closed before that, or its limit of coded bytes is
// used up.
enum class Ending { kCompleted, kClosed, kLimited };

class SessionCounts {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  void ObserveAnswer(Time now);  // The destination answered a Hello.
  void ObserveSent(std::size_t records, std::size_t coded_bytes, proto::Codec codec);
  void ObserveAcknowledged(std::size_t records, std::size_t coded_bytes);
  void ObserveResends(std::size_t batches) { resends_ += static_cast<double>(batches); }
  void ObserveRefusedHave() { ++refused_haves_; }
  void ObserveEnd(Ending ending, Time last_progress);

  void AddTo(proto::ShareSession& status, Time now) const;
  // Adds the counters since the destination's last answer. Requires: the destination has answered the session's last
  // Hello.
  void AddSinceAnswerTo(proto::ShareSession& status, Time now) const;

 private:
  double sent_records_ = 0;
  double acknowledged_records_ = 0;
  double coded_bytes_ = 0;
  proto::Codec codec_ = proto::CODEC_UNSPECIFIED;  // Codec of the last batch.
  double completed_ = 0;
  Time last_end_{};  // Last progress of the last completed session.
  double closed_ = 0;
  double limited_ = 0;
  double resends_ = 0;
  double refused_haves_ = 0;
  Time answered_{};
  double records_since_answer_ = 0;
  double bytes_since_answer_ = 0;
};

}  // namespace moondb
