#include "actors/sharing/codec.h"

#include <gtest/gtest.h>
#include <zstd.h>

#include <random>

#include "proto/types.pb.h"
#include "tests/actors/sharing/coding/records.h"

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

TEST(CodecTest, RestoresEveryByte) {
  for (const auto& batch : {BatchOf(0, ""), BatchOf(1, Noise(40)), BatchOf(200, std::string(100, 'a'))}) {
    const CodedBatch coded = EncodeBatch(batch);
    const auto decoded = DecodeBatch(coded.codec, coded.bytes, static_cast<std::uint32_t>(batch.records_size()));
    ASSERT_TRUE(decoded) << ToString(decoded.error());
    EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString());
  }
}

TEST(CodecTest, UsesTheSmallerForm) {
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
    // The flipped bit may be a header flag that decoding ignores. Decoding must then return the original records.
    if (decoded) {
      EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString()) << i;
    }
  }
}

TEST(CodecTest, RefusesAFrameThatWouldDecodeToTooMuch) {
  const std::string tiny_frame_of_64_mib = {'\x28', '\xB5', '\x2F', '\xFD', '\xA0', 0, 0, 0, 4, 1, 0, 0};
  const auto decoded = DecodeBatch(proto::CODEC_ZSTD, tiny_frame_of_64_mib, 1);
  ASSERT_FALSE(decoded);
  EXPECT_EQ(decoded.error().text, "would decode to more than 18 MiB");
}

// A small zstd frame that contains 8 million empty records. The decoded records would take a gigabyte of memory.
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

constexpr std::size_t kMessageBytes = 4096;

proto::RecordBatch RowsAndMaps() {
  proto::RecordBatch batch = RowBatch(200);
  batch.MergeFrom(MapBatch(0, 4));
  return batch;
}

proto::RecordBatch From(const proto::RecordBatch& batch, int first, int count) {
  proto::RecordBatch part;
  for (int i = first; i < first + count; ++i) *part.add_records() = batch.records(i);
  return part;
}

TEST(CodecTest, CodesMapsAndRowsInAFractionOfZstd) {
  for (const proto::RecordBatch& batch : {RowBatch(200), MapBatch(0, 4), RowsAndMaps()}) {
    const CodedBatch coded = SharingEncoder().Encode(proto::CODEC_COMPACT, batch, 1'000'000);
    EXPECT_EQ(coded.codec, proto::CODEC_COMPACT);
    ASSERT_EQ(coded.record_count, batch.records_size());
    EXPECT_LT(coded.bytes.size(), EncodeBatch(batch).bytes.size() / 2);
    const auto decoded = DecodeBatch(coded.codec, coded.bytes, static_cast<std::uint32_t>(batch.records_size()));
    ASSERT_TRUE(decoded) << ToString(decoded.error());
    EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString());
  }
}

TEST(CodecTest, FillsMessagesThatDecodeInOrder) {
  std::mt19937_64 rng(2);
  proto::RecordBatch batch;
  for (int i = 0; i < 1000; ++i) {
    *batch.add_records() = Store(NodeRecord(i, rng).SerializeAsString(), proto::POSE_GRAPH_NODE, i);
  }
  batch.MergeFrom(MapBatch(0, 60));
  SharingEncoder encoder;
  BatchDecoder run;
  std::size_t bytes = 0, messages = 0;
  for (int first = 0; first < batch.records_size(); ++messages) {
    const int count = std::min(batch.records_size() - first, 1000);
    const CodedBatch coded = encoder.Encode(proto::CODEC_COMPACT, From(batch, first, count), kMessageBytes);
    ASSERT_GE(coded.record_count, 1);
    EXPECT_LE(coded.bytes.size(), kMessageBytes);
    const auto decoded = DecodeBatch(coded.codec, coded.bytes, static_cast<std::uint32_t>(coded.record_count), run);
    ASSERT_TRUE(decoded) << ToString(decoded.error());
    EXPECT_EQ(decoded->SerializeAsString(), From(batch, first, coded.record_count).SerializeAsString());
    first += coded.record_count;
    bytes += coded.bytes.size();
  }
  EXPECT_GE(static_cast<double>(bytes) / static_cast<double>(messages), 0.75 * kMessageBytes);
}

