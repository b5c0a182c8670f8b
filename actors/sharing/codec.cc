#include "actors/sharing/codec.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "actors/sharing/coding/zstd_frame.h"
#include "model/bounded_parse.h"

namespace moondb {
namespace {

Result<proto::RecordBatch> Parse(std::string_view plain, std::uint32_t record_count) {
  proto::RecordBatch batch;
  if (!ParseBounded(plain, &batch)) {
    return Fail(ErrorCode::kCorrupt, "does not parse as a batch of records", "coded");
  }
  if (static_cast<std::uint32_t>(batch.records_size()) != record_count) {
    return Fail(ErrorCode::kCorrupt, "does not hold as many records as it says", "record_count");
  }
  return batch;
}

CodedBatch EncodePlain(const proto::RecordBatch& batch, bool may_compress) {
  CodedBatch coded{proto::CODEC_PLAIN, batch.SerializeAsString(), batch.records_size()};
  if (!may_compress) return coded;
  std::optional<std::string> frame = CompressFrame(coded.bytes, FrameChecksum::kPresent);
  if (frame && frame->size() < coded.bytes.size()) {
    coded.codec = proto::CODEC_ZSTD;
    coded.bytes = *std::move(frame);
  }
  return coded;
}

proto::RecordBatch FirstOf(const proto::RecordBatch& batch, int count) {
  proto::RecordBatch first;
  for (int i = 0; i < count; ++i) *first.add_records() = batch.records(i);
  return first;
}

// Encodes as many of the first records as fit into `bytes_max`, but at least one. Encodes repeatedly, with fewer
// records each time, until the result fits.
CodedBatch EncodePlainUpTo(const proto::RecordBatch& batch, bool may_compress, std::size_t bytes_max) {
  CodedBatch coded = EncodePlain(batch, may_compress);
  while (coded.bytes.size() > bytes_max && coded.record_count > 1) {
    const double fitting = static_cast<double>(coded.record_count) * static_cast<double>(bytes_max) /
                           static_cast<double>(coded.bytes.size());
    coded = EncodePlain(FirstOf(batch, std::clamp(static_cast<int>(fitting), 1, coded.record_count - 1)), may_compress);
  }
  return coded;
}

}  // namespace

CodedBatch EncodeBatch(const proto::RecordBatch& batch) { return EncodePlain(batch, /*may_compress=*/true); }

void SharingEncoder::BeginRun() {
  compact_.BeginRun();
  if (++run_ == 0) ++run_;
}

CodedBatch SharingEncoder::Encode(proto::Codec codec, const proto::RecordBatch& batch, std::size_t bytes_max) {
  if (codec == proto::CODEC_PAPER_SQL) {
    std::optional<std::string> sql;
    if (paper_sql_.sql_of && batch.records_size() > 0) sql = paper_sql_.sql_of(batch.records(0));
    if (sql) return {proto::CODEC_PAPER_SQL, *std::move(sql), 1};
  }
  if (codec == proto::CODEC_COMPACT) return EncodeCompact(batch, bytes_max);
  return EncodePlainUpTo(batch, codec != proto::CODEC_PLAIN, bytes_max);
}

CodedBatch SharingEncoder::EncodeCompact(const proto::RecordBatch& batch, std::size_t bytes_max) {
  CodedRows rows = compact_.EncodeSome(batch, bytes_max);
  const int count = static_cast<int>(rows.record_count);
  if (rows.has_cells) return {proto::CODEC_COMPACT, std::move(rows.bytes), count, run_, rows.leans_on_others};
  CodedBatch plain = EncodePlain(FirstOf(batch, count), /*may_compress=*/true);
  if (plain.bytes.size() <= rows.bytes.size()) return plain;
  return {proto::CODEC_COMPACT, std::move(rows.bytes), count};
}

Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count) {
  BatchDecoder alone;
  return DecodeBatch(codec, coded, record_count, alone);
}

Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count,
                                       BatchDecoder& run) {
  if (coded.size() > kCodedBytesMax) return Fail(ErrorCode::kCorrupt, "is larger than 18 MiB", "coded");
  if (record_count > kBatchRecordsMax) return Fail(ErrorCode::kCorrupt, "is above 4096", "record_count");
  if (codec == proto::CODEC_PLAIN) return Parse(coded, record_count);
  if (codec == proto::CODEC_COMPACT) return run.Decode(coded, record_count);
  if (codec != proto::CODEC_ZSTD) return Fail(ErrorCode::kCorrupt, "is unknown to this agent", "codec");
  const Result<std::string> plain = DecompressFrame(coded, kDecodedBytesMax);
  if (!plain) return tl::unexpected(plain.error());
  return Parse(*plain, record_count);
}

Result<proto::RecordBatch> DecodePaperSql(const PaperSql& paper_sql, std::string_view sql, std::string_view record_id) {
  if (!paper_sql.record_of) return Fail(ErrorCode::kCorrupt, "is unknown to this agent", "codec");
  const Result<RecordKey> key = ParseRecordKey(record_id);
  if (!key) return Fail(ErrorCode::kCorrupt, key.error().text, "record_id");
  Result<proto::StoredRecord> record = paper_sql.record_of(sql, *key);
  if (!record) return tl::unexpected(record.error());
  proto::RecordBatch batch;
  *batch.add_records() = *std::move(record);
  return batch;
}

}  // namespace moondb
