// The coded form of a batch of records on the wire: in the compact form (coding/batch_codec.h), or a serialised
// RecordBatch, as one zstd frame where that is smaller.
//
// A batch is coded as a whole, since zstd makes single small rows larger. Batches of maps in the compact form make up
// runs, in which each leans on those before; all others can be decoded whatever became of those before. Every form
// carries a checksum and states what it decodes to, so that a decoder knows its limits before it allocates and notices
// damage. zstd's bytes differ between its versions; only decoding is the contract.
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

// Of the largest record, or page of a bundle (actors/storage/missing_records.h), and what their parts take beside it.
inline constexpr std::size_t kDecodedBytesMax = 18 * 1024 * 1024;
inline constexpr std::size_t kCodedBytesMax = kDecodedBytesMax;
inline constexpr std::uint32_t kBatchRecordsMax = 4096;

struct CodedBatch {
  proto::Codec codec = proto::CODEC_PLAIN;
  std::string bytes;
  int record_count = 0;
  std::uint32_t run = 0;         // Of maps, of which it is a part; 0: of none.
  bool leans_on_others = false;  // It cannot be decoded without the run's batches before.
};

// The paper's form: one record's populated statement, and back (actors/storage/paper_sql.h, which knows SQLite). Where
// it is empty, CODEC_PAPER_SQL is neither written nor read.
struct PaperSql {
  std::function<std::optional<std::string>(const proto::StoredRecord&)> sql_of;
  std::function<Result<proto::StoredRecord>(std::string_view sql, const RecordKey& key)> record_of;
};

// All of it, as a zstd frame or plain.
CodedBatch EncodeBatch(const proto::RecordBatch& batch);

// Codes the batches to one destination: learns from each how many records fit into the next, and keeps the run of maps
// that goes on from one to the other. Not thread-safe.
class SharingEncoder {
 public:
  // Numbers its runs from `first_run` on, which differs from those of an earlier process.
  explicit SharingEncoder(PaperSql paper_sql = {}, std::uint32_t first_run = 1)
      : paper_sql_(std::move(paper_sql)), run_(std::max<std::uint32_t>(first_run, 1)) {}

  // The next batch can be decoded without those before: one of them was not decoded, or may not have been.
  void BeginRun();
  // The present one; not 0.
  std::uint32_t run() const { return run_; }

  // As many of the first records as fit into `bytes_max`, at least one, whatever its size: in `codec`, or where that is
  // smaller (of CODEC_PAPER_SQL, where it is not possible) as a zstd frame or plain, but for maps in CODEC_COMPACT.
  // With CODEC_PAPER_SQL one record. The first of a run has the same bytes each time (pieces.h).
  CodedBatch Encode(proto::Codec codec, const proto::RecordBatch& batch, std::size_t bytes_max);

 private:
  CodedBatch EncodeCompact(const proto::RecordBatch& batch, std::size_t bytes_max);

  PaperSql paper_sql_;
  std::uint32_t run_;
  BatchEncoder compact_{MapRunEncoder::Previous::kWhileItPays};
};

// kCorrupt for a codec that is unknown here, bytes that do not decode, a size beyond the limits above, more than one
// frame, or another number of records than `record_count`; kNotFound for a batch that leans on others than `run` has
// decoded. The records themselves are StorageActor's to check.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count,
                                       BatchDecoder& run);

// By itself. Safe from any thread.
Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count);

// The one record that a statement makes; `record_id`: as it was announced. kCorrupt where there is no such form here.
Result<proto::RecordBatch> DecodePaperSql(const PaperSql& paper_sql, std::string_view sql, std::string_view record_id);

}  // namespace moondb
