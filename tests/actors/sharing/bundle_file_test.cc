#include "actors/sharing/bundle_file.h"

#include <gtest/gtest.h>
#include <xxhash.h>

#include <random>
#include <vector>

#include "model/record_hash.h"

namespace moondb {
namespace {

proto::BundleFile Head() {
  proto::BundleFile head;
  head.set_team("test");
  head.set_agent_id(4);
  head.set_number(7);
  head.set_made_ns(1234);
  return head;
}

// Returns `count` records of one stream with seqs from `first_seq` on. Each has `bytes` of random content, which does
// not compress.
proto::RecordBatch Batch(std::uint64_t first_seq, int count, std::size_t bytes) {
  std::mt19937_64 rng(first_seq);
  proto::RecordBatch batch;
  for (int i = 0; i < count; ++i) {
    proto::StoredRecord& record = *batch.add_records();
    const RecordKey key{{2, 9, 1000}, first_seq + static_cast<std::uint64_t>(i)};
    *record.mutable_key() = ToProto(key);
    for (std::size_t k = 0; k < bytes; ++k) record.mutable_content()->push_back(static_cast<char>(rng()));
    record.set_hash(HashRecord(key, record.content()));
  }
  return batch;
}

std::vector<std::string> KeysIn(const std::string& file) {
  std::vector<std::string> keys;
  const auto head = ReadBundle(file, [&keys](const proto::StoredRecord& record) -> Result<void> {
    keys.push_back(ToString(FromProto(record.key())));
    return {};
  });
  EXPECT_TRUE(head) << ToString(head.error());
  return keys;
}

ErrorCode CodeOf(const std::string& file) {
  const auto read = ReadBundle(file, [](const proto::StoredRecord&) { return Result<void>(); });
  return read ? ErrorCode::kInternal : read.error().code;
}

TEST(BundleFileTest, ReturnsTheRecordsThatWereAdded) {
  BundleWriter writer(Head(), 100'000);
  EXPECT_EQ(writer.Add(Batch(1, 20, 50)), 20);
  EXPECT_EQ(writer.Add(Batch(21, 5, 50)), 5);
  EXPECT_EQ(writer.record_count(), 25u);
  const std::string file = writer.Finish();
  std::vector<std::string> contents;
  const auto head = ReadBundle(file, [&contents](const proto::StoredRecord& record) -> Result<void> {
    contents.push_back(record.content());
    return {};
  });
  ASSERT_TRUE(head) << ToString(head.error());
  EXPECT_EQ(head->team(), "test");
  EXPECT_EQ(head->number(), 7u);
  EXPECT_EQ(FromProto(head->have())->Get({2, 9, 1000}).held.Count(), 25u);
  ASSERT_EQ(contents.size(), 25u);
  EXPECT_EQ(contents[24], Batch(21, 5, 50).records(4).content());
}

TEST(BundleFileTest, FillsItsBudgetAndNeverExceedsIt) {
  for (const std::size_t budget : {1024, 3000, 10'000, 30'000}) {
    BundleWriter writer(Head(), budget);
    const int added = writer.Add(Batch(1, 1000, 40));
    const std::string file = writer.Finish();
    EXPECT_GT(added, 0);
    EXPECT_LT(added, 1000);
    EXPECT_LE(file.size(), budget);
    EXPECT_GT(file.size() + 100, budget) << "one more, with what a part costs, would have fitted";
    EXPECT_EQ(KeysIn(file).size(), static_cast<std::size_t>(added));
  }
}

TEST(BundleFileTest, RefusesARecordThatDoesNotFit) {
  BundleWriter writer(Head(), 1024);
  EXPECT_EQ(writer.Add(Batch(1, 1, 2000)), 0);
  EXPECT_EQ(writer.record_count(), 0u);
  EXPECT_TRUE(KeysIn(writer.Finish()).empty());
}

TEST(BundleFileTest, RefusesEveryDamagedByteAndEveryTruncation) {
  BundleWriter writer(Head(), 10'000);
  ASSERT_EQ(writer.Add(Batch(1, 3, 30)), 3);
  const std::string file = writer.Finish();
  for (std::size_t i = 0; i < file.size(); ++i) {
    std::string damaged = file;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    EXPECT_EQ(CodeOf(damaged), ErrorCode::kCorrupt) << i;
    EXPECT_EQ(CodeOf(file.substr(0, i)), ErrorCode::kCorrupt) << i;
  }
}

// The file's checksum is correct, because an attacker can compute it.
TEST(BundleFileTest, RefusesAHaveSetThatDoesNotMatchItsRecords) {
  BundleWriter writer(Head(), 10'000);
  ASSERT_EQ(writer.Add(Batch(1, 3, 30)), 3);
  const std::string file = writer.Finish();
  proto::BundleFile parsed;
  ASSERT_TRUE(parsed.ParseFromString(file.substr(24)));
  parsed.mutable_have()->mutable_streams(0)->mutable_held(0)->set_last(4);
  const std::string body = parsed.SerializeAsString();
  const std::uint64_t hash = XXH64(body.data(), body.size(), 0);
  std::string forged = file.substr(0, 16);
  for (int i = 0; i < 8; ++i) forged += static_cast<char>(hash >> (8 * i));
  EXPECT_EQ(CodeOf(forged + body), ErrorCode::kCorrupt);
}

TEST(BundleFileTest, DistinguishesAnotherVersionFromDamage) {
  const auto read = ReadBundle("moondb bundle 2\nwhatever", [](const proto::StoredRecord&) { return Result<void>(); });
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().text.find("unknown bundle version"), std::string::npos) << read.error().text;
}

}  // namespace
}  // namespace moondb
