#include "actors/sharing/coding/batch_codec.h"

#include <gtest/gtest.h>

#include "actors/sharing/coding/row_codec.h"
#include "drawn_maps.h"
#include "proto/types.pb.h"
#include "records.h"
#include "tests/actors/sharing/mutator.h"

namespace moondb {
namespace {

using Previous = MapRunEncoder::Previous;

proto::RecordBatch MixedBatch() {
  proto::RecordBatch batch = MapBatch(0, 3);
  batch.MergeFrom(RowBatch(5));
  *batch.add_records() = Store("no record at all", 1234, 9);
  *batch.add_records() = Store("no map", proto::LOCAL_TRAVERSABILITY_MAP, 10);
  batch.MergeFrom(MapBatch(3, 1));
  return batch;
}

std::string Encode(const proto::RecordBatch& batch) { return BatchEncoder(Previous::kWhereItPays).Encode(batch); }

ErrorCode CodeOf(const Result<proto::RecordBatch>& result) {
  return result ? ErrorCode::kInternal : result.error().code;
}

void ExpectDecodes(BatchDecoder& decoder, const std::string& coded, const proto::RecordBatch& batch) {
  const auto decoded = decoder.Decode(coded, static_cast<std::uint32_t>(batch.records_size()));
  ASSERT_TRUE(decoded) << ToString(decoded.error());
  EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString());
}

TEST(BatchCodecTest, RestoresEveryByte) {
  for (const auto& batch : {proto::RecordBatch(), RowBatch(1), RowBatch(500), MapBatch(0, 5), MixedBatch()}) {
    BatchDecoder decoder;
    ExpectDecodes(decoder, Encode(batch), batch);
  }
}

TEST(BatchCodecTest, RestoresAHashThatDoesNotMatchItsRecord) {
  proto::RecordBatch batch = MixedBatch();
  batch.mutable_records(1)->set_hash(1);
  batch.mutable_records(4)->set_hash(0);
  BatchDecoder decoder;
  ExpectDecodes(decoder, Encode(batch), batch);
}

TEST(BatchCodecTest, RestoresMapsThatItCannotSplit) {
  proto::RecordBatch batch;
  *batch.add_records() =
      MapOf(DrawLayers(1, 1100, 1000, [](int, int column, int) { return static_cast<Cell>(column % 3); }), 0);
  // These six maps together exceed kCodedCellsMax.
  for (int i = 1; i < 7; ++i) {
    *batch.add_records() = MapOf(DrawLayers(1, 1000, 1000, [](int, int, int) { return Cell::kFree; }), i);
  }
  BatchDecoder decoder;
  ExpectDecodes(decoder, Encode(batch), batch);
}

TEST(BatchCodecTest, NeedsLessThanATenthOfTheBytesOfPlainRows) {
  const proto::RecordBatch batch = RowBatch(1000);
  EXPECT_LT(Encode(batch).size(), batch.ByteSizeLong() / 10);
}

TEST(BatchCodecTest, KeepsLearningFromBatchToBatch) {
  BatchEncoder encoder(Previous::kWhereItPays);
  BatchDecoder decoder;
  std::size_t first = 0, last = 0;
  for (int i = 0; i < 12; ++i) {
    const proto::RecordBatch batch = MapBatch(2 * i, 2);
    const std::string coded = encoder.Encode(batch);
    (i == 0 ? first : last) = coded.size();
    ExpectDecodes(decoder, coded, batch);
    const proto::RecordBatch rows = RowBatch(3);
    ExpectDecodes(decoder, encoder.Encode(rows), rows);
  }
  EXPECT_LT(last, first * 8 / 10);
}

TEST(BatchCodecTest, RefusesABatchWhoseRunItHasNotSeen) {
  BatchEncoder encoder(Previous::kNever);
  const std::string first = encoder.Encode(MapBatch(0, 2));
  const std::string second = encoder.Encode(MapBatch(2, 2));
  const std::string third = encoder.Encode(MapBatch(4, 2));
  BatchDecoder decoder;
  EXPECT_EQ(CodeOf(decoder.Decode(second, 2)), ErrorCode::kNotFound);
  ExpectDecodes(decoder, first, MapBatch(0, 2));
  EXPECT_EQ(CodeOf(decoder.Decode(third, 2)), ErrorCode::kNotFound);
  ExpectDecodes(decoder, second, MapBatch(2, 2));
  EXPECT_EQ(CodeOf(decoder.Decode(second, 2)), ErrorCode::kNotFound) << "twice";
  ExpectDecodes(decoder, third, MapBatch(4, 2));
  encoder.BeginRun();
  ExpectDecodes(decoder, encoder.Encode(MapBatch(6, 2)), MapBatch(6, 2));
}

TEST(BatchCodecTest, NeedsNoRunForRows) {
  BatchEncoder encoder(Previous::kNever);
  encoder.Encode(MapBatch(0, 2));
  BatchDecoder decoder;
  ExpectDecodes(decoder, encoder.Encode(RowBatch(4)), RowBatch(4));
}

TEST(BatchCodecTest, RefersToAMapThatBothEndsHold) {
  const proto::StoredRecord held = MapBatch(0, 1).records(0);
  BatchEncoder encoder(Previous::kWhereItPays);
  encoder.BeginRun(&held);
  const proto::RecordBatch batch = MapBatch(1, 2);
  const std::string coded = encoder.Encode(batch);
  EXPECT_LT(coded.size(), Encode(batch).size());

  const auto reference = ReferenceOf(coded);
  ASSERT_TRUE(reference && *reference);
  EXPECT_EQ((*reference)->key, FromProto(held.key()));
  EXPECT_EQ((*reference)->hash, held.hash());
  BatchDecoder decoder;
  const auto decoded = decoder.Decode(coded, 2, &held);
  ASSERT_TRUE(decoded) << ToString(decoded.error());
  EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString());
  ExpectDecodes(decoder, encoder.Encode(MapBatch(3, 1)), MapBatch(3, 1));

