// InFlightBatches keeps the batches that are in flight to a destination (sent, but not acknowledged), and the have-set
// that the destination reported.
//
// Records in flight count as held by the destination only for the choice of the next batch. If a batch is given up, its
// records count as missing again. A record that the destination refused, although it acknowledged the batch, is not
// sent again before the session starts over. Plain value.
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

// The records and dropped intervals that one batch carries.
struct BatchContents {
  std::vector<RecordKey> keys;
  std::vector<proto::StreamHave> dropped;
  std::size_t bytes = 0;         // Coded bytes.
  std::uint32_t run = 0;         // The run of maps to which the batch belongs; 0: none.
  bool leans_on_others = false;  // The batch can be decoded only after the earlier batches of its run.
};

// Adds the contents of a batch to `have`. A record that is held in `have` and dropped in the batch, or the reverse, is
// then in both interval sets of `have`.
void AddContents(const BatchContents& batch, HaveSet& have);

class InFlightBatches {
 public:
  // Called when the session starts over. Forgets the batches in flight, and allows refused records to be sent again.
  void Clear();

  // Sets the have-set that the destination reported in its answer to a Hello.
  void SetHave(HaveSet have) { have_ = std::move(have); }
  // Adds a later report of the destination to its have-set.
  void Join(const HaveSet& heard) { have_.Merge(heard); }
  const HaveSet& have() const { return have_; }
  // Returns the destination's have-set plus the contents of all batches in flight, `more`, and the records that the
  // destination refused.
  HaveSet ExpectedHave(const HaveSet& more) const;

  void SetCredit(std::size_t bytes) { credit_bytes_ = bytes; }
  std::size_t credit_bytes() const { return credit_bytes_; }
  std::size_t unacked_bytes() const { return unacked_bytes_; }
  bool HasRoomFor(std::size_t bytes) const { return unacked_bytes_ + bytes <= credit_bytes_; }

  void Add(std::uint32_t number, BatchContents batch);
  bool is_empty() const { return batches_.empty(); }
  std::size_t RecordCount() const;
  std::vector<RecordKey> Keys() const;
  // Returns the number of records that the destination refused to store since the session started over.
  std::uint64_t RefusedCount() const;

  struct Acknowledged {
    std::size_t batches = 0;
    std::size_t records = 0;  // Number of records that the destination now holds or has dropped.
    std::size_t bytes = 0;    // Coded bytes.
  };
  // Removes the batch `number`. Also removes each other batch with records if the destination now holds or has dropped
  // all records of that batch. Returns the totals of the removed batches.
  Acknowledged Acknowledge(std::uint32_t number);
  // Gives up each batch whose number is at least 2 below the acknowledged `number`. Batches arrive nearly in order, so
  // such a batch was lost. Returns how many batches were given up.
  std::size_t GiveUpBefore(std::uint32_t number);
  // Call if the destination reports that it cannot decode the batch `number` without earlier batches. Gives the batch
  // up and returns its run. Returns nullopt and changes nothing if the batch is not in flight or depends on no other
  // batch. False reports thus cannot stall the session.
  std::optional<std::uint32_t> GiveUpBroken(std::uint32_t number);

 private:
  using Batches = std::map<std::uint32_t, BatchContents>;

  Batches::iterator Remove(Batches::iterator batch);
  void ObserveRefused(const BatchContents& batch);

  Batches batches_;                // The batches in flight, by number.
  HaveSet have_;                   // Reported by the destination.
  HaveSet refused_;                // Records that the destination refused since the session started over.
  std::size_t unacked_bytes_ = 0;  // The sum of the coded bytes in batches_.
  std::size_t credit_bytes_ = 0;
};

}  // namespace moondb
