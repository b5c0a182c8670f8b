// Compares the records that two agents both hold without reading them. Compares fingerprints, and halves the ranges
// whose fingerprints differ.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "client/client.h"
#include "model/have_set.h"

namespace moondb {

struct Fingerprint {
  std::uint64_t hash = 0;   // XOR of the hashes of the records. 0: no records.
  double record_count = 0;  // Less than the number requested if some records are gone.
  bool operator==(const Fingerprint&) const = default;
};

// Requests the fingerprint of the records `seqs` of a stream from one agent.
using AskFingerprint = std::function<Result<Fingerprint>(const StreamKey& stream, const IntervalSet& seqs)>;

// Sends requests until all of `seqs` are covered. Returns the errors of Client, and kCorrupt if the agent's answers
// make no progress.
Result<Fingerprint> FingerprintOf(Client& client, const StreamKey& stream, const IntervalSet& seqs);

// Returns the smallest keys, at most `keys_max`, of records whose contents differ. Sends each side about 2 log2(n)
// requests per differing record.
Result<std::vector<RecordKey>> FindDiffering(const HaveSet& held, const AskFingerprint& first,
                                             const AskFingerprint& second, std::size_t keys_max);

}  // namespace moondb
