// BatchMaker: makes the batches of one session out of the records that storage says are missing.
//
// One batch is ready at a time: as many of the records as fit into one message, or the next piece of one that does not
// (pieces.h). How many fit is learnt from the ratio of coded bytes to content. Batches are numbered from 1 as the
// session starts over. Each says how many records remain behind it; the last one says none, carries what is dropped and
// holds no record where none is missing.
//
// Batches of maps make up runs (codec.h), which go on from order to order. A new one begins where the destination may
// lack a batch of the present one: something was under way or ready when the session started over, one was lost, or the
// destination says so; and when the session is closed. Not thread-safe.
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
  // `first_run` differs from those of an earlier process.
  BatchMaker(AgentId destination, proto::Codec codec, const PaperSql& paper_sql, std::uint32_t first_run)
      : destination_(destination), codec_(codec), encoder_(paper_sql, first_run) {}

  // Nothing is ready any more. `is_any_in_flight`: the destination may lack what the session handed over.
  void StartOver(std::uint64_t session_id, bool is_any_in_flight);
  // The destination's answer to the session's Hello.
  void TakeAnswer(const proto::Have& answer);

  // Makes the next batch out of storage's answer, at most `bytes_max` coded bytes where it holds more than one record.
  // `is_part_of_order`: the order's end is not in sight, whatever the answer says. True where this was all.
  bool Make(const proto::MissingReply& reply, std::size_t bytes_max, bool is_part_of_order);
  // Makes a batch without records that is not the end, in place of what is ready or on its way in pieces.
  void MakeEmpty(std::size_t bytes_max);
  // Where one record is on its way in pieces: the next of at most `bytes_max` coded bytes is ready.
  void MakeNextFragment(std::size_t bytes_max);
  const std::optional<MadeBatch>& ready() const { return ready_; }
  // The one that is ready; numbered next_number().
  MadeBatch Take();
  std::uint32_t next_number() const { return next_number_; }

  // What is ready or on its way in pieces.
  HaveSet Contents() const;
  // Content bytes that should just fit into so many coded bytes.
  double ContentBytesFor(std::size_t coded_bytes) const;

  // More is missing than storage said: what is ready is not the end.
  void PutOffEnd();
  bool has_reported_end() const { return is_end_reported_; }  // Since then, or since the session started over.

  // The destination lacks a batch of this run: nothing more of it is sent.
  void DropRun(std::uint32_t run);
  // The next batch leans on none, and the memory of the run is given back.
  void EndRun() { encoder_.BeginRun(); }

  // Nobody asks any more for what is missing.
  void ForgetMissing();
  // Records that are missing or ready.
  std::uint64_t RemainingCount() const { return missing_count_ + (ready_ ? ready_->contents.keys.size() : 0); }
  void AddTo(proto::ShareSession& status) const;

 private:
  // One record on its way in pieces, those behind what is ready.
  struct Large {
    RecordKey key;
    std::uint64_t remaining = 0;  // Behind it.
    FragmentCutter cutter;
    std::uint32_t run = 0;         // As of CodedBatch.
    bool leans_on_others = false;  // As of CodedBatch.
  };

  void Code(const proto::MissingReply& reply, std::size_t bytes_max, bool is_part_of_order);
  void LearnRatio(std::size_t coded_bytes, std::size_t content_bytes);
  void MakeWhole(CodedBatch coded, const proto::MissingReply& reply, std::uint64_t remaining, std::size_t bytes_max);
  // Fills in all of the ready message but codec, coded bytes and what is dropped.
  void Address(std::uint64_t remaining);

  AgentId destination_;
  proto::Codec codec_;
  std::uint64_t session_id_ = 0;
  std::uint32_t next_number_ = 1;
  SharingEncoder encoder_;
  bool is_each_by_itself_ = false;  // Batches of maps: the destination keeps no run of this session's, or lost one.
  double coded_ratio_ = 0.5;        // Coded bytes per content byte, smoothed.
  std::optional<MadeBatch> ready_;
  std::optional<Large> large_;
  PartOfWhole part_;  // The part of a large record that the destination said it has.
  bool is_end_reported_ = false;
  std::uint64_t missing_count_ = 0;                // Behind what is ready and under way.
  std::vector<proto::TypeBacklog> missing_types_;  // The same by data type.
  bool is_missing_known_ = false;                  // Since the session started over.
};

}  // namespace moondb
