// SharingSession: sends one destination the records that it lacks, over a radio that loses and duplicates messages and
// interrupts connections.
//
// This is the sending side of anti-entropy. The session compares the destination's have-set (a version vector whose
// entries are interval sets) with this agent's records, and retransmits until all records are acknowledged. Delivery is
// at least once, and the receiver's insert is idempotent. Sync (own records) and replication (all records) differ only
// in their filter. An order stays open until all its records are acknowledged, its byte limit is used up, or Close is
// called.
//
//   Order -> Hello -> (Have, a page) ... -> MissingRequest -> (MissingReply) -> Batch -> (Have: acknowledgment) ...
//   done
//
// Flow control: unacknowledged bytes stay within `unacked_bytes_max` and the receiver's credit. A larger message is
// sent only when nothing else is in flight. The send rate stays within the session's part of the radio budget (SetRate)
// and the rate that the destination grants.
//
// After `resend_after` without progress, the session starts over under a new id and requests the have-set again, with a
// growing delay. Lost acknowledgments, restarts of either side, lost disks and new leaders need no other handling.
// While the window to the destination is shut (SetWindow), the session sends nothing and runs no timer, but accepts
// acknowledgments. In a window of kStatesOnly, the session sends only the order's states.
//
// A state machine: each input returns the messages to send, and the caller passes the time. Not thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "actors/sharing/batch_maker.h"
#include "actors/sharing/codec.h"
#include "actors/sharing/have_collector.h"
#include "actors/sharing/in_flight_batches.h"
#include "actors/sharing/pacer.h"
#include "actors/sharing/peer_notes.h"
#include "actors/sharing/resend_delay.h"
#include "actors/sharing/session_counts.h"
#include "actors/sharing/sharing_action.h"
#include "actors/sharing/standing_order.h"
#include "model/have_set.h"
#include "model/type_schema.h"
#include "proto/message.pb.h"

namespace moondb::proto {
class ShareSession;
}  // namespace moondb::proto

namespace moondb {

class SharingSession {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  struct Options {
    Duration resend_after = std::chrono::seconds(5);       // Must be longer than a round trip over the radio.
    Duration resend_after_max = std::chrono::seconds(30);  // The delay doubles up to this value.
    std::size_t unacked_bytes_max = 8 * 1024;              // Bytes that a 1 Mbps radio sends in 65 ms.
    std::size_t batch_bytes_max = 4 * 1024;                // Coded bytes. Larger records are sent in fragments.
    // Slowest rate that deadlines assume. A slower radio makes the session start over too early.
    std::size_t bytes_per_second_min = 16 * 1024;
    std::vector<DataType> state_types;          // Types that may be sent in a window of kStatesOnly.
    proto::Codec codec = proto::CODEC_COMPACT;  // Codec of the sent batches.
    PaperSql paper_sql;                         // Used for CODEC_PAPER_SQL.
    TypeSchemas schemas;                        // This agent's schema of each data type.
  };

  using Window = StandingOrder::Window;

  // Requires: `first_id` is random. The session's ids count up from `first_id`, so they differ from the ids of an
  // earlier process.
  SharingSession(Options options, proto::SharingKind kind, AgentId destination, std::uint64_t first_id);

  // Gives the session an order, and starts the session if it is closed. An open session asks storage for missing
  // records again. The order includes the records that are stored before this call. A record that is stored later is
  // included only if its type is under the policy `latest` (MissingRequest.mark). If `bytes_max` is not 0, the order
  // ends when about that many coded bytes are sent. If the order replaces an open order without a limit, it has no
  // limit either. StateOf(id) returns the state of the order.
  SharingActions Order(proto::RecordFilter filter, Time now, std::uint64_t bytes_max = 0, ShareOrderId id = {});
  // Sends the records that `filter` selects, without an order, and with them those that are stored meanwhile.
  // `is_for_states`: they are states, which may also be sent in a window of kStatesOnly. A closed session starts for
  // these records. Such a session reports no OrderEnd, its end is not counted, and any order replaces it. An open
  // session with an order only asks storage for missing records again.
  SharingActions SharePeriodic(const proto::RecordFilter& filter, bool is_for_states, Time now);
  // Ends the session before all records are acknowledged, and forgets the order.
  SharingActions Close();

  // Handle messages from the destination. A message with another session id than the current one is ignored. A Have is
  // refused and counted if its have-set is malformed or too large, or if it acknowledges a batch that was never sent.
  SharingActions OnHave(const proto::Have& have, Time now);
  SharingActions OnRefusal(const proto::Refusal& refusal, Time now);
  // Handles storage's answer to a MissingRequest. An answer to an earlier request than the last one is ignored.
  SharingActions OnMissingReply(std::uint64_t request_id, const proto::MissingReply& reply, Time now);
  // Call when storage requests the destination's whole have-set, since it missed a note (peer_notes.h). `request_id` is
  // the number of the note that storage could not use.
  SharingActions OnPeerHaveRequest(std::uint64_t request_id);
  // Sets this session's part of the agent's radio budget, in bytes per second. 0, the initial value: no limit.
  void SetRate(double bytes_per_second, Time now);
  // Sets the window to the destination, which is initially open.
  SharingActions SetWindow(Window window, Time now);
  // Call when the destination reconnected. An open session starts over immediately. A session that has collected a part
  // of the destination's have-set requests the next page instead.
  SharingActions OnConnected(Time now);
  // Call when deadline() is reached. Earlier calls have no effect.
  SharingActions OnTimer(Time now);

