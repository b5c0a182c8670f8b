// RecordClock judges the time of records: this agent's clock, and the timestamps that clients give to records. It marks
// records whose age is unknown (Record.is_clock_suspect).
//
// A record is marked if this agent's clock is suspect (clock_judge.h), or if its own timestamp is (IsSuspectTimestamp).
// Only the origin judges a record, when a client inserts it. Marked records are never removed by age and never win a
// cell of the map because they are newer.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "actors/storage/clock_judge.h"
#include "model/ids.h"
#include "proto/storage.pb.h"

namespace moondb::proto {
class StorageStatus;
}  // namespace moondb::proto

namespace moondb {

class RecordClock {
 public:
  using Time = ClockJudge::Time;
  // The status names a suspect timestamp for this long.
  static constexpr std::chrono::minutes kShownFor{10};

  explicit RecordClock(AgentId base_station) : judge_(base_station) {}

  void ObservePeer(AgentId peer, std::int64_t utc_ns, Time now) { judge_.ObservePeer(peer, utc_ns, now); }
  // Judges this agent's clock, which shows `utc_ns`. Logs a change. Returns true if the clock jumped since the last
  // call.
  bool Judge(std::int64_t utc_ns, Time now);
  // Why the clock is suspect, according to the last call of Judge; empty if it is trusted.
  const std::string& suspect() const { return suspect_; }

  // Returns the request with its suspect records marked; null if none has to be marked. Call Judge first.
  std::optional<proto::InsertRequest> Mark(const proto::InsertRequest& request, std::int64_t utc_ns, Time now);

  // Fills in clock_suspect, suspect_timestamp and peer_clocks.
  void Describe(std::int64_t utc_ns, Time now, proto::StorageStatus& status) const;

 private:
  ClockJudge judge_;
  std::string suspect_;
  // The last record that was marked although this agent's clock was trusted, and its arrival; null if there was none.
  struct SuspectTimestamp {
    DataType type = 0;
    std::int64_t timestamp_ns = 0;
    Time seen;
  };
  std::optional<SuspectTimestamp> suspect_timestamp_;
};

}  // namespace moondb
