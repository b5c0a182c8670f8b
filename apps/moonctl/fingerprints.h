// Finds the records whose contents differ between two agents without reading the records. Compares fingerprints of
// ranges of sequence numbers, and halves each range whose fingerprints differ.
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
  double record_count = 0;  // Number of hashed records. Less than requested if the agent no longer holds all.
  bool operator==(const Fingerprint&) const = default;
};

// Requests from an agent the fingerprint of the records of `stream` whose sequence numbers are in `seqs`.
using RequestFingerprint = std::function<Result<Fingerprint>(const StreamKey& stream, const IntervalSet& seqs)>;

// Requests from the agent the fingerprint of the records of `stream` whose sequence numbers are in `seqs`. If an answer
// covers only some of these records, sends further requests. Returns the errors of Client, and kCorrupt if the agent's
// answers make no progress.
Result<Fingerprint> FingerprintOf(Client& client, const StreamKey& stream, const IntervalSet& seqs);

// Compares the records in `held`, which both agents hold. Returns the keys of the records whose contents differ: the
// smallest keys, at most `keys_max`. Sends each agent about 2 log2(n) requests per differing record if `held` has n
// records.
Result<std::vector<RecordKey>> FindDiffering(const HaveSet& held, const RequestFingerprint& first,
                                             const RequestFingerprint& second, std::size_t keys_max);

}  // namespace moondb
