// Compares the records that two agents hold without reading the records. Compares fingerprints of ranges, and halves
// the ranges whose fingerprints differ.
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
  double record_count = 0;  // Records in the fingerprint. Fewer than requested if the agent no longer holds all.
  bool operator==(const Fingerprint&) const = default;
};

// Requests from one agent the fingerprint of the records of `stream` with the given seqs.
using AskFingerprint = std::function<Result<Fingerprint>(const StreamKey& stream, const IntervalSet& seqs)>;

// Returns the fingerprint of the records of `stream` with the given seqs. An answer may cover only some of the seqs;
// then sends further requests. Returns the errors of Client, and kCorrupt if the agent's answers make no progress.
Result<Fingerprint> FingerprintOf(Client& client, const StreamKey& stream, const IntervalSet& seqs);

// Compares the records in `held`, which two agents hold. Returns the keys of records whose contents differ: the
// smallest keys, at most `keys_max`. Sends each agent about 2 log2(n) requests per differing record.
Result<std::vector<RecordKey>> FindDiffering(const HaveSet& held, const AskFingerprint& first,
                                             const AskFingerprint& second, std::size_t keys_max);

}  // namespace moondb
