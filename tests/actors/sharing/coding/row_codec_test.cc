#include "actors/sharing/coding/row_codec.h"

#include <gtest/gtest.h>

#include <bit>
#include <functional>
#include <limits>
#include <random>

#include "actors/sharing/coding/row_shape.h"
#include "proto/record.pb.h"
#include "records.h"
#include "tests/actors/sharing/mutator.h"

namespace moondb {
namespace {

constexpr std::size_t kContentBytesMax = 1024 * 1024;

std::string Encode(const std::vector<std::string>& rows) {
  std::string bytes;
  PutRows({rows.begin(), rows.end()}, bytes);
  return bytes;
}

void ExpectRoundTrip(const std::vector<std::string>& rows) {
  const std::string bytes = Encode(rows);
  ByteReader reader(bytes);
  EXPECT_EQ(TakeRows(kContentBytesMax, reader), rows);
  EXPECT_TRUE(reader.is_good());
  EXPECT_TRUE(reader.IsAtEnd());
}

std::vector<std::string> Rows(int count, const std::function<proto::Record(int)>& make) {
  std::vector<std::string> rows;
  for (int i = 0; i < count; ++i) rows.push_back(make(i).SerializeAsString());
  return rows;
}

std::size_t PartCount(const std::string& row) { return FindShape(row, *proto::Record::descriptor()).size(); }

TEST(RowCodecTest, RestoresRecords) {
  std::mt19937_64 rng(41);
  ExpectRoundTrip({});
  ExpectRoundTrip(Rows(300, TemperatureRecord));
  ExpectRoundTrip(Rows(300, [&](int i) { return NodeRecord(i, rng); }));
  ExpectRoundTrip(Rows(100, [&](int i) { return i % 3 == 0 ? TemperatureRecord(i) : NodeRecord(i, rng); }));
}

TEST(RowCodecTest, RestoresEdgesWithTheirCovariances) {
  ExpectRoundTrip(Rows(50, [](int i) {
    proto::Record record;
    record.mutable_pose_graph_edge()->mutable_from()->set_index(static_cast<std::uint64_t>(i));
    for (int k = 0; k < 21; ++k)
      record.mutable_pose_graph_edge()->mutable_relative_pose()->add_covariance(i * 1e-4 * k);
    return record;
  }));
}

TEST(RowCodecTest, RestoresEveryDoubleBitForBit) {
  std::vector<std::string> rows;
  for (const std::uint64_t bits : {std::uint64_t{0x7FF8000000000001}, 0xFFF8DEADBEEF0001u, 0x7FF0000000000001u,
                                   0x8000000000000000u, std::uint64_t{1}, 0x7FF0000000000000u}) {
    proto::Record record;
    record.mutable_temperature()->set_celsius(std::bit_cast<double>(bits));
    rows.push_back(record.SerializeAsString());
  }
  ExpectRoundTrip(rows);
}

TEST(RowCodecTest, RestoresUnknownFieldsInTheirPlaces) {
  const std::string known = TemperatureRecord(1).SerializeAsString();
  const std::string unknown(
      "\xF8\x07\x2A\xF2\x3F\x03"
      "abc",
      9);  // Field 127 is 42, and field 1022 is "abc".
  ExpectRoundTrip({unknown + known, known + unknown, known, unknown});
}

TEST(RowCodecTest, RestoresBytesThatAreNotCanonical) {
  // A bool whose varint has two bytes instead of one.
  const std::string overlong("\x09\x01\x02\x03\x04\x05\x06\x07\x08\x10\x81\x00", 12);
  const std::string cut = NodeRecord(1, *std::make_unique<std::mt19937_64>(1)).SerializeAsString().substr(0, 30);
  const std::string group("\x0B\x0C", 2);
  EXPECT_EQ(PartCount(overlong), 1u);
  ExpectRoundTrip({overlong, cut, group, "", std::string(1, '\0'), std::string(300, '\xFF'),
                   TemperatureRecord(2).SerializeAsString()});
}

TEST(RowCodecTest, RestoresRowsThatDifferOnlyInTheirNesting) {
  const std::string outside("\x62\x02\x08\x01\x10\x01", 6);  // A nested message with one field, and a field after it.
  const std::string inside("\x62\x04\x08\x01\x10\x01", 6);   // A nested message with both fields.
  ExpectRoundTrip({outside, inside, outside});
}

TEST(RowCodecTest, RestoresMoreShapesThanItMayStore) {
  std::vector<std::string> rows;
  for (int i = 0; i < 100; ++i) {
    std::string row;
    for (int k = 0; k <= i; ++k) row += std::string("\x10\x01", 2);
    rows.push_back(row);
    rows.push_back(row);
  }
  ExpectRoundTrip(rows);
}

TEST(RowCodecTest, RestoresRowsThatAreNestedTooDeepOrHaveTooManyParts) {
  proto::Record record;
  for (int i = 0; i < 400; ++i) record.mutable_local_traversability_map()->add_layers()->set_width_cells(9);
  const std::string wide = record.SerializeAsString();
  EXPECT_EQ(PartCount(wide), 1u);
  ExpectRoundTrip({wide, TemperatureRecord(1).SerializeAsString()});
}

TEST(RowCodecTest, RestoresTenThousandMutatedRows) {
  const unsigned seed = 42;
  SCOPED_TRACE(seed);
  Mutator mutator(seed);
  std::mt19937_64 rng(seed);
  for (int batch = 0; batch < 200; ++batch) {
    std::vector<std::string> rows;
    for (int i = 0; i < 50; ++i) {
      proto::Record record = i % 2 == 0 ? TemperatureRecord(i) : NodeRecord(i, rng);
      if (i % 3 == 0) mutator.Mutate(record);
      rows.push_back(record.SerializeAsString());
      if (i % 5 == 0) mutator.Mutate(rows.back());
    }
    ExpectRoundTrip(rows);
  }
}

TEST(RowCodecTest, StoresTheSameFieldOfAllRowsTogether) {
  const std::vector<std::string> rows = Rows(1000, TemperatureRecord);
  const std::string bytes = Encode(rows);
  EXPECT_LT(bytes.size(), rows.size() * 14) << "five bytes of a timestamp, eight of a double";
}

TEST(RowCodecTest, RefusesEveryTruncation) {
  std::mt19937_64 rng(43);
  const std::string bytes = Encode(Rows(20, [&](int i) { return NodeRecord(i, rng); }));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    ByteReader reader(std::string_view(bytes).substr(0, size));
    TakeRows(kContentBytesMax, reader);
    EXPECT_FALSE(reader.is_good()) << size;
  }
}

TEST(RowCodecTest, RefusesToDecodeMoreBytesThanItsLimit) {
  const std::string bytes = Encode(std::vector<std::string>(100, std::string(1000, 'a')));
  ByteReader reader(bytes);
  TakeRows(99'999, reader);
  EXPECT_FALSE(reader.is_good());
}

TEST(RowCodecTest, RefusesInvalidShapes) {
  const auto refuses = [](const RowShape& shape) {
    std::string bytes;
    PutShape(shape, bytes);
    ByteReader reader(bytes);
    TakeShape(reader);
    return !reader.is_good();
  };
  EXPECT_FALSE(refuses({{Part::kMessage, 10, 0}, {Part::kVarint, 8, 0}, {Part::kEnd, 0, 0}}));
  EXPECT_TRUE(refuses({{Part::kEnd, 0, 0}}));
  EXPECT_TRUE(refuses({{Part::kMessage, 10, 0}}));
  EXPECT_TRUE(refuses({{Part::kVarint, 9, 0}})) << "another wire type";
  EXPECT_TRUE(refuses({{Part::kVarint, 0, 0}})) << "field 0";
  EXPECT_TRUE(refuses({{Part::kContent, 0, 0}, {Part::kVarint, 8, 0}}));
  EXPECT_TRUE(refuses({{Part::kDoubles, 10, kShapeDoublesMax + 1}}));
  EXPECT_TRUE(refuses(RowShape(kShapePartsMax + 1, {Part::kVarint, 8, 0})));
  EXPECT_TRUE(refuses(RowShape(20, {Part::kDoubles, 10, kShapeDoublesMax}))) << "too many values";
  RowShape deep(kShapeDepthMax + 1, {Part::kMessage, 10, 0});
  deep.resize(2 * deep.size(), {Part::kEnd, 0, 0});
  EXPECT_TRUE(refuses(deep));
}

// Without a limit on doubles, these few bytes would make the decoder allocate gigabytes.
TEST(RowCodecTest, RefusesAShapeWithTooManyDoubles) {
  std::string bytes;
  PutVarint(1, bytes);      // One row.
  PutVarint(1, bytes);      // One shape.
  PutVarint(1, bytes);      // One part of the shape.
  bytes.push_back('\x05');  // The part's kind is doubles.
  PutVarint(1 << 3 | 2, bytes);
  PutVarint(300'000'000, bytes);  // Number of doubles.
  ByteReader reader(bytes);
  EXPECT_TRUE(TakeRows(1000, reader).empty());
  EXPECT_FALSE(reader.is_good());
  ByteReader shape_reader(std::string_view(bytes).substr(2));
  EXPECT_TRUE(TakeShape(shape_reader).empty());
}

TEST(RowCodecTest, SurvivesMutatedBytes) {
  const unsigned seed = 44;
  SCOPED_TRACE(seed);
  Mutator mutator(seed);
  std::mt19937_64 rng(seed);
  const std::string good =
      Encode(Rows(30, [&](int i) { return i % 2 == 0 ? NodeRecord(i, rng) : TemperatureRecord(i); }));
  for (int round = 0; round < 20'000; ++round) {
    std::string bytes = good;
    mutator.Mutate(bytes);
    ByteReader reader(bytes);
    std::size_t size = 0;
    for (const std::string& row : TakeRows(kContentBytesMax, reader)) size += row.size();
    ASSERT_LE(size, kContentBytesMax);
  }
}

}  // namespace
}  // namespace moondb
