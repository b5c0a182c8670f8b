// Tests reads by key and by time.
#include <gmock/gmock.h>

#include "model/record_key.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kStart_ns = 1'800'000'000'000'000'000;  // In 2027.
constexpr std::int64_t kSecond_ns = 1'000'000'000;

// The records' timestamps are kStart_ns and a number of seconds, which identifies a record.
class ReadRequestTest : public testing::Test {
 protected:
  static proto::Record NodeAt(std::uint64_t index, std::int64_t seconds) {
    proto::Record record = NodeRecord(1, index);
    record.set_timestamp_ns(kStart_ns + seconds * kSecond_ns);
    return record;
  }
  proto::RecordKey Insert(std::uint64_t index, std::int64_t seconds) {
    return InsertOne(*store_, NodeAt(index, seconds));
  }

  std::vector<std::int64_t> Read(const proto::ReadRequest& request) {
    const Result<proto::ReadReply> page = store_->Read(request);
    EXPECT_TRUE(page) << ToString(page.error());
    std::vector<std::int64_t> seconds;
    page_ = page.value_or(proto::ReadReply());
    for (const proto::StoredRecord& stored : page_.records()) {
      proto::Record record;
      EXPECT_TRUE(record.ParseFromString(stored.content()));
      seconds.push_back((record.timestamp_ns() - kStart_ns) / kSecond_ns);
    }
    return seconds;
  }
  // Reads all pages.
  std::vector<std::int64_t> ReadAll(proto::ReadRequest request) {
    std::vector<std::int64_t> all;
    do {
      const std::vector<std::int64_t> seconds = Read(request);
      all.insert(all.end(), seconds.begin(), seconds.end());
      if (!page_.row_ids().empty()) request.set_after_row_id(*page_.row_ids().rbegin());
    } while (!page_.is_complete() && !page_.row_ids().empty());
    return all;
  }
  static proto::ReadRequest Between(std::int64_t from, std::int64_t to) {
    proto::ReadRequest request;
    request.set_from_ns(kStart_ns + from * kSecond_ns);
    request.set_to_ns(kStart_ns + to * kSecond_ns);
    return request;
  }

  const std::unique_ptr<RecordStore> store_ = OpenStore(StoreOptionsOf(1));
  proto::ReadReply page_;
};

TEST_F(ReadRequestTest, ReadsTheRecordsWithTheseKeysInTheOrderOfStoring) {
  Insert(0, 0);
  const proto::RecordKey second = Insert(1, 1);
  Insert(2, 2);
  const proto::RecordKey fourth = Insert(3, 3);
  proto::ReadRequest request;
  *request.add_keys() = fourth;
  *request.add_keys() = second;
  *request.add_keys() = second;
  EXPECT_THAT(Read(request), ElementsAre(1, 3));
  EXPECT_TRUE(page_.is_complete());
  request.set_records_max(1);
  EXPECT_THAT(Read(request), ElementsAre(1));
  EXPECT_FALSE(page_.is_complete());
  EXPECT_THAT(ReadAll(request), ElementsAre(1, 3));
}

TEST_F(ReadRequestTest, KeysThatTheAgentDoesNotHoldAreLeftOut) {
  const proto::RecordKey held = Insert(0, 0);
  proto::ReadRequest request;
  const auto add = [&](AgentId agent, std::uint64_t epoch, DataType type, std::uint64_t seq) {
    *request.add_keys() = ToProto(RecordKey{{agent, epoch, type}, seq});
  };
  const RecordKey key = FromProto(held);
  add(77, key.stream.epoch, key.stream.type, key.seq);
  add(1, key.stream.epoch + 1, key.stream.type, key.seq);
  add(1, key.stream.epoch, 999, key.seq);
  add(1, key.stream.epoch, 1000, key.seq);
  add(1, key.stream.epoch, key.stream.type, UINT64_MAX);
  add(1, key.stream.epoch, key.stream.type, 0);
  EXPECT_THAT(Read(request), IsEmpty());
  EXPECT_TRUE(page_.is_complete());
  *request.add_keys() = held;
  EXPECT_THAT(Read(request), ElementsAre(0));
}

