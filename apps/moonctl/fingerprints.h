// Comparing the records that two agents both hold without reading them: by fingerprints, and by halves where they
// differ.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "client/client.h"
#include "model/have_set.h"

namespace moondb {

struct Fingerprint {
  std::uint64_t hash = 0;   // XOR of the records' hashes: 0 for none.
  double record_count = 0;  // Fewer than asked for where some are gone.
  bool operator==(const Fingerprint&) const = default;
};

// Of some seqs of a stream, at one agent.
using AskFingerprint = std::function<Result<Fingerprint>(const StreamKey& stream, const IntervalSet& seqs)>;

// Asks until all seqs are in. The errors of Client; kCorrupt where the agent's answers do not get on.
Result<Fingerprint> FingerprintOf(Client& client, const StreamKey& stream, const IntervalSet& seqs);

// The smallest keys, at most `keys_max`, of the records whose contents differ. Asks each side about 2 log2(n) times for
// each of them.
Result<std::vector<RecordKey>> FindDiffering(const HaveSet& held, const AskFingerprint& first,
                                             const AskFingerprint& second, std::size_t keys_max);

}  // namespace moondb
