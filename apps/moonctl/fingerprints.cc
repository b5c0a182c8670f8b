#include "apps/moonctl/fingerprints.h"

#include <algorithm>
#include <utility>

namespace moondb {
namespace {

IntervalSet Behind(const IntervalSet& seqs, std::uint64_t seq) {
  IntervalSet before;
  before.Add({1, seq});
  return seqs.Minus(before);
}

// Splits `seqs` into a half with the smaller and a half with the larger sequence numbers. Requires: at least two
// numbers.
std::pair<IntervalSet, IntervalSet> Halves(const IntervalSet& seqs) {
  std::pair<IntervalSet, IntervalSet> halves;
  std::uint64_t left = seqs.Count() / 2;  // Number of seqs still to be added to the first half.
  for (const IntervalSet::Interval& interval : seqs.intervals()) {
    const std::uint64_t taken = std::min(left, interval.last - interval.first + 1);
    if (taken > 0) halves.first.Add({interval.first, interval.first + taken - 1});
    if (interval.first + taken <= interval.last) halves.second.Add({interval.first + taken, interval.last});
    left -= taken;
  }
  return halves;
}

class Comparison {
 public:
  Comparison(const RequestFingerprint& first, const RequestFingerprint& second, std::size_t keys_max)
      : first_(first), second_(second), keys_max_(keys_max) {}

  Result<void> Compare(const StreamKey& stream, const IntervalSet& seqs) {
    if (differing_.size() >= keys_max_) return {};
    const Result<Fingerprint> first = first_(stream, seqs);
    if (!first) return tl::unexpected(first.error());
    const Result<Fingerprint> second = second_(stream, seqs);
    if (!second) return tl::unexpected(second.error());
    if (*first == *second) return {};
    if (seqs.Count() == 1) {
      differing_.push_back({stream, seqs.Max()});
      return {};
    }
    const auto [smaller, larger] = Halves(seqs);
    if (Result<void> looked = Compare(stream, smaller); !looked) return looked;
    return Compare(stream, larger);
  }

  std::vector<RecordKey> TakeDiffering() { return std::move(differing_); }

 private:
  const RequestFingerprint& first_;
  const RequestFingerprint& second_;
  const std::size_t keys_max_;
  std::vector<RecordKey> differing_;
};

}  // namespace

Result<Fingerprint> FingerprintOf(Client& client, const StreamKey& stream, const IntervalSet& seqs) {
  Fingerprint whole;
  IntervalSet left = seqs;
  while (!left.is_empty()) {
    HaveSet asked;
    asked[stream].held = left;
    proto::FingerprintRequest request;
    *request.mutable_stream() = ToProto(asked).streams(0);
    const Result<proto::FingerprintReply> part = client.Fingerprint(request);
    if (!part) return tl::unexpected(part.error());
    whole.hash ^= part->fingerprint();
    whole.record_count += part->record_count();
    if (part->is_complete()) break;
    IntervalSet behind = Behind(left, std::max<std::uint64_t>(part->last_seq(), 1));
    if (behind == left)
      return Fail(ErrorCode::kCorrupt, "the agent's fingerprint reply covers no further record; retry");
    left = std::move(behind);
  }
  return whole;
}

Result<std::vector<RecordKey>> FindDiffering(const HaveSet& held, const RequestFingerprint& first,
                                             const RequestFingerprint& second, std::size_t keys_max) {
  Comparison comparison(first, second, keys_max);
  for (const auto& [stream, have] : held.streams()) {
    if (have.held.is_empty()) continue;
    if (const Result<void> looked = comparison.Compare(stream, have.held); !looked)
      return tl::unexpected(looked.error());
  }
  return comparison.TakeDiffering();
}

}  // namespace moondb
