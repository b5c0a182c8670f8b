#include "actors/sharing/codec.h"

#include <zstd.h>

#include <memory>
#include <optional>
#include <utility>

#include "model/bounded_parse.h"

namespace moondb {
namespace {

constexpr int kZstdLevel = 3;  // Level 9 gains a tenth at six times the time.

struct FreeCompressor {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

std::optional<std::string> Compress(const std::string& plain) {
  std::unique_ptr<ZSTD_CCtx, FreeCompressor> context(ZSTD_createCCtx());
  if (!context) return std::nullopt;
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kZstdLevel);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
  std::string frame(ZSTD_compressBound(plain.size()), '\0');
  const std::size_t size = ZSTD_compress2(context.get(), frame.data(), frame.size(), plain.data(), plain.size());
  if (ZSTD_isError(size)) return std::nullopt;
  frame.resize(size);
  return frame;
}

Result<std::string> Decompress(std::string_view coded) {
  const unsigned long long size = ZSTD_getFrameContentSize(coded.data(), coded.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN) {
    return Fail(ErrorCode::kCorrupt, "no zstd frame that states its size", "coded");
  }
  if (size > kDecodedBytesMax) return Fail(ErrorCode::kCorrupt, "would decode to more than 32 MiB", "coded");
  const std::size_t frame_size = ZSTD_findFrameCompressedSize(coded.data(), coded.size());
  if (frame_size != coded.size()) return Fail(ErrorCode::kCorrupt, "is not exactly one zstd frame", "coded");
  std::string plain(static_cast<std::size_t>(size), '\0');
  const std::size_t decoded = ZSTD_decompress(plain.data(), plain.size(), coded.data(), coded.size());
  if (ZSTD_isError(decoded)) return Fail(ErrorCode::kCorrupt, ZSTD_getErrorName(decoded), "coded");
  if (decoded != plain.size()) return Fail(ErrorCode::kCorrupt, "decodes to another size than it states", "coded");
  return plain;
}

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
  std::optional<std::string> frame = Compress(plain);
  if (frame && frame->size() < plain.size()) return {proto::CODEC_ZSTD, *std::move(frame)};
  return {proto::CODEC_PLAIN, std::move(plain)};
}

Result<proto::RecordBatch> DecodeBatch(proto::Codec codec, std::string_view coded, std::uint32_t record_count) {
  if (coded.size() > kCodedBytesMax) return Fail(ErrorCode::kCorrupt, "is larger than 32 MiB", "coded");
  if (record_count > kBatchRecordsMax) return Fail(ErrorCode::kCorrupt, "is above 4096", "record_count");
  if (codec == proto::CODEC_PLAIN) return Parse(coded, record_count);
  if (codec != proto::CODEC_ZSTD) return Fail(ErrorCode::kCorrupt, "is not known here", "codec");
  const Result<std::string> plain = Decompress(coded);
  if (!plain) return tl::unexpected(plain.error());
  return Parse(*plain, record_count);
}

}  // namespace moondb