TEST(CodecTest, BeginsANewRunOnRequest) {
  SharingEncoder encoder;
  const CodedBatch first = encoder.Encode(proto::CODEC_COMPACT, MapBatch(0, 8), 1'000'000);
  const CodedBatch later = encoder.Encode(proto::CODEC_COMPACT, MapBatch(8, 8), 1'000'000);
  encoder.BeginRun();
  const CodedBatch alone = encoder.Encode(proto::CODEC_COMPACT, MapBatch(8, 8), 1'000'000);
  EXPECT_FALSE(first.leans_on_others);
  EXPECT_TRUE(later.leans_on_others);
  EXPECT_FALSE(alone.leans_on_others);
  EXPECT_NE(first.run, 0u);
  EXPECT_EQ(first.run, later.run);
  EXPECT_NE(first.run, alone.run);
  EXPECT_LT(later.bytes.size(), alone.bytes.size());
  EXPECT_EQ(CodeOf(DecodeBatch(later.codec, later.bytes, 8)), ErrorCode::kNotFound);
  EXPECT_TRUE(DecodeBatch(alone.codec, alone.bytes, 8));
  EXPECT_EQ(encoder.Encode(proto::CODEC_COMPACT, RowBatch(50), 1'000'000).run, 0u);
  EXPECT_TRUE(encoder.Encode(proto::CODEC_COMPACT, MapBatch(16, 8), 1'000'000).leans_on_others);
}

TEST(CodecTest, CodesARecordThatIsTooLargeForAMessageByItself) {
  proto::RecordBatch batch;
  for (int i = 0; i < 3; ++i) *batch.add_records() = Store(Noise(2 * kMessageBytes), 1234, i);
  for (const auto codec : {proto::CODEC_COMPACT, proto::CODEC_ZSTD, proto::CODEC_PLAIN}) {
    const CodedBatch coded = SharingEncoder().Encode(codec, batch, kMessageBytes);
    EXPECT_EQ(coded.record_count, 1);
    EXPECT_GT(coded.bytes.size(), 2 * kMessageBytes);
    EXPECT_TRUE(DecodeBatch(coded.codec, coded.bytes, 1));
  }
}

TEST(CodecTest, FallsBackIfZstdOrNoCompressionIsSmaller) {
  EXPECT_EQ(SharingEncoder().Encode(proto::CODEC_COMPACT, BatchOf(1, ""), kMessageBytes).codec, proto::CODEC_PLAIN);
  const proto::RecordBatch noise = From(RowBatch(200), 0, 200);
  EXPECT_EQ(SharingEncoder().Encode(proto::CODEC_ZSTD, noise, kMessageBytes).codec, proto::CODEC_ZSTD);
  EXPECT_EQ(SharingEncoder().Encode(proto::CODEC_PLAIN, noise, kMessageBytes).codec, proto::CODEC_PLAIN);
}

TEST(CodecTest, RefusesEveryTruncationAndWrongCountsOfTheCompactForm) {
  const proto::RecordBatch batch = RowsAndMaps();
  const CodedBatch coded = SharingEncoder().Encode(proto::CODEC_COMPACT, batch, 1'000'000);
  const auto count = static_cast<std::uint32_t>(coded.record_count);
  for (std::size_t size = 0; size < coded.bytes.size(); size += 3) {
    EXPECT_FALSE(DecodeBatch(coded.codec, coded.bytes.substr(0, size), count)) << size;
  }
  for (const std::uint32_t other : {0u, 1u, count - 1, count + 1, kBatchRecordsMax, kBatchRecordsMax + 1}) {
    EXPECT_EQ(CodeOf(DecodeBatch(coded.codec, coded.bytes, other)), ErrorCode::kCorrupt) << other;
  }
  EXPECT_FALSE(DecodeBatch(coded.codec, coded.bytes + "x", count));
}

TEST(CodecTest, NeverDecodesADamagedCompactFormToOtherRecords) {
  const proto::RecordBatch batch = RowsAndMaps();
  const CodedBatch coded = SharingEncoder().Encode(proto::CODEC_COMPACT, batch, 1'000'000);
  for (std::size_t i = 0; i < coded.bytes.size(); i += 2) {
    std::string damaged = coded.bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    const auto decoded = DecodeBatch(coded.codec, damaged, static_cast<std::uint32_t>(coded.record_count));
    if (decoded) {
      EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString()) << i;
    }
  }
}

}  // namespace
}  // namespace moondb
