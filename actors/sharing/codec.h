// The wire format of a batch of records: the compact form (coding/batch_codec.h), or a serialised RecordBatch, which is
// compressed into one zstd frame if that is smaller.
//
// A batch is coded as a whole, since zstd makes single small rows larger. Batches of maps in the compact form form
// runs, in which each batch depends on those before it. All other batches can be decoded independently. Every form
// contains a checksum and its decoded size, so a decoder detects damage, and can check its limits before it allocates
// memory. The compressed bytes may differ between versions of zstd; the contract covers only the decoded result.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "actors/sharing/coding/batch_codec.h"
#include "model/error.h"
#include "model/record_key.h"
#include "proto/sharing.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

// Bytes of the largest record, or of the largest page of a bundle (actors/storage/missing_records.h), plus overhead.
inline constexpr std::size_t kDecodedBytesMax = 18 * 1024 * 1024;
inline constexpr std::size_t kCodedBytesMax = kDecodedBytesMax;
inline constexpr std::uint32_t kBatchRecordsMax = 4096;

struct CodedBatch {
  proto::Codec codec = proto::CODEC_PLAIN;
  std::string bytes;
  int record_count = 0;
  std::uint32_t run = 0;         // The run of maps to which the batch belongs; 0: none.
  bool leans_on_others = false;  // The batch can be decoded only after the earlier batches of its run.
};

// The paper's format: converts one record to a populated SQL statement, and back. The implementation needs SQLite and
// is in actors/storage/paper_sql.h. If the functions are empty, CODEC_PAPER_SQL is neither written nor read.
struct PaperSql {
  std::function<std::optional<std::string>(const proto::StoredRecord&)> sql_of;
  std::function<Result<proto::StoredRecord>(std::string_view sql, const RecordKey& key)> record_of;
};

// Encodes the whole batch, as a zstd frame or uncompressed, whichever is smaller.
CodedBatch EncodeBatch(const proto::RecordBatch& batch);

// Encodes the batches to one destination. Keeps the current run of maps, which continues from batch to batch, and
// estimates from each batch how many records fit into the next. Not thread-safe.
class SharingEncoder {
 public:
  // Runs are numbered from `first_run`. Requires: `first_run` differs from the run numbers of earlier processes.
  explicit SharingEncoder(PaperSql paper_sql = {}, std::uint32_t first_run = 1)
      : paper_sql_(std::move(paper_sql)), run_(std::max<std::uint32_t>(first_run, 1)) {}

  // Makes the next batch independent of those before it. Call this if the destination may not have decoded one of them.
  void BeginRun();
  // The number of the current run; never 0.
  std::uint32_t run() const { return run_; }

  // Encodes as many of the first records as fit into `bytes_max`, but at least one, whatever its size. Uses `codec`,
  // with these exceptions. CODEC_COMPACT without maps falls back to a zstd frame or the uncompressed form if that is
  // smaller; CODEC_ZSTD falls back to the uncompressed form. CODEC_PAPER_SQL encodes the first record as a statement,
  // or the batch as a zstd frame or uncompressed if that record has no statement. The encoding of the first batch of a
  // run is deterministic; fragments rely on this (fragments.h).
  CodedBatch Encode(proto::Codec codec, const proto::RecordBatch& batch, std::size_t bytes_max);

 private:
  CodedBatch EncodeCompact(const proto::RecordBatch& batch, std::size_t bytes_max);

  PaperSql paper_sql_;
  std::uint32_t run_;
  BatchEncoder compact_{MapRunEncoder::Previous::kWhileItPays};
};

// Decodes a batch, which may depend on batches that the decoder `run` has decoded before. Returns kCorrupt if the codec
// is unknown, the bytes do not decode, a size exceeds the limits above, there is more than one frame, or the number of
// records is not `record_count`. Returns kNotFound if the batch depends on batches that `run` has not decoded. Does not
// check the records themselves; StorageActor does.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count,
                                       BatchDecoder& run);

// Decodes a batch that does not depend on other batches. Thread-safe.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count);

// Decodes a SQL statement into a batch of one record. `record_id` is the key that the message announced. kCorrupt if
// this agent does not read statements, or if the statement or the key is malformed.
Result<proto::RecordBatch> DecodePaperSql(const PaperSql& paper_sql, std::string_view sql, std::string_view record_id);

}  // namespace moondb