  // Call if the actor could not send a message of this session. Status then contains `text`.
  void KeepError(std::string text) { last_error_ = std::move(text); }

  // Time at which OnTimer must be called next. Nullopt while the session is closed or waits for the window to open.
  std::optional<Time> deadline() const;
  bool is_open() const { return phase_ != Phase::kClosed; }
  bool is_ordered() const { return is_open() && !order_.is_periodic(); }
  // True if the destination did not take some records of the last session that ended.
  bool has_refused() const { return has_refused_; }
  // Coded bytes that the order may still send; 0: no limit.
  std::uint64_t bytes_left() const { return order_.bytes_left().value_or(0); }
  StandingOrder::Reached StateOf(ShareOrderId id) const { return order_.StateOf(id); }
  // True if the destination refused at least two messages without progress in between.
  bool is_refused_again() const { return is_open() && resend_delay_.is_refused_again(); }
  // True if the session uses the radio now. Such a session gets a part of the radio budget.
  bool is_moving() const { return is_answered() && !order_.is_waiting(); }
  // Types whose schema differs at the destination, as of its last answer.
  const std::set<DataType>& other_schema_types() const { return order_.other_schema_types(); }
  AgentId destination() const { return destination_; }
  proto::ShareSession Status(Time now) const;

 private:
  // In every phase, the session sends nothing while order_.is_waiting().
  enum class Phase {
    kClosed,
    kAwaitingHave,  // Waits for the destination's have-set.
    kSending,       // Sends batches and asks storage for further missing records.
    kAsking,        // Waits for storage to return missing records.
    kEnding,        // Sends the last missing records and waits for their acknowledgment.
  };

  bool is_answered() const { return phase_ != Phase::kClosed && phase_ != Phase::kAwaitingHave; }
  // True if some, but not all, pages of the destination's have-set have arrived.
  bool IsCollecting() const { return phase_ == Phase::kAwaitingHave && pages_.is_begun(); }
  void EvaluateAgain(Time now, SharingActions& actions);
  Result<void> CheckBatchNumber(const proto::Have& have) const;
  Result<void> TakePage(const proto::Have& have, Time now, SharingActions& actions);
  void TakeAnswer(const proto::Have& last_page, Time now, SharingActions& actions);
  Result<void> TakeTouchedStreams(const proto::Have& have, SharingActions& actions);
  void TakeGrant(const proto::Have& have, Time now);
  void TakeAcknowledgment(std::uint32_t batch_number, Time now);
  void Start(Time now, SharingActions& actions);  // Calls Restart with the shortest delay.
  // Requests the next page of the have-set if the session has collected pages that are still useful. Otherwise calls
  // Start.
  void GoOn(Time now, SharingActions& actions);
  // Sets the deadline and requests the next page with a Hello. While order_.is_waiting(), sends no Hello.
  void RequestPage(Time now, SharingActions& actions);
  // Starts over under a new session id. Forgets the batches in flight and requests the first page.
  void Restart(Time now, SharingActions& actions);
  void SendHello(SharingActions& actions);
  void Complete(SharingActions& actions);
  void End(Ending ending, SharingActions& actions);  // Ends the session before all records are acknowledged.
  void Fill(Time now, SharingActions& actions);
  void SendWhatMayLeave(Time now, SharingActions& actions);
  void SendReady(Time now, SharingActions& actions);
  // Ends the session, because the byte limit of its order is used up. If the destination gave the order, first sends
  // the destination a batch that reports the end.
  void EndLimited(Time now, SharingActions& actions);
  bool MayLeave(const MadeBatch& batch) const;
  std::size_t BatchBytesMax() const;
  void RequestMissing(SharingActions& actions);
  void RequestAgain();  // Asks storage again, since records may have become missing after its last answer.
  void GiveUp(std::size_t batches);
  void ForgetInFlight();
  void SetPace(Time now);
  void SetDeadline(Time now);

  Options options_;
  proto::SharingKind kind_;
  AgentId destination_;

  Phase phase_ = Phase::kClosed;
  std::uint64_t session_id_;
  std::uint64_t request_id_;  // Id of the last MissingRequest.
  StandingOrder order_;
  HaveCollector pages_;
  BatchMaker maker_;
  InFlightBatches in_flight_;
  PeerNotes notes_;
  // True after the destination was notified that the byte limit is used up. Reset by the next order and by a restart of
  // the session.
  bool is_limit_reported_ = false;
  double own_rate_ = 0;
  double granted_rate_ = 0;
  Pacer pacer_;
  std::optional<Time> paced_until_;  // The ready batch waits until this time to keep to the rate.
  ResendDelay resend_delay_;
  Time deadline_{};
  Time last_progress_{};
  SessionCounts counts_;
  bool has_refused_ = false;
  std::string last_error_;
};

}  // namespace moondb