TEST_F(ReadRequestTest, BothEndsOfTheTimesAreIncluded) {
  for (int i = 0; i < 5; ++i) Insert(static_cast<std::uint64_t>(i), 10 - 2 * i);
  EXPECT_THAT(Read(Between(4, 8)), ElementsAre(8, 6, 4));
  EXPECT_THAT(Read(Between(5, 5)), IsEmpty());
  proto::ReadRequest request = Between(4, 8);
  request.set_is_newest_first(true);
  EXPECT_THAT(Read(request), ElementsAre(4, 6, 8));
  request = Between(4, 8);
  request.clear_from_ns();
  EXPECT_THAT(Read(request), ElementsAre(8, 6, 4, 2));
  request = Between(4, 8);
  request.clear_to_ns();
  EXPECT_THAT(Read(request), ElementsAre(10, 8, 6, 4));
  request.set_from_ns(INT64_MIN);
  request.set_to_ns(INT64_MAX);
  EXPECT_THAT(Read(request), ElementsAre(10, 8, 6, 4, 2));
  request.set_from_ns(INT64_MAX);
  EXPECT_THAT(Read(request), IsEmpty());
  request.set_from_ns(INT64_MIN);
  request.set_to_ns(INT64_MIN);
  EXPECT_THAT(Read(request), IsEmpty());
}

TEST_F(ReadRequestTest, TimesCombineWithTypesOriginsAndPages) {
  for (int i = 0; i < 6; ++i) Insert(static_cast<std::uint64_t>(i), i);
  proto::Record temperature = TemperatureRecord(-40);
  temperature.set_timestamp_ns(kStart_ns + 3 * kSecond_ns);
  InsertOne(*store_, temperature);
  proto::ReadRequest request = Between(2, 4);
  EXPECT_THAT(Read(request), ElementsAre(2, 3, 4, 3));
  request.add_data_types(proto::POSE_GRAPH_NODE);
  EXPECT_THAT(Read(request), ElementsAre(2, 3, 4));
  request.set_records_max(2);
  EXPECT_THAT(Read(request), ElementsAre(2, 3));
  EXPECT_THAT(ReadAll(request), ElementsAre(2, 3, 4));
  request.add_origin_agents(2);
  EXPECT_THAT(Read(request), IsEmpty());
}

// More rows than a page sorts: the page visits the rows in their order instead.
TEST_F(ReadRequestTest, ManyRowsInTheTimesGiveTheSamePages) {
  constexpr int kRows = 24'000;
  std::vector<proto::Record> records;
  std::vector<std::int64_t> expected;
  for (int i = 0; i < kRows; ++i) {
    const std::int64_t second = (i * 7919LL) % kRows;
    records.push_back(NodeAt(static_cast<std::uint64_t>(i), second));
    if (second >= 100 && second <= 23'000) expected.push_back(second);
    if (records.size() < 1000) continue;
    const proto::InsertReply reply = InsertAll(*store_, records);
    ASSERT_FALSE(reply.has_error()) << reply.error().text();
    records.clear();
  }
  proto::ReadRequest request = Between(100, 23'000);
  request.set_records_max(5000);
  EXPECT_EQ(ReadAll(request), expected);
  request.set_is_newest_first(true);
  request.set_records_max(3);
  EXPECT_THAT(Read(request), ElementsAre(expected.rbegin()[0], expected.rbegin()[1], expected.rbegin()[2]));
}

TEST_F(ReadRequestTest, ARowIdOfAnotherRequestIsAPlaceInTheStore) {
  for (int i = 0; i < 3; ++i) Insert(static_cast<std::uint64_t>(i), i);
  proto::ReadRequest request = Between(0, 9);
  request.set_after_row_id(UINT64_MAX);
  EXPECT_THAT(Read(request), IsEmpty());
  request.set_after_row_id(std::uint64_t{1} << 62U);
  EXPECT_THAT(Read(request), IsEmpty());
}

TEST(ReadHistoryRequestTest, TimesApplyToHistory) {
  RecordStore::Options options = StoreOptionsOf(1);
  options.history.bytes_max = 1'000'000;
  options.history.keep[proto::TEMPERATURE] = KeepRule{};
  const std::unique_ptr<RecordStore> store = OpenStore(options);
  for (int i = 0; i < 4; ++i) {
    proto::Record record = TemperatureRecord(i);
    record.set_timestamp_ns(kStart_ns + i);
    InsertOne(*store, record);
  }
  proto::ReadRequest request;
  request.set_is_history(true);
  request.set_from_ns(kStart_ns + 1);
  EXPECT_EQ(store->Read(request)->records_size(), 2);
  request.set_to_ns(kStart_ns + 1);
  EXPECT_EQ(store->Read(request)->records_size(), 1);
}

}  // namespace
}  // namespace moondb
