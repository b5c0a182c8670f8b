// The coded form of a batch of records on the wire: in the compact form (coding/batch_codec.h), or a serialised
// RecordBatch, as one zstd frame where that is smaller.
//
// A batch is coded as a whole, since zstd makes single small rows larger, and by itself, so that it can be decoded
// whatever became of those before. Every form carries a checksum and states what it decodes to, so that a decoder knows
// its limits before it allocates and notices damage. zstd's bytes differ between its versions; only decoding is the
// contract.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "actors/sharing/coding/batch_codec.h"
#include "model/error.h"
#include "proto/sharing.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::size_t kDecodedBytesMax = 32 * 1024 * 1024;  // Twice the largest record.
inline constexpr std::size_t kCodedBytesMax = kDecodedBytesMax;
inline constexpr std::uint32_t kBatchRecordsMax = 4096;

struct CodedBatch {
  proto::Codec codec = proto::CODEC_PLAIN;
  std::string bytes;
  int record_count = 0;
};

// All of it, as a zstd frame or plain.
CodedBatch EncodeBatch(const proto::RecordBatch& batch);

// Codes one session's batches, and learns from each how many records fit into the next. Not thread-safe.
class SharingEncoder {
 public:
  // As many of the first records as fit into `bytes_max`, at least one, whatever its size: in `codec` (one of those
  // that DecodeBatch reads), or where that is smaller as a zstd frame or plain.
  CodedBatch Encode(proto::Codec codec, const proto::RecordBatch& batch, std::size_t bytes_max);

 private:
  BatchEncoder compact_{MapRunEncoder::Previous::kWhileItPays};
};

// kCorrupt for a codec that is unknown here, bytes that do not decode, a size beyond the limits above, more than one
// frame, or another number of records than `record_count`; kNotFound for compact bytes that cannot be decoded by
// themselves. The records themselves are StorageActor's to check. Safe from any thread.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count);

}  // namespace moondb
