// SharingSession: brings the records that one destination lacks to it, over a radio that loses, repeats and cuts.
//
// One object per destination and kind: sync (own records) and replication (all records) differ in their filter alone
// (paper, Section 4). It trusts nothing but the destination's have-set: a lost acknowledgment, a restart on either
// side, a lost disk or a new leader need no special case.
//
//   Order -> Hello -> (Have, a page) ... -> MissingRequest -> (MissingReply) -> Batch -> (Have: acknowledgment) ...
//   done
//
// The destination's have-set comes in pages, each asked for by a Hello of the session (have_collector.h). One that is
// lost is asked for again, also when the destination is reached again; those before it are not.
//
// The last batch says that none remain, and holds nothing where nothing was missing: the receiver hears the end of each
// order. Several batches may be under way. What they carry counts as had while the next one is chosen, and only there:
// when a batch is given up, or the session starts again, its records are missing again. Un-acknowledged bytes stay
// within `unacked_bytes_max` and what the receiver grants; one message that is larger travels when nothing else is
// under way. Without progress for `resend_after` the session starts again under a new id, with a growing delay, for as
// long as it takes: an order stands until all is acknowledged or Close is called.
//
// While the window to the destination is not open (SetWindow) it sends nothing there and waits for nothing; what was
// handed over before may be acknowledged. When the window opens, an open session starts over at once. In between, where
// states pass, each order brings the destination the states that it lacks, and the rest of it waits.
//
// What it sends keeps to a rate: the smaller of what this agent's own part of the radio's budget leaves it (SetRate)
// and what the destination grants. An order may be limited to so many coded bytes; it ends when they are used up. A
// destination that gave the order itself is told its end (OrderEnd).
// Records of a type that the two ends understand differently (model/type_schema.h) are not sent.
//
// What is ordered, the batches that are made, those that are under way and what storage is notified of are parts of
// their own (standing_order.h, batch_maker.h, in_flight_batches.h, peer_notes.h); the session itself is in one phase at
// a time and has one deadline.
//
// A plain state machine: inputs return what is to be done. Time comes in with each input. Not thread-safe.
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
    Duration resend_after = std::chrono::seconds(5);       // Longer than one round trip of the radio.
    Duration resend_after_max = std::chrono::seconds(30);  // The delay doubles up to this.
    std::size_t unacked_bytes_max = 8 * 1024;              // 65 ms of a 1 Mbps radio.
    std::size_t batch_bytes_max = 4 * 1024;                // Coded. A larger record travels in pieces of this size.
    std::size_t bytes_per_second_min = 16 * 1024;          // A slower radio is given up on and tried again.
    std::vector<DataType> state_types;                     // What may pass a window of kStatesOnly.
    proto::Codec codec = proto::CODEC_COMPACT;             // Of what it sends.
    PaperSql paper_sql;                                    // For CODEC_PAPER_SQL.
    TypeSchemas schemas;                                   // What this agent understands by each type.
  };

  using Window = StandingOrder::Window;

  // `first_id` is random: the ids of this session count from it, so that they differ from those of an earlier process.
  SharingSession(Options options, proto::SharingKind kind, AgentId destination, std::uint64_t first_id);

  // Start, or, when open, look again for records once all is sent: what was stored before this is included, and what is
  // stored later is not, but for types under the policy `latest` (MissingRequest.mark).
  // `bytes_max` not 0: it ends when so many coded bytes are sent, give or take a batch; an open order without that
  // limit stays without. Status says by `id` how the order ended: only a session that
  // completes after this has completed it.
  SharingActions Order(proto::RecordFilter filter, Time now, std::uint64_t bytes_max = 0, ShareOrderId id = {});
  // States that nobody ordered, when no session is open: one that does not count, that tells no end and that any order
  // takes the place of. An open session is reminded that there may be new records.
  SharingActions BringPeriodic(const proto::RecordFilter& states, Time now);
  // End without completing. The order is forgotten.
  SharingActions Close();

  // From the destination. A session id other than the present one is ignored; a have-set that is malformed, too large
  // or of a batch that was never sent is refused and counted.
  SharingActions OnHave(const proto::Have& have, Time now);
  SharingActions OnRefusal(const proto::Refusal& refusal, Time now);
  // From storage; an answer to another question than the last one is ignored.
  SharingActions OnMissingReply(std::uint64_t request_id, const proto::MissingReply& reply, Time now);
  // Storage lacks what was noted of the destination before the note of this id.
  SharingActions OnPeerHaveRequest(std::uint64_t request_id);
  // Bytes a second that this agent's other sessions leave to this one; 0, as at first: no limit.
  void SetRate(double bytes_per_second, Time now);
  // Open at first.
  SharingActions SetWindow(Window window, Time now);
  // The destination was reached again: an open session starts over at once, or asks for the page that it waits for.
  SharingActions OnConnected(Time now);
  // To be called when deadline() has come; earlier calls do nothing.
  SharingActions OnTimer(Time now);

  // The actor could not hand over a message; shown in status.
  void NoteError(std::string text) { last_error_ = std::move(text); }

  std::optional<Time> deadline() const;  // None while closed, and while it waits for the window.
  bool is_open() const { return phase_ != Phase::kClosed; }
  bool is_ordered() const { return is_open() && !order_.is_periodic(); }
  std::uint64_t bytes_left() const { return order_.bytes_left().value_or(0); }  // Of a limited order; 0: not limited.
  StandingOrder::Reached StateOf(ShareOrderId id) const { return order_.StateOf(id); }
  bool is_refused_again() const { return is_open() && resend_delay_.is_refused_again(); }  // Without progress between.
  bool is_moving() const { return is_answered() && !order_.is_waiting(); }  // It has its part of the radio.
  // What the destination understands differently, as it said last.
  const std::set<DataType>& other_schema_types() const { return order_.other_schema_types(); }
  AgentId destination() const { return destination_; }
  proto::ShareSession Status(Time now) const;

 private:
  // While the order waits for its window nothing is sent, in whichever phase.
  enum class Phase {
    kClosed,
    kAwaitingHave,  // The destination is to say what it has.
    kSending,       // It has; storage may be asked what it lacks.
    kAsking,        // Storage was asked.
    kEnding,        // Storage said that nothing more is missing.
  };

  bool is_answered() const { return phase_ != Phase::kClosed && phase_ != Phase::kAwaitingHave; }
  // Pages of the destination's have-set are here, but not all of them.
  bool IsCollecting() const { return phase_ == Phase::kAwaitingHave && pages_.is_begun(); }
  void LookAgain(Time now, SharingActions& actions);
  Result<void> CheckBatchNumber(const proto::Have& have) const;
  Result<void> TakePage(const proto::Have& have, Time now, SharingActions& actions);
  void TakeAnswer(const proto::Have& last_page, Time now, SharingActions& actions);
  Result<void> TakeTouchedStreams(const proto::Have& have, SharingActions& actions);
  void TakeGrant(const proto::Have& have, Time now);
  void TakeAcknowledgment(std::uint32_t batch_number, Time now);
  void Start(Time now, SharingActions& actions);  // Restart with the shortest delay.
  // Start, but for pages that are here and of use: the next one is asked for.
  void GoOn(Time now, SharingActions& actions);
  void AskForPage(Time now, SharingActions& actions);  // Unless it waits for the window.
  // A new id and Hello, unless it waits for the window; nothing is under way any more.
  void Restart(Time now, SharingActions& actions);
  void SayHello(SharingActions& actions);
  void Complete(SharingActions& actions);
  void End(Ending ending, SharingActions& actions);  // Without having completed.
  void Fill(Time now, SharingActions& actions);
  void SendWhatMayLeave(Time now, SharingActions& actions);
  void SendReady(Time now, SharingActions& actions);
  // The order's bytes are used up: tells the destination if it gave the order, then ends.
  void EndLimited(Time now, SharingActions& actions);
  bool MayLeave(const MadeBatch& batch) const;
  std::size_t BatchBytesMax() const;
  void AskForMissing(SharingActions& actions);
  void AskAgain();  // What storage said is missing is no longer all.
  void GiveUp(std::size_t batches);
  void ForgetInFlight();
  void SetPace(Time now);
  void SetDeadline(Time now);

  Options options_;
  proto::SharingKind kind_;
  AgentId destination_;

  Phase phase_ = Phase::kClosed;
  std::uint64_t session_id_;
  std::uint64_t request_id_;  // Of the last question to storage.
  StandingOrder order_;
  HaveCollector pages_;
  BatchMaker maker_;
  InFlightBatches in_flight_;
  PeerNotes notes_;
  bool is_limit_reported_ =
      false;  // To the destination, since the last order and the last Hello that begins a session.
  double own_rate_ = 0;
  double granted_rate_ = 0;
  Pacer pacer_;
  std::optional<Time> paced_until_;  // What is ready waits for the rate.
  ResendDelay resend_delay_;
  Time deadline_{};
  Time last_progress_{};
  SessionCounts counts_;
  std::string last_error_;
};

}  // namespace moondb
