#include "actors/sharing/codec.h"

#include <gtest/gtest.h>
#include <zstd.h>

#include <random>

namespace moondb {
namespace {

proto::RecordBatch BatchOf(int count, const std::string& content) {
  proto::RecordBatch batch;
  for (int i = 0; i < count; ++i) {
    proto::StoredRecord& record = *batch.add_records();
    record.mutable_key()->set_origin_agent(2);
    record.mutable_key()->set_epoch(9);
    record.mutable_key()->set_data_type(proto::POSE_GRAPH_NODE);
    record.mutable_key()->set_seq(static_cast<std::uint64_t>(i) + 1);
    record.set_content(content);
    record.set_hash(static_cast<std::uint64_t>(i) * 0x9E3779B97F4A7C15u);
  }
  return batch;
}

std::string Noise(std::size_t size) {
  std::mt19937_64 rng(1);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(rng());
  return bytes;
}

ErrorCode CodeOf(const Result<proto::RecordBatch>& result) {
  return result ? ErrorCode::kInternal : result.error().code;
}

TEST(CodecTest, GivesEveryByteBack) {
  for (const auto& batch : {BatchOf(0, ""), BatchOf(1, Noise(40)), BatchOf(200, std::string(100, 'a'))}) {
    const CodedBatch coded = EncodeBatch(batch);
    const auto decoded = DecodeBatch(coded.codec, coded.bytes, static_cast<std::uint32_t>(batch.records_size()));
    ASSERT_TRUE(decoded) << ToString(decoded.error());
    EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString());
  }
}

TEST(CodecTest, TakesWhicheverFormIsSmaller) {
  EXPECT_EQ(EncodeBatch(BatchOf(1, Noise(40))).codec, proto::CODEC_PLAIN);
  const CodedBatch coded = EncodeBatch(BatchOf(200, std::string(100, 'a')));
  EXPECT_EQ(coded.codec, proto::CODEC_ZSTD);
  EXPECT_LT(coded.bytes.size(), 200u * 20u);
}

TEST(CodecTest, RefusesEveryTruncation) {
  const CodedBatch coded = EncodeBatch(BatchOf(20, std::string(100, 'a')));
  for (std::size_t size = 0; size < coded.bytes.size(); ++size) {
    EXPECT_EQ(CodeOf(DecodeBatch(coded.codec, coded.bytes.substr(0, size), 20)), ErrorCode::kCorrupt) << size;
  }
}

TEST(CodecTest, RefusesEveryDamagedByteOfAFrame) {
  const proto::RecordBatch batch = BatchOf(20, std::string(100, 'a'));
  const CodedBatch coded = EncodeBatch(batch);
  ASSERT_EQ(coded.codec, proto::CODEC_ZSTD);
  for (std::size_t i = 0; i < coded.bytes.size(); ++i) {
    std::string damaged = coded.bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    const auto decoded = DecodeBatch(coded.codec, damaged, 20);
    // A flag in the frame's header that changes nothing may pass; other records may not.
    if (decoded) {
      EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString()) << i;
    }
  }
}

TEST(CodecTest, RefusesWhatWouldDecodeToTooMuch) {
  const std::string tiny_frame_of_64_mib = {'\x28', '\xB5', '\x2F', '\xFD', '\xA0', 0, 0, 0, 4, 1, 0, 0};
  const auto decoded = DecodeBatch(proto::CODEC_ZSTD, tiny_frame_of_64_mib, 1);
  ASSERT_FALSE(decoded);
  EXPECT_EQ(decoded.error().text, "would decode to more than 32 MiB");
}

// Some hundred bytes on the wire, that would take a gigabyte here.
TEST(CodecTest, RefusesMillionsOfEmptyRecords) {
  std::string plain;
  for (int i = 0; i < 8'000'000; ++i) plain += std::string_view("\x0A\x00", 2);
  std::string frame(ZSTD_compressBound(plain.size()), '\0');
  frame.resize(ZSTD_compress(frame.data(), frame.size(), plain.data(), plain.size(), 3));
  EXPECT_LT(frame.size(), 4096u);
  EXPECT_EQ(CodeOf(DecodeBatch(proto::CODEC_ZSTD, frame, 1)), ErrorCode::kCorrupt);
}

TEST(CodecTest, RefusesOtherCodecsCountsAndTrailingBytes) {
  const CodedBatch coded = EncodeBatch(BatchOf(20, std::string(100, 'a')));
  EXPECT_EQ(CodeOf(DecodeBatch(proto::CODEC_UNSPECIFIED, coded.bytes, 20)), ErrorCode::kCorrupt);
  EXPECT_EQ(CodeOf(DecodeBatch(static_cast<proto::Codec>(99), coded.bytes, 20)), ErrorCode::kCorrupt);
  EXPECT_EQ(CodeOf(DecodeBatch(coded.codec, coded.bytes, 19)), ErrorCode::kCorrupt);
  EXPECT_EQ(CodeOf(DecodeBatch(coded.codec, coded.bytes, kBatchRecordsMax + 1)), ErrorCode::kCorrupt);
  EXPECT_EQ(CodeOf(DecodeBatch(coded.codec, coded.bytes + coded.bytes, 20)), ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace moondb
