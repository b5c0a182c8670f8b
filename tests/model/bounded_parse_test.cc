#include "model/bounded_parse.h"

#include <gtest/gtest.h>

#include "proto/message.pb.h"

namespace moondb {
namespace {

std::string Repeated(const std::string& bytes, std::size_t count) {
  std::string result;
  for (std::size_t i = 0; i < count; ++i) result += bytes;
  return result;
}

// Returns a serialized RecordBatch whose only record is `record`, which is serialized already.
std::string RecordField(const std::string& record) {
  std::string bytes = "\x0A";
  for (std::size_t size = record.size();; size >>= 7) {
    const bool is_last = size < 0x80;
    bytes += static_cast<char>((size & 0x7F) | (is_last ? 0 : 0x80));
    if (is_last) return bytes + record;
  }
}

TEST(BoundedParseTest, ParsesLargeMessagesWithFewElements) {
  proto::RecordBatch batch;
  for (int i = 0; i < 4096; ++i) batch.add_records()->set_content(std::string(1000, 'x'));
  proto::RecordBatch parsed;
  ASSERT_TRUE(ParseBounded(batch.SerializeAsString(), &parsed));
  EXPECT_EQ(parsed.SerializeAsString(), batch.SerializeAsString());
}

TEST(BoundedParseTest, ParsesTheLargestHaveSetThatIsTaken) {
  proto::Message message;
  for (std::uint32_t i = 0; i < 65'536; ++i) {
    proto::StreamHave& stream = *message.mutable_have()->mutable_have()->add_streams();
    stream.set_epoch(i);
    stream.add_held()->set_first(1);
  }
  EXPECT_TRUE(ParseBounded(message.SerializeAsString(), &message));
}

TEST(BoundedParseTest, RefusesRowsOfPartsWhereverTheyStand) {
  proto::RecordBatch batch;
  const std::string empty_record("\x0A\x00", 2);
  EXPECT_FALSE(ParseBounded(Repeated(empty_record, 1'000'000), &batch));
  const std::string unknown("\x78\x01", 2);
  EXPECT_FALSE(ParseBounded(Repeated(unknown, 1'000'000), &batch));
  EXPECT_FALSE(ParseBounded(RecordField(Repeated(unknown, 1'000'000)), &batch));
  const std::string empty_key = empty_record;
  EXPECT_FALSE(ParseBounded(RecordField(Repeated(empty_key, 1'000'000)), &batch));
  EXPECT_TRUE(ParseBounded(Repeated(empty_record, kParsedPartsMax), &batch));
  EXPECT_FALSE(ParseBounded(Repeated(empty_record, kParsedPartsMax + 1), &batch));
}

TEST(BoundedParseTest, RefusesGroupsAndWhatDoesNotDecode) {
  proto::RecordBatch batch;
  const std::string group("\x7B\x7C", 2);
  EXPECT_FALSE(ParseBounded(Repeated(group, 100'000), &batch));
  EXPECT_FALSE(ParseBounded(std::string(100'000, '\xFF'), &batch));
  EXPECT_FALSE(ParseBounded(RecordField(std::string(100'000, 'x')).substr(0, 90'000), &batch));
}

TEST(BoundedParseTest, CountsElementsOfPackedLists) {
  proto::ReadRequest request;
  for (int i = 0; i < 1'000'000; ++i) request.add_data_types(1);
  proto::ReadRequest parsed;
  EXPECT_FALSE(ParseBounded(request.SerializeAsString(), &parsed));
  proto::EpochReport report;
  for (std::uint64_t i = 0; i < kParsedPartsMax - 1; ++i) report.add_epochs(UINT64_MAX - i);
  proto::EpochReport parsed_report;
  EXPECT_TRUE(ParseBounded(report.SerializeAsString(), &parsed_report)) << "of 8 bytes each";
}

TEST(BoundedParseTest, AcceptsFewerElementsFromAPeer) {
  proto::Message have;
  proto::StreamHave& stream = *have.mutable_have()->mutable_have()->add_streams();
  stream.set_epoch(UINT64_MAX);
  for (std::uint64_t i = 0; i < 10'000; ++i) {
    proto::Interval& interval = *stream.add_held();
    interval.set_first(1);
    interval.set_last(1);
  }
  proto::Message parsed;
  EXPECT_TRUE(ParseBoundedFromPeer(have.SerializeAsString(), &parsed)) << "the shortest intervals that there are";
  proto::RecordBatch batch;
  const std::string empty_record("\x0A\x00", 2);
  EXPECT_FALSE(ParseBoundedFromPeer(Repeated(empty_record, 1'000), &batch));
  EXPECT_TRUE(ParseBounded(Repeated(empty_record, 1'000), &batch));
}

}  // namespace
}  // namespace moondb
