// InFlightBatches: what was handed over to a destination and is not acknowledged, and what the destination has.
//
// What is under way counts as had while the next batch is chosen, and only there: a batch that is given up is missing
// again. What an acknowledged batch carried and the destination did not take is not sent again before the session
// starts over. Un-acknowledged bytes stay within the credit, but for one batch that travels alone. Plain value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "model/error.h"
#include "model/have_set.h"
#include "proto/have.pb.h"

namespace moondb {

// What one batch carries.
struct BatchContents {
  std::vector<RecordKey> keys;
  std::vector<proto::StreamHave> dropped;
  std::size_t bytes = 0;         // Coded.
  std::uint32_t run = 0;         // As of CodedBatch.
  bool leans_on_others = false;  // As of CodedBatch.
};

// Adds what a batch carries. What is held here and dropped there stays both.
void AddContents(const BatchContents& batch, HaveSet& have);

class InFlightBatches {
 public:
  // The session starts over: nothing is under way, and what the destination did not take may be sent again.
  void Clear();

  // The destination said that it has this.
  void SetHave(HaveSet have) { have_ = std::move(have); }
  // What the destination says later joins what it said before.
  void Join(const HaveSet& heard) { have_.Merge(heard); }
  const HaveSet& have() const { return have_; }
  // Had once everything under way and `more` arrives.
  HaveSet ExpectedHave(const HaveSet& more) const;

  void SetCredit(std::size_t bytes) { credit_bytes_ = bytes; }
  std::size_t credit_bytes() const { return credit_bytes_; }
  std::size_t unacked_bytes() const { return unacked_bytes_; }
  bool HasRoomFor(std::size_t bytes) const { return unacked_bytes_ + bytes <= credit_bytes_; }

  void Add(std::uint32_t number, BatchContents batch);
  bool is_empty() const { return batches_.empty(); }
  std::size_t RecordCount() const;
  std::vector<RecordKey> Keys() const;
  std::uint64_t RefusedCount() const;  // Records that acknowledged batches carried and the destination did not take.

  struct Acknowledged {
    std::size_t batches = 0;
    std::size_t records = 0;  // Records that the destination took.
    std::size_t bytes = 0;    // Coded.
  };
  // The batch of that number is acknowledged, and so is each other batch whose records the destination has by now.
  Acknowledged Acknowledge(std::uint32_t number);
  // Batches travel nearly in order: one that is still open when the second after it is acknowledged was lost. How many
  // were given up.
  std::size_t GiveUpBefore(std::uint32_t number);
  // The destination lacks what this batch leans on: gives it up, and says which run it is of. None where it leans on
  // nothing: so a destination that always says so is not listened to for ever.
  std::optional<std::uint32_t> GiveUpBroken(std::uint32_t number);

 private:
  using Batches = std::map<std::uint32_t, BatchContents>;

  Batches::iterator Remove(Batches::iterator batch);
  void NoteRefused(const BatchContents& batch);

  Batches batches_;  // By number.
  HaveSet have_;
  HaveSet refused_;  // By the destination.
  std::size_t unacked_bytes_ = 0;
  std::size_t credit_bytes_ = 0;
};

}  // namespace moondb
