// SharingSession: brings the records that one destination lacks to it, over a radio that loses, repeats and cuts.
//
// One object per destination and kind: sync (own records) and replication (all records) differ in their filter alone
// (paper, Section 4). It trusts nothing but the destination's have-set: a lost acknowledgment, a restart on either
// side, a lost disk or a new leader need no special case.
//
//   Order -> Hello -> (Have, whole) -> MissingRequest -> (MissingReply) -> Batch -> (Have: acknowledgment) ... done
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
// and what the destination grants. An order may be limited to so many coded bytes; it ends when they are used up.
// Records of a type that the two ends understand differently (model/type_schema.h) are not sent.
//
// Batches of maps make up runs (codec.h), which go on from order to order. A new one begins where the destination may
// lack a batch of the present one: something was under way or ready when the session started over, one was lost, or the
// destination says so; and when it is closed.
//
// A plain state machine: inputs return what is to be done. Time comes in with each input. Not thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actors/sharing/codec.h"
#include "actors/sharing/pacer.h"
#include "actors/sharing/pieces.h"
#include "actors/sharing/sharing_action.h"
#include "model/have_set.h"
#include "model/type_schema.h"
#include "proto/message.pb.h"

namespace moondb {

// Who gave an order, and what it is called there (model/order_number.h). 0: an order that nobody waits for.
struct ShareOrderId {
  AgentId agent = 0;
  std::uint64_t number = 0;
};

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
    proto::Codec codec = proto::CODEC_COMPACT;             // Where the destination reads it; else zstd.
    PaperSql paper_sql;                                    // For CODEC_PAPER_SQL.
    TypeSchemas schemas;                                   // What this agent understands by each type.
  };

  enum class Window { kOpen, kStatesOnly, kShut };

  // `first_id` is random: the ids of this session count from it, so that they differ from those of an earlier process.
  SharingSession(Options options, proto::SharingKind kind, AgentId destination, std::uint64_t first_id);

  // Start, or, when open, look again for records once all is sent: what was stored before this is included.
  // `bytes_max` not 0: it ends when so many coded bytes are sent, give or take a batch, and the destination is not
  // told; an open order without that limit stays without. Status says by `id` how the order ended: only a session that
  // completes after this has completed it.
  SharingActions Order(proto::RecordFilter filter, Time now, std::uint64_t bytes_max = 0, ShareOrderId id = {});
  // States that nobody ordered, when no session is open: one that does not count, that tells no end and that any order
  // takes the place of. An open session is reminded that there may be new records.
  SharingActions BringUnasked(const proto::RecordFilter& states, Time now);
  // End without completing. The order is forgotten.
  SharingActions Close();

  // From the destination. A session id other than the present one is ignored; a have-set that is malformed, too large
  // or of a batch that was never sent is refused and counted.
  SharingActions OnHave(const proto::Have& have, Time now);
  SharingActions OnRefusal(const proto::Refusal& refusal, Time now);
  // From storage; an answer to another question than the last one is ignored.
  SharingActions OnMissingReply(std::uint64_t request_id, const proto::MissingReply& reply, Time now);
  // Bytes a second that this agent's other sessions leave to this one; 0, as at first: no limit.
  void SetRate(double bytes_per_second, Time now);
  // Open at first.
  SharingActions SetWindow(Window window, Time now);
  // The destination was reached again: an open session starts over at once.
  SharingActions OnConnected(Time now);
  // To be called when deadline() has come; earlier calls do nothing.
  SharingActions OnTimer(Time now);

  // The actor could not hand over a message; shown in status.
  void NoteError(std::string text) { last_error_ = std::move(text); }

  std::optional<Time> deadline() const;  // None while closed, and while it waits for the window.
  bool is_open() const { return phase_ != Phase::kClosed; }
  bool is_ordered() const { return is_open() && !is_unasked_; }
  std::uint64_t bytes_left() const { return bytes_left_.value_or(0); }          // Of a limited order; 0: not limited.
  bool is_moving() const { return phase_ == Phase::kSending && !is_waiting_; }  // It has its part of the radio.
  // What the destination understands differently, as it said last.
  const std::set<DataType>& other_schema_types() const { return other_schema_types_; }
  AgentId destination() const { return destination_; }
  proto::ShareSession Status(Time now) const;

 private:
  enum class Phase { kClosed, kAwaitingHave, kSending };

  struct CodedRecords {
    proto::Message message;  // Its Batch is complete but for the number.
    std::vector<RecordKey> keys;
    std::vector<proto::StreamHave> dropped;
    std::size_t bytes = 0;
    std::uint32_t run = 0;         // As of CodedBatch.
    bool leans_on_others = false;  // Likewise.
  };

  // The newest order of one agent.
  struct KnownOrder {
    proto::SessionOrder order;
    bool is_open = false;  // The session has not ended since.
  };

  void Note(ShareOrderId id);
  // The session ends: each open order has come so far.
  void EndOrders(void (proto::SessionOrder::*set_reached)(std::uint64_t));
  void LookAgain(Time now, SharingActions& actions);
  bool IsForStates() const { return window_ == Window::kStatesOnly || is_unasked_; }
  // Whose streams the filter is about; empty: everybody's.
  std::set<AgentId> OriginsMeant() const;
  // The destination's answer to the last Hello speaks of all that the filter is about.
  bool IsAllAsked() const;
  Result<HaveSet> CheckHave(const proto::Have& have) const;
  proto::RecordFilter StatesMeant() const;        // The part of the order that passes a window of kStatesOnly.
  void Start(Time now, SharingActions& actions);  // Restart with the shortest delay.
  // A new id and Hello, unless it waits for the window; nothing is under way any more.
  void Restart(Time now, SharingActions& actions);
  void Complete(SharingActions& actions);
  void EndLimitedOrder(SharingActions& actions);
  void End(SharingActions& actions);  // Without having completed.
  void Fill(Time now, SharingActions& actions);
  void AskForMissing(SharingActions& actions);
  void SendReady(Time now, SharingActions& actions);
  std::size_t BatchBytesMax() const;
  bool MayLeave(const CodedRecords& batch) const;
  void SetPace(Time now);
  // That of the options where the destination reads it.
  proto::Codec CodecNow() const;
  // As many of the records as fit into one message, or the first piece of one that does not; learns the ratio.
  CodedRecords Code(const proto::MissingReply& reply);
  CodedRecords NextPiece();
  // Fills in all of the message but codec, coded bytes and what is dropped.
  void Address(CodedRecords& batch, std::uint64_t remaining) const;
  // What the destination has or will have once everything under way arrives.
  HaveSet ExpectedHave() const;
  void Acknowledge(std::uint32_t batch_number);
  void GiveUpBatchesBefore(std::uint32_t batch_number);
  // The destination lacks what this batch leans on.
  void OnRunBroken(std::uint32_t batch_number);
  void GiveUp(std::map<std::uint32_t, CodedRecords>::iterator batch);
  void AskAnew();
  void ForgetUnderWay();
  void TellStorage(const std::vector<RecordKey>& handed_over, bool is_closed, SharingActions& actions) const;
  void SetDeadline(Time now);

  Options options_;
  proto::SharingKind kind_;
  AgentId destination_;

  Phase phase_ = Phase::kClosed;
  Window window_ = Window::kOpen;
  bool is_waiting_ = false;  // For the window to open; nothing is sent.
  bool is_unasked_ = false;  // As of BringUnasked.
  std::map<AgentId, KnownOrder> orders_;
  bool is_for_states_ = false;  // Since the last Hello, only states are sent.
  proto::RecordFilter filter_;
  std::uint64_t session_id_;
  std::uint64_t request_id_;
  bool is_asking_ = false;
  bool is_exhausted_ = false;  // Storage said that nothing more is missing.
  bool is_end_told_ = false;   // A batch with remaining 0 is under way or acknowledged since.
  bool has_restarted_at_once_ = false;
  std::optional<std::uint64_t> bytes_left_;  // Of a limited order.
  double own_rate_ = 0;
  double granted_rate_ = 0;
  Pacer pacer_;
  std::optional<Time> paced_until_;  // What is ready waits for the rate.
  std::set<DataType> other_schema_types_;
  bool is_refused_ = false;         // By the destination, which could not store; and it took no record since.
  std::set<AgentId> asked_;         // Of whose streams have_ speaks; empty: of all.
  std::set<DataType> asked_types_;  // Whatever the origin.
  HaveSet have_;                    // Of the destination, as it said.
  // What acknowledged batches carried and the destination did not take; not sent again before a restart.
  HaveSet refused_;
  std::optional<CodedRecords> ready_;
  // One record on its way in pieces, those behind what is ready.
  struct Large {
    RecordKey key;
    std::uint64_t remaining = 0;  // Behind it.
    PieceCutter cutter;
    std::uint32_t run = 0;  // As of CodedBatch.
    bool leans_on_others = false;
  };
  std::optional<Large> large_;
  PartOfWhole part_;                                 // That the destination has, as it said.
  std::map<std::uint32_t, CodedRecords> under_way_;  // By batch number; without their messages.
  std::size_t unacked_bytes_ = 0;
  std::size_t credit_bytes_ = 0;
  std::uint32_t next_batch_number_ = 1;
  std::uint64_t missing_count_ = 0;                // Behind what is ready and under way.
  std::vector<proto::TypeBacklog> missing_types_;  // The same by data type.
  bool is_codec_read_ = false;                     // By the destination, that of the options.
  SharingEncoder encoder_;
  bool is_each_by_itself_ = false;  // Batches of maps: the destination keeps no run of this session's, or lost one.
  double coded_ratio_ = 0.5;        // Coded bytes per content byte, smoothed.
  proto::Codec codec_sent_ = proto::CODEC_UNSPECIFIED;
  Duration backoff_{};
  Time deadline_{};
  Time last_progress_{};
  bool is_remaining_known_ = false;
  // Since the destination answered the last Hello.
  Time answered_{};
  double session_acknowledged_records_ = 0;
  double session_acknowledged_bytes_ = 0;

  double sent_records_ = 0;
  double acknowledged_records_ = 0;
  double coded_bytes_ = 0;
  double completed_sessions_ = 0;
  double closed_sessions_ = 0;
  double limited_sessions_ = 0;
  double resends_ = 0;
  double refused_haves_ = 0;
  std::string last_error_;
};

}  // namespace moondb
