// Tests batches of wire version 1 in the codecs compact, plain and zstd, as an agent of that version wrote them. If a
// test fails, the code implements another wire version (docs/COMPATIBILITY.md). Batches with zstd frames are only
// decoded, because each version of zstd may write other bytes.
#include <gtest/gtest.h>

#include "actors/sharing/codec.h"
#include "model/wire_version.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/coding/records.h"

namespace moondb {
namespace {

std::string FromHex(std::string_view hex) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(static_cast<char>(std::stoi(std::string(hex.substr(i, 2)), nullptr, 16)));
  }
  return bytes;
}

std::string ToHex(const std::string& bytes) {
  constexpr char kDigits[] = "0123456789ABCDEF";
  std::string hex;
  for (const char byte : bytes) {
    hex.push_back(kDigits[(byte >> 4) & 15]);
    hex.push_back(kDigits[byte & 15]);
  }
  return hex;
}

// Returns map number `index` of a robot that drives past blocks. From one map to the next, the robot moves by 4 cells
// of the finest layer.
Layers RollingMap(int index) {
  return DrawLayers(2, 24, 24, [index](int layer, int column, int row) {
    const int x = (((column - 12) << layer) + 4 * index + 1024) >> 3;
    const int y = (((row - 12) << layer) + 1024) >> 3;
    return (7 * x + 13 * y + x * y) % 5 == 0 ? Cell::kHazard : Cell::kFree;
  });
}

// Returns a batch of two maps and three rows. Maps and rows are numbered from `index` on.
proto::RecordBatch BatchFrom(int index) {
  proto::RecordBatch batch;
  for (int i = index; i < index + 2; ++i) *batch.add_records() = MapOf(RollingMap(i), i);
  for (int i = index; i < index + 3; ++i) {
    *batch.add_records() = Store(TemperatureRecord(i).SerializeAsString(), proto::TEMPERATURE, i);
  }
  return batch;
}

// BatchFrom(0), coded as the first batch of a run. The second map is coded with reference to the first map.
constexpr std::string_view kFirst =
    "0100E90228B52FFD603600550500D2C82029706D3AB0782807853A9C52DCF31C5A1998120FC12DFC7F45001C872B3C25602A4441DA44A4"
    "1B91290507EB371DC30843EC2AFE0D5B1F15CA01DA6CEE146D8EF47992CFE77506784A9491261363DE5F980A8559650FECF6ECD705BA5B48"
    "4D1726A69AEE754C93A33037CAB26F673E7FDB047F905E4C301D51C814B1D8E94BE23358010E00F92E74281C08140826EBEA401772BAFBF0"
    "A11D8BDE86204135B0531A9B659FDA9627E296B8DB1062CB71E6B9723D85F86386DEADB3E2FC05F8DF068290B5B14D25CAB127BC8722242B";

// BatchFrom(2), coded as the next batch of that run. Maps and rows are coded with reference to the maps and rows of
// kFirst.
constexpr std::string_view kSecond =
    "0102A30128B52FFD20D3450200A4020555863D8203021901000002820101000200020201010180A8FEEAEA01E6CC99B3E6CCF999C00106"
    "31010A0057DB6A350520284DAC390EFBBAB06BE0B00C001A02C27294F5067DFDDFFFFF6EB918D2ACD3ED480C1D166D638635";

// RowBatch(2) in the compact codec: two rows without maps.
constexpr std::string_view kRows =
    "008A0102D7810F6800020000A198F5DBE0C3A69E5F000001000001010200000000000002010402090652020907008080A8B1E39FE7CB1704"
    "0094357700808080808080809AC00100";

// RowBatch(2) in codec plain, and as one zstd frame.
constexpr std::string_view kPlain =
    "0A300A0F080211214C7D0B1E9A3C5F1801200112140900002A36FE9C971752090900000000000034C0194D392A6F2B8135550A300A0F0802"
    "11214C7D0B1E9A3C5F1801200212140900CAC471FE9C971752090900000000000034C019D1F2323F034B5D04";
constexpr std::string_view kZstd =
    "28B52FFD246435020094030A300A0F080211214C7D0B1E9A3C5F1801200112140900002A36FE9C97175209090034C0194D392A6F2B813555"
    "02CAC471D1F2323F034B5D040400000704B72AF76AC113210B7F42";

void ExpectIs(const Result<proto::RecordBatch>& decoded, const proto::RecordBatch& batch) {
  ASSERT_TRUE(decoded) << ToString(decoded.error());
  EXPECT_EQ(decoded->SerializeAsString(), batch.SerializeAsString());
}

TEST(GoldenBatchesTest, HaveTheCurrentWireVersion) { EXPECT_EQ(kWireVersion, 1u); }

TEST(GoldenBatchesTest, DecodeACompactBatchOfRows) {
  ExpectIs(DecodeBatch(proto::CODEC_COMPACT, FromHex(kRows), 2), RowBatch(2));
}

TEST(GoldenBatchesTest, DecodeACompactBatchOfMapsAndRows) {
  BatchDecoder decoder;
  ExpectIs(decoder.Decode(FromHex(kFirst), 5), BatchFrom(0));
}

TEST(GoldenBatchesTest, DecodeTheNextBatchOfARun) {
  BatchDecoder decoder;
  ExpectIs(decoder.Decode(FromHex(kFirst), 5), BatchFrom(0));
  ExpectIs(decoder.Decode(FromHex(kSecond), 5), BatchFrom(2));
  const auto alone = BatchDecoder().Decode(FromHex(kSecond), 5);
  ASSERT_FALSE(alone);
  EXPECT_EQ(alone.error().code, ErrorCode::kNotFound);
}

TEST(GoldenBatchesTest, EncodeAndDecodeAPlainBatch) {
  EXPECT_EQ(ToHex(RowBatch(2).SerializeAsString()), kPlain);
  ExpectIs(DecodeBatch(proto::CODEC_PLAIN, FromHex(kPlain), 2), RowBatch(2));
}

TEST(GoldenBatchesTest, DecodeAZstdFrame) { ExpectIs(DecodeBatch(proto::CODEC_ZSTD, FromHex(kZstd), 2), RowBatch(2)); }

}  // namespace
}  // namespace moondb
