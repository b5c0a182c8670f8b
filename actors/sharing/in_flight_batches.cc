#include "actors/sharing/in_flight_batches.h"

#include <algorithm>
#include <utility>

#include "proto/have.pb.h"

namespace moondb {
namespace {

void AddDropped(const std::vector<proto::StreamHave>& streams, HaveSet& have) {
  for (const proto::StreamHave& stream : streams) {
    IntervalSet& dropped = have[{stream.origin_agent(), stream.epoch(), stream.data_type()}].dropped;
    for (const proto::Interval& interval : stream.dropped()) dropped.Add({interval.first(), interval.last()});
  }
}

bool Has(const HaveSet& have, const RecordKey& key) {
  const StreamHave& stream = have.Get(key.stream);
  return stream.held.Contains(key.seq) || stream.dropped.Contains(key.seq);
}

}  // namespace

void AddContents(const BatchContents& batch, HaveSet& have) {
  for (const RecordKey& key : batch.keys) have[key.stream].held.Add(key.seq);
  AddDropped(batch.dropped, have);
}

void InFlightBatches::Clear() {
  batches_.clear();
  refused_ = HaveSet();
  unacked_bytes_ = 0;
}

HaveSet InFlightBatches::ExpectedHave(const HaveSet& more) const {
  HaveSet coming = more;
  for (const auto& [number, batch] : batches_) AddContents(batch, coming);
  HaveSet expected = have_;
  expected.Merge(refused_);
  expected.Merge(coming);  // Merge keeps held and dropped intervals disjoint, even if they overlap in `coming`.
  return expected;
}

void InFlightBatches::Add(std::uint32_t number, BatchContents batch) {
  unacked_bytes_ += batch.bytes;
  batches_.emplace(number, std::move(batch));
}

std::size_t InFlightBatches::RecordCount() const {
  std::size_t count = 0;
  for (const auto& [number, batch] : batches_) count += batch.keys.size();
  return count;
}

std::vector<RecordKey> InFlightBatches::Keys() const {
  std::vector<RecordKey> keys;
  for (const auto& [number, batch] : batches_) keys.insert(keys.end(), batch.keys.begin(), batch.keys.end());
  return keys;
}

std::uint64_t InFlightBatches::RefusedCount() const {
  std::uint64_t count = 0;
  for (const auto& [key, stream] : refused_.streams()) count += stream.held.Minus(have_.Get(key).Covered()).Count();
  return count;
}

InFlightBatches::Acknowledged InFlightBatches::Acknowledge(std::uint32_t number) {
  Acknowledged acknowledged;
  for (auto it = batches_.begin(); it != batches_.end();) {
    const BatchContents& batch = it->second;
    const auto is_covered = [this](const RecordKey& key) { return Has(have_, key); };
    const auto covered = static_cast<std::size_t>(std::count_if(batch.keys.begin(), batch.keys.end(), is_covered));
    const bool are_all_covered = !batch.keys.empty() && covered == batch.keys.size();
    if (it->first != number && !are_all_covered) {
      ++it;
      continue;
    }
    ObserveRefused(batch);
    ++acknowledged.batches;
    acknowledged.records += covered;
    acknowledged.bytes += batch.bytes;
    it = Remove(it);
  }
  return acknowledged;
}

void InFlightBatches::ObserveRefused(const BatchContents& batch) {
  for (const RecordKey& key : batch.keys) {
    if (!Has(have_, key)) refused_[key.stream].held.Add(key.seq);
  }
  // Count the dropped intervals as refused, so they are not sent again. The destination may have a reason to keep a
  // record.
  AddDropped(batch.dropped, refused_);
}

std::size_t InFlightBatches::GiveUpBefore(std::uint32_t number) {
  std::size_t count = 0;
  for (; !batches_.empty() && batches_.begin()->first + 2 <= number; ++count) Remove(batches_.begin());
  return count;
}

std::optional<std::uint32_t> InFlightBatches::GiveUpBroken(std::uint32_t number) {
  const auto broken = batches_.find(number);
  if (broken == batches_.end() || !broken->second.leans_on_others) return std::nullopt;
  const std::uint32_t run = broken->second.run;
  Remove(broken);
  return run;
}

InFlightBatches::Batches::iterator InFlightBatches::Remove(Batches::iterator batch) {
  unacked_bytes_ -= batch->second.bytes;
  return batches_.erase(batch);
}

}  // namespace moondb
