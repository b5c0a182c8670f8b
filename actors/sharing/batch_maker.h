// BatchMaker: makes the batches of one session from the records that storage reports as missing at the destination.
//
// One batch is ready at a time. It holds as many records as fit into one message, or the next fragment of a record that
// does not fit (fragments.h). BatchMaker estimates how many records fit from the ratio of coded bytes to content bytes.
// Batch numbers count from 1 and restart with the session. Each batch says how many records remain after it. The last
// batch says 0, carries the dropped intervals, and holds no record if none was missing.
//
// Batches of maps form runs (codec.h), which continue from one order to the next. A new run begins if the destination
// may lack a batch of the current run. That is the case if a batch was in flight or ready when the session started
// over, if a batch was lost, or if the destination reports a gap. Closing the session also ends the run. Not
// thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "actors/sharing/codec.h"
#include "actors/sharing/fragments.h"
#include "actors/sharing/in_flight_batches.h"
#include "model/have_set.h"
#include "proto/message.pb.h"

namespace moondb::proto {
class ShareSession;
}  // namespace moondb::proto

namespace moondb {

struct MadeBatch {
  proto::Message message;
  BatchContents contents;
};

class BatchMaker {
 public:
  // Requires: `first_run` differs from the run numbers of earlier processes, for example because it is random.
  BatchMaker(AgentId destination, proto::Codec codec, const PaperSql& paper_sql, std::uint32_t first_run)
      : destination_(destination), codec_(codec), encoder_(paper_sql, first_run) {}

  // Discards the ready batch and numbers batches from 1 again. `is_any_in_flight`: batches were in flight, so the
  // destination may lack some of them.
  void StartOver(std::uint64_t session_id, bool is_any_in_flight);
  // Accepts the destination's answer to the session's Hello.
  void TakeAnswer(const proto::Have& answer);

  // Makes the next batch from storage's answer. A batch of several records has at most `bytes_max` coded bytes.
  // `is_part_of_order`: the answer covers only a part of the order, so this batch is not marked as the last one.
  // Returns true if nothing remains to be sent after this batch.
  bool Make(const proto::MissingReply& reply, std::size_t bytes_max, bool is_part_of_order);
  // Makes a batch without records that does not end the order. It replaces the ready batch and the record that is being
  // sent in fragments.
  void MakeEmpty(std::size_t bytes_max);
  // If a record is being sent in fragments, makes the next fragment the ready batch, with at most `bytes_max` coded
  // bytes.
  void MakeNextFragment(std::size_t bytes_max);
  const std::optional<MadeBatch>& ready() const { return ready_; }
  // Removes the ready batch and returns it. Its number is next_number() as of before the call. Requires: ready().
  MadeBatch Take();
  std::uint32_t next_number() const { return next_number_; }

  // The records and dropped intervals of the ready batch, and the record that is being sent in fragments.
  HaveSet Contents() const;
  // Estimates how many content bytes fit into `coded_bytes` coded bytes.
  double ContentBytesFor(std::size_t coded_bytes) const;

  // Records became missing after storage's answer, so the ready batch no longer ends the order.
  void PutOffEnd();
  // True if a batch with 0 remaining records was made since the session started over or PutOffEnd was called.
  bool has_reported_end() const { return is_end_reported_; }

  // The destination lacks a batch of this run. Sends no further batch of the run.
  void DropRun(std::uint32_t run);
  // Ends the current run and frees its memory. The next batch then depends on no earlier one.
  void EndRun() { encoder_.BeginRun(); }

  // Clears the counts of missing records, since no order is open any more.
  void ForgetMissing();
  // Number of records that are missing at the destination and not sent yet, including the ready batch.
  std::uint64_t RemainingCount() const { return missing_count_ + (ready_ ? ready_->contents.keys.size() : 0); }
  void AddTo(proto::ShareSession& status) const;

 private:
  // One record that is being sent in fragments: the fragments after the ready one.
  struct Large {
    RecordKey key;
    std::uint64_t remaining = 0;  // Number of records that remain after this one.
    FragmentCutter cutter;
    std::uint32_t run = 0;         // The run of maps to which the record's batch belongs; 0: none.
    bool leans_on_others = false;  // The batch can be decoded only after the earlier batches of its run.
  };

  void Code(const proto::MissingReply& reply, std::size_t bytes_max, bool is_part_of_order);
  void LearnRatio(std::size_t coded_bytes, std::size_t content_bytes);
  void MakeWhole(CodedBatch coded, const proto::MissingReply& reply, std::uint64_t remaining, std::size_t bytes_max);
  // Fills in all fields of the ready message except the codec, the coded bytes and the dropped intervals.
  void Address(std::uint64_t remaining);

  AgentId destination_;
  proto::Codec codec_;
  std::uint64_t session_id_ = 0;
  std::uint32_t next_number_ = 1;
  SharingEncoder encoder_;
  // Batches of maps are coded independently of each other: the destination keeps no run of this session, or lost one.
  bool is_each_by_itself_ = false;
  double coded_ratio_ = 0.5;  // Coded bytes per content byte, smoothed.
  std::optional<MadeBatch> ready_;
  std::optional<Large> large_;
  PartOfWhole part_;  // The part of a large record that the destination already holds.
  bool is_end_reported_ = false;
  std::uint64_t missing_count_ = 0;                // Missing records beyond the ready batch and those in flight.
  std::vector<proto::TypeBacklog> missing_types_;  // The missing records by data type.
  bool is_missing_known_ = false;                  // Storage has answered since the session started over.
};

}  // namespace moondb
