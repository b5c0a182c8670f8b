// BatchMaker: makes the batches of one session from the records that storage reports as missing at the destination.
//
// One batch is ready at a time. It holds as many records as fit into one message, or the next fragment of a larger
// record (fragments.h). Each batch contains the number of records that remain to be sent after it. In the last batch
// this number is 0. The last batch also carries the dropped intervals, and contains no records if none were missing.
// Batch numbers start at 1 again when the session starts over.
//
// Batches of maps form runs (codec.h), which continue from one order to the next. A new run begins if the destination
// may lack a batch of the current run, or after the session was closed. Not thread-safe.
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
  // `first_run` is the number of the first run of maps. Requires: `first_run` differs from the run numbers of earlier
  // processes, for example because it is random.
  BatchMaker(AgentId destination, proto::Codec codec, const PaperSql& paper_sql, std::uint32_t first_run)
      : destination_(destination), codec_(codec), encoder_(paper_sql, first_run) {}

  // Discards the ready batch and numbers batches from 1 again. `is_any_in_flight`: batches were in flight, so the
  // destination may lack some of them.
  void StartOver(std::uint64_t session_id, bool is_any_in_flight);
  // Accepts the destination's answer to the session's Hello.
  void TakeAnswer(const proto::Have& answer);

  // Makes the next batch from storage's answer, if there is anything to send. A batch of several records has at most
  // `bytes_max` coded bytes. `is_part_of_order`: the answer covers only a part of the order, so the batch does not end
  // the order. Returns false if storage must be asked for further missing records.
  bool Make(const proto::MissingReply& reply, std::size_t bytes_max, bool is_part_of_order);
  // Makes a batch without records that does not end the order. Discards the ready batch and the fragments not yet sent.
  void MakeEmpty(std::size_t bytes_max);
  // If a record is being sent in fragments, makes the next fragment the ready batch, with at most `bytes_max` coded
  // bytes.
  void MakeNextFragment(std::size_t bytes_max);
  const std::optional<MadeBatch>& ready() const { return ready_; }
  // Removes and returns the ready batch. Its number is the value of next_number() before the call. Requires: a batch is
  // ready.
  MadeBatch Take();
  std::uint32_t next_number() const { return next_number_; }

  // Returns the records and dropped intervals of the ready batch, and the record that is being sent in fragments.
  HaveSet Contents() const;
  // Estimates how many content bytes fit into `coded_bytes` coded bytes.
  double ContentBytesFor(std::size_t coded_bytes) const;

  // Call if the destination may lack records that storage's last answer did not include. The ready batch then no longer
  // reports the end of the order.
  void PutOffEnd();
  // True if a batch with 0 remaining records was made since the last StartOver and the last PutOffEnd.
  bool has_reported_end() const { return is_end_reported_; }

  // Call if the destination lacks a batch of the run. Discards the ready batch and fragments if they belong to the run,
  // and makes no further batch of the run.
  void DropRun(std::uint32_t run);
  // Ends the current run and frees its memory. The next batch then depends on no earlier batch.
  void EndRun() { encoder_.BeginRun(); }

  // Call when no order is open any more. Clears the counts of missing records.
  void ForgetMissing();
  // Number of records that are missing at the destination and not sent yet, including the records of the ready batch.
  std::uint64_t RemainingCount() const { return missing_count_ + (ready_ ? ready_->contents.keys.size() : 0); }
  void AddTo(proto::ShareSession& status) const;

 private:
  // The record that is being sent in fragments.
  struct Large {
    RecordKey key;
    std::uint64_t remaining = 0;  // Number of records that remain to be sent after this record.
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
  // True if each batch of maps must begin a new run, because the destination keeps no decoder for this session's runs,
  // or lacks a batch of a run.
  bool is_each_by_itself_ = false;
  double coded_ratio_ = 0.5;  // Coded bytes per content byte, smoothed.
  std::optional<MadeBatch> ready_;
  std::optional<Large> large_;
  PartOfWhole part_;  // The part of a large record that the destination already holds.
  bool is_end_reported_ = false;
  std::uint64_t missing_count_ = 0;                // Missing records, except those in the ready batch and in flight.
  std::vector<proto::TypeBacklog> missing_types_;  // `missing_count_` by data type.
  bool is_missing_known_ = false;                  // Storage has answered since the session started over.
};

}  // namespace moondb
