// The coded form of a batch of records on the wire: a serialised RecordBatch, as one zstd frame where that is smaller.
//
// A batch is coded as a whole, since zstd makes single small rows larger. The frame states its decoded size and
// carries a checksum, so that a decoder knows its limits before it allocates and notices damage. zstd's bytes differ
// between its versions; only decoding is the contract. Pure functions, safe from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

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
};

CodedBatch EncodeBatch(const proto::RecordBatch& batch);

// kCorrupt for a codec that is unknown here, bytes that do not decode, a size beyond the limits above, more than one
// frame, or another number of records than `record_count`. The records themselves are StorageActor's to check.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count);

}  // namespace moondb
