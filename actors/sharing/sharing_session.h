// SharingSession: sends one destination the records that it lacks, over a radio that loses and duplicates messages and
// interrupts connections.
//
// This is the sending side of anti-entropy: the session compares the destination's have-set (a version vector whose
// entries are interval sets) with this agent's records, and retransmits until all are acknowledged. Delivery is at
// least once, and the receiver's insert is idempotent. There is one session per destination and kind. Sync (own
// records) and replication (all records) differ only in their filter (paper, Section 4). The session trusts only the
// destination's have-set, so a lost acknowledgment, a restart on either side, a lost disk or a new leader needs no
// special case.
//
//   Order -> Hello -> (Have, a page) ... -> MissingRequest -> (MissingReply) -> Batch -> (Have: acknowledgment) ...
//   done
//
// The destination's have-set arrives in pages, and the session requests each page with a Hello (have_collector.h). A
// lost page is requested again after a delay, or when the destination reconnects. The pages that have arrived are kept.
//
// The last batch of an order contains the information that no records remain. It is sent even if no record was missing,
// so the receiver learns that the order ended. Several batches may be in flight. Their records count as held by the
// destination only for the choice of the next batch. If a batch is given up or the session starts over, these records
// count as missing again.
//
// Flow control: unacknowledged bytes stay within `unacked_bytes_max` and the receiver's credit. A larger message is
// sent only when nothing else is in flight. After `resend_after` without progress the session starts over under a new
// id, and repeats this with a growing delay. An order stays open until all its records are acknowledged or Close is
// called.
//
// While the window to the destination is not open (SetWindow), the session sends nothing and runs no timer, but accepts
// acknowledgments of batches in flight. When the window opens, an open session starts over at once. If the window
// admits only states, an order sends the states that the destination lacks, and its other records wait.
//
// The send rate is the smaller of the session's part of this agent's radio budget (SetRate) and the rate that the
// destination grants. An order may have a limit of coded bytes, and ends when they are used up. If the destination gave
// the order, the session reports the end to it (OrderEnd). Records of a type whose schemas differ between the two ends
// (model/type_schema.h) are not sent.
//
// The parts of a session are separate classes: the order (standing_order.h), making batches (batch_maker.h), batches in
// flight (in_flight_batches.h) and notes to storage (peer_notes.h). The session itself has one phase and one deadline.
//
// A plain state machine: inputs return the actions to perform. The caller passes the time with each input. Not
// thread-safe.
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
    Duration resend_after = std::chrono::seconds(5);       // Must be longer than a round trip of the radio.
    Duration resend_after_max = std::chrono::seconds(30);  // The delay doubles up to this.
    std::size_t unacked_bytes_max = 8 * 1024;              // Bytes that a 1 Mbps radio sends in 65 ms.
    std::size_t batch_bytes_max = 4 * 1024;                // Coded bytes. Larger records are sent in fragments.
    std::size_t bytes_per_second_min = 16 * 1024;          // At a lower rate the session starts over too early.
    std::vector<DataType> state_types;                     // Types that may be sent in a window of kStatesOnly.
    proto::Codec codec = proto::CODEC_COMPACT;             // Codec of the sent batches.
    PaperSql paper_sql;                                    // Used for CODEC_PAPER_SQL.
    TypeSchemas schemas;                                   // This agent's schema of each data type.
  };

  using Window = StandingOrder::Window;

  // Ids of this session count from `first_id`, which is random, so they differ from the ids of an earlier process.
  SharingSession(Options options, proto::SharingKind kind, AgentId destination, std::uint64_t first_id);

  // Gives the session an order. Starts a closed session; an open session asks storage for missing records again. The
  // order includes records that are stored before this call. Records stored later are included only if their type is
  // under the policy `latest` (MissingRequest.mark). `bytes_max` not 0: the order ends when about that many coded bytes
  // are sent, give or take a batch. If an open order has no limit, the new order has none either. StateOf(id) returns
  // how the order ended. The order is complete when the session next completes.
  SharingActions Order(proto::RecordFilter filter, Time now, std::uint64_t bytes_max = 0, ShareOrderId id = {});
  // Sends states without an order. If the session is closed, starts it for these states; it is then not counted,
  // reports no OrderEnd, and is replaced by any order. If the session is open, it only asks storage for new records
  // again.
  SharingActions BringPeriodic(const proto::RecordFilter& states, Time now);
  // Ends the session before all records are acknowledged, and forgets the order.
  SharingActions Close();

  // Handle messages from the destination. A message with another session id than the current one is ignored. A Have is
  // refused and counted if its have-set is malformed or too large, or if it acknowledges a batch that was never sent.
  SharingActions OnHave(const proto::Have& have, Time now);
  SharingActions OnRefusal(const proto::Refusal& refusal, Time now);
  // Handles storage's answer to a MissingRequest. An answer to an earlier request than the last one is ignored.
  SharingActions OnMissingReply(std::uint64_t request_id, const proto::MissingReply& reply, Time now);
  // Call if storage could not use the note with this id, since it missed an earlier note about the destination
  // (peer_notes.h).
  SharingActions OnPeerHaveRequest(std::uint64_t request_id);
  // Sets this session's part of the agent's radio budget, in bytes per second. 0, the initial value: no limit.
  void SetRate(double bytes_per_second, Time now);
  // Sets the window to the destination, which is initially open.
  SharingActions SetWindow(Window window, Time now);
  // Call when the destination reconnected. An open session starts over immediately, or requests the expected page
  // again.
  SharingActions OnConnected(Time now);
  // Call when deadline() is reached. Earlier calls have no effect.
  SharingActions OnTimer(Time now);

  // Call if the actor could not send a message. Status shows the text.
  void NoteError(std::string text) { last_error_ = std::move(text); }

  std::optional<Time> deadline() const;  // Nullopt while the session is closed or waits for the window.
  bool is_open() const { return phase_ != Phase::kClosed; }
  bool is_ordered() const { return is_open() && !order_.is_periodic(); }
  // Coded bytes that the order may still send; 0: no limit.
  std::uint64_t bytes_left() const { return order_.bytes_left().value_or(0); }
  StandingOrder::Reached StateOf(ShareOrderId id) const { return order_.StateOf(id); }
  // True if the destination refused at least two messages without progress in between.
  bool is_refused_again() const { return is_open() && resend_delay_.is_refused_again(); }
  // True if the session uses the radio now. It then gets a part of the radio budget.
  bool is_moving() const { return is_answered() && !order_.is_waiting(); }
  // Types whose schema differs at the destination, as of its last answer.
  const std::set<DataType>& other_schema_types() const { return order_.other_schema_types(); }
  AgentId destination() const { return destination_; }
  proto::ShareSession Status(Time now) const;

 private:
  // In each phase, nothing is sent while the order waits for its window.
  enum class Phase {
    kClosed,
    kAwaitingHave,  // Waits for the destination's have-set.
    kSending,       // The have-set is known. Storage may be asked for missing records.
    kAsking,        // Waits for storage to return missing records.
    kEnding,        // Storage returned the last missing records.
  };

  bool is_answered() const { return phase_ != Phase::kClosed && phase_ != Phase::kAwaitingHave; }
  // True if some, but not all, pages of the destination's have-set have arrived.
  bool IsCollecting() const { return phase_ == Phase::kAwaitingHave && pages_.is_begun(); }
  void LookAgain(Time now, SharingActions& actions);
  Result<void> CheckBatchNumber(const proto::Have& have) const;
  Result<void> TakePage(const proto::Have& have, Time now, SharingActions& actions);
  void TakeAnswer(const proto::Have& last_page, Time now, SharingActions& actions);
  Result<void> TakeTouchedStreams(const proto::Have& have, SharingActions& actions);
  void TakeGrant(const proto::Have& have, Time now);
  void TakeAcknowledgment(std::uint32_t batch_number, Time now);
  void Start(Time now, SharingActions& actions);  // Calls Restart with the shortest delay.
  // Like Start, but if useful pages of the have-set have arrived, keeps these pages and requests the next one.
  void GoOn(Time now, SharingActions& actions);
  void AskForPage(Time now, SharingActions& actions);  // Sends no Hello while the order waits for its window.
  // Starts over under a new session id. Forgets the batches in flight and requests the first page.
  void Restart(Time now, SharingActions& actions);
  void SayHello(SharingActions& actions);
  void Complete(SharingActions& actions);
  void End(Ending ending, SharingActions& actions);  // Ends the session before all records are acknowledged.
  void Fill(Time now, SharingActions& actions);
  void SendWhatMayLeave(Time now, SharingActions& actions);
  void SendReady(Time now, SharingActions& actions);
  // Ends the session when the byte limit of its order is used up. If the destination gave the order, first reports the
  // end to the destination.
  void EndLimited(Time now, SharingActions& actions);
  bool MayLeave(const MadeBatch& batch) const;
  std::size_t BatchBytesMax() const;
  void AskForMissing(SharingActions& actions);
  void AskAgain();  // Asks storage again, since records may have become missing after its last answer.
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
  // True if, since the last order and the last restart, the destination was notified that the byte limit is used up.
  bool is_limit_reported_ = false;
  double own_rate_ = 0;
  double granted_rate_ = 0;
  Pacer pacer_;
  std::optional<Time> paced_until_;  // The ready batch waits until this time to keep to the rate.
  ResendDelay resend_delay_;
  Time deadline_{};
  Time last_progress_{};
  SessionCounts counts_;
  std::string last_error_;
};

}  // namespace moondb
