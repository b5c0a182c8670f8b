// The wire format of a batch of records: the compact form (coding/batch_codec.h), or a serialised RecordBatch, which is
// compressed into one zstd frame if that is smaller.
//
// In the compact form, batches of maps form runs, in which each batch depends on the batches before it. All other
// batches can be decoded independently. The compact form and the zstd frame contain a checksum. A decoder checks the
// decoded size against its limit before it allocates memory. Different versions of zstd may write different bytes for
// the same batch.
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

// Bytes of the largest record, or of the largest page of records for a bundle (actors/storage/missing_records.h), plus
// overhead.
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

// The paper's format of a record: a SQL statement with the record's values. The functions convert a record to a
// statement, and back. They need SQLite, so they are implemented in actors/storage/paper_sql.h. If the functions are
// empty, CODEC_PAPER_SQL is neither written nor read.
struct PaperSql {
  std::function<std::optional<std::string>(const proto::StoredRecord&)> sql_of;
  std::function<Result<proto::StoredRecord>(std::string_view sql, const RecordKey& key)> record_of;
};

// Encodes the whole batch, as a zstd frame or uncompressed, whichever is smaller.
CodedBatch EncodeBatch(const proto::RecordBatch& batch);

// Encodes the batches to one destination. Keeps the current run of maps, which continues from batch to batch. Not
// thread-safe.
class SharingEncoder {
 public:
  // Requires: `first_run`, the number of the first run, differs from the run numbers of earlier processes.
  explicit SharingEncoder(PaperSql paper_sql = {}, std::uint32_t first_run = 1)
      : paper_sql_(std::move(paper_sql)), run_(std::max<std::uint32_t>(first_run, 1)) {}

  // Makes the next batch independent of earlier batches. Call this if the destination may lack an earlier batch of the
  // run.
  void BeginRun();
  // The number of the current run; never 0.
  std::uint32_t run() const { return run_; }

  // Encodes as many of the first records as fit into `bytes_max` bytes, but at least one, whatever its size. Uses
  // `codec`, with these exceptions.
  //   CODEC_COMPACT without maps: a zstd frame or the uncompressed form, if it is not larger than the compact form.
  //   CODEC_ZSTD: the uncompressed form, if it is not larger than the zstd frame.
  //   CODEC_PAPER_SQL: always one statement with the first record. If this record has no statement, a zstd frame or the
  //       uncompressed form with as many records as fit.
  // The encoding of the first batch of a run is deterministic; fragments rely on this (fragments.h).
  CodedBatch Encode(proto::Codec codec, const proto::RecordBatch& batch, std::size_t bytes_max);

 private:
  CodedBatch EncodeCompact(const proto::RecordBatch& batch, std::size_t bytes_max);

  PaperSql paper_sql_;
  std::uint32_t run_;
  BatchEncoder compact_{MapRunEncoder::Previous::kWhileItPays};
};

// Decodes a batch. `run` is the decoder of the batch's run; pass all batches of one run to the same decoder. Returns
// kCorrupt if the codec is unknown, the bytes do not decode, a size exceeds the limits above, there is more than one
// frame, or the number of records is not `record_count`. Returns kNotFound if the batch depends on batches that `run`
// has not decoded. Does not validate the records; StorageActor does.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count,
                                       BatchDecoder& run);

// Decodes a batch that does not depend on other batches. Thread-safe.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count);

// Decodes a SQL statement into a batch of one record. `record_id` is the record's key from Message.record_id. Returns
// kCorrupt if this agent does not read statements, or if the statement or the key is malformed.
Result<proto::RecordBatch> DecodePaperSql(const PaperSql& paper_sql, std::string_view sql, std::string_view record_id);

}  // namespace moondb