  EXPECT_EQ(CodeOf(BatchDecoder().Decode(coded, 2)), ErrorCode::kNotFound);
  const proto::StoredRecord other = MapBatch(5, 1).records(0);
  EXPECT_EQ(CodeOf(BatchDecoder().Decode(coded, 2, &other)), ErrorCode::kNotFound);
  EXPECT_FALSE(*ReferenceOf(Encode(batch)));
}

TEST(BatchCodecTest, ACopyContinuesLikeTheOriginal) {
  BatchEncoder encoder(Previous::kWhereItPays);
  encoder.Encode(MapBatch(0, 3));
  BatchEncoder copy = encoder;
  copy.Encode(MapBatch(9, 1));
  BatchEncoder other = encoder;
  EXPECT_EQ(encoder.Encode(MapBatch(3, 2)), other.Encode(MapBatch(3, 2)));
}

TEST(BatchCodecTest, RefusesAWrongNumberOfRecordsAndAnUnknownHeader) {
  std::string coded = Encode(MixedBatch());
  const std::uint32_t count = static_cast<std::uint32_t>(MixedBatch().records_size());
  EXPECT_EQ(CodeOf(BatchDecoder().Decode(coded, count + 1)), ErrorCode::kCorrupt);
  EXPECT_EQ(CodeOf(BatchDecoder().Decode(coded, kRowsMax + 1)), ErrorCode::kCorrupt);
  // The first byte of a batch is 0 (no maps), 1 (maps of a run) or 2 (maps with a reference).
  coded[0] = 3;
  EXPECT_EQ(CodeOf(BatchDecoder().Decode(coded, count)), ErrorCode::kCorrupt);
}

TEST(BatchCodecTest, RefusesEveryTruncation) {
  for (const auto& batch : {MapBatch(0, 2), RowBatch(30)}) {
    const std::string coded = Encode(batch);
    for (std::size_t size = 0; size < coded.size(); ++size) {
      const auto decoded =
          BatchDecoder().Decode(coded.substr(0, size), static_cast<std::uint32_t>(batch.records_size()));
      EXPECT_EQ(CodeOf(decoded), ErrorCode::kCorrupt) << size;
    }
    EXPECT_EQ(CodeOf(BatchDecoder().Decode(coded + "more", static_cast<std::uint32_t>(batch.records_size()))),
              ErrorCode::kCorrupt);
  }
}

TEST(BatchCodecTest, NeverDecodesDamagedBytesToOtherRecords) {
  const unsigned seed = 51;
  SCOPED_TRACE(seed);
  Mutator mutator(seed);
  proto::RecordBatch batch = MapBatch(0, 1);
  batch.MergeFrom(RowBatch(10));
  const std::string coded = Encode(batch);
  for (int round = 0; round < 3000; ++round) {
    std::string damaged = coded;
    mutator.Mutate(damaged);
    const auto decoded = BatchDecoder().Decode(damaged, 11);
    if (!decoded) continue;
    ASSERT_EQ(decoded->SerializeAsString(), batch.SerializeAsString()) << round;
  }
}

TEST(BatchCodecTest, RefusesAFrameThatWouldExhaustTheMemory) {
  // A batch without maps. The header of its zstd frame claims a content of 2 GiB.
  std::string coded(1, '\0');
  const std::string frame("\x28\xB5\x2F\xFD\xA0\x00\x00\x00\x80\x01\x00\x00", 12);
  coded.push_back(static_cast<char>(frame.size() * 2 + 1));
  EXPECT_EQ(CodeOf(BatchDecoder().Decode(coded + frame, 1)), ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace moondb
