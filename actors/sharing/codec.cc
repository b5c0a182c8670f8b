#include "actors/sharing/codec.h"

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

}  // namespace

CodedBatch EncodeBatch(const proto::RecordBatch& batch) {
  std::string plain = batch.SerializeAsString();
  std::optional<std::string> frame = CompressFrame(plain, FrameChecksum::kPresent);
  if (frame && frame->size() < plain.size()) return {proto::CODEC_ZSTD, *std::move(frame)};
  return {proto::CODEC_PLAIN, std::move(plain)};
}

Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count) {
  if (coded.size() > kCodedBytesMax) return Fail(ErrorCode::kCorrupt, "is larger than 32 MiB", "coded");
  if (record_count > kBatchRecordsMax) return Fail(ErrorCode::kCorrupt, "is above 4096", "record_count");
  if (codec == proto::CODEC_PLAIN) return Parse(coded, record_count);
  if (codec != proto::CODEC_ZSTD) return Fail(ErrorCode::kCorrupt, "is not known here", "codec");
  const Result<std::string> plain = DecompressFrame(coded, kDecodedBytesMax);
  if (!plain) return tl::unexpected(plain.error());
  return Parse(*plain, record_count);
}

}  // namespace moondb
