#include "actors/storage/bundle_shelf.h"

#include <gtest/gtest.h>

#include "model/have_set.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

proto::SaveBundleRequest BundleOf(std::uint32_t number, std::uint64_t seq, std::string file) {
  proto::SaveBundleRequest request;
  request.mutable_bundle()->set_number(number);
  request.mutable_bundle()->set_made_ns(1000 + number);
  request.mutable_bundle()->set_record_count(1);
  request.mutable_bundle()->set_hash(0xF000000000000000u + number);
  HaveSet have;
  have[{1, 5, proto::TEMPERATURE}].held.Add(seq);
  *request.mutable_have() = ToProto(have);
  request.set_file(std::move(file));
  return request;
}

std::uint64_t CountOf(const proto::HaveSet& have) {
  return (*FromProto(have)).Get({1, 5, proto::TEMPERATURE}).Covered().Count();
}

class BundleShelfTest : public testing::Test {
 protected:
  void Open() {
    store_ = nullptr;
    store_ = OpenStore(StoreOptionsOf(1, folder_.path() / "store.sqlite"));
  }
  void SetUp() override {
    Open();
    ASSERT_TRUE(store_->SaveBundle(BundleOf(1, 1, "one")));
    ASSERT_TRUE(store_->SaveBundle(BundleOf(2, 2, std::string(kBundlePartBytesMax + 5, '2'))));
  }

  TemporaryFolder folder_;
  std::unique_ptr<RecordStore> store_;
};

TEST_F(BundleShelfTest, KeepsBundlesAcrossARestart) {
  Open();
  const auto loaded = store_->LoadBundles();
  ASSERT_TRUE(loaded) << ToString(loaded.error());
  ASSERT_EQ(loaded->waiting_size(), 2);
  EXPECT_EQ(loaded->waiting(0).number(), 1u);
  EXPECT_EQ(loaded->waiting(0).made_ns(), 1001);
  EXPECT_EQ(loaded->waiting(0).bytes(), 3);
  EXPECT_EQ(loaded->waiting(1).hash(), 0xF000000000000002u);
  EXPECT_EQ(loaded->last_number(), 2u);
  EXPECT_EQ(CountOf(loaded->taken()), 2u);
  EXPECT_EQ(CountOf(loaded->acknowledged()), 0u);
}

TEST_F(BundleShelfTest, ReadsAFileInParts) {
  proto::ReadBundleRequest request;
  request.set_number(2);
  const auto first = store_->ReadBundle(request);
  ASSERT_TRUE(first) << ToString(first.error());
  EXPECT_EQ(first->part().size(), kBundlePartBytesMax);
  EXPECT_EQ(first->bundle().bytes(), kBundlePartBytesMax + 5);
  request.set_first_byte(kBundlePartBytesMax);
  EXPECT_EQ(store_->ReadBundle(request)->part(), "22222");
  request.set_first_byte(UINT64_MAX);
  EXPECT_EQ(store_->ReadBundle(request)->part(), "");
}

TEST_F(BundleShelfTest, AcknowledgingABundleRemovesItsFileAndKeepsItsHaveSet) {
  ASSERT_TRUE(store_->AcknowledgeBundle(2));
  ASSERT_TRUE(store_->AcknowledgeBundle(2)) << "again, since the first answer may be lost";
  ASSERT_TRUE(store_->AcknowledgeBundle(1));
  Open();
  const auto loaded = store_->LoadBundles();
  ASSERT_TRUE(loaded) << ToString(loaded.error());
  EXPECT_EQ(loaded->waiting_size(), 0);
  EXPECT_EQ(CountOf(loaded->acknowledged()), 2u);
  EXPECT_EQ(CountOf(loaded->taken()), 2u);
  EXPECT_EQ(loaded->last_number(), 2u);
  proto::ReadBundleRequest request;
  request.set_number(1);
  EXPECT_EQ(store_->ReadBundle(request).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->AcknowledgeBundle(3).error().code, ErrorCode::kNotFound);
  // One row holds the merged have-sets of all acknowledged bundles.
  EXPECT_EQ(*store_->database().Number("SELECT count(*) FROM downlink_bundle WHERE length(have) > 0"), 1);
}

TEST_F(BundleShelfTest, RefusesANumberThatWasUsedBefore) {
  EXPECT_EQ(store_->SaveBundle(BundleOf(2, 3, "x")).error().code, ErrorCode::kInvalid);
  ASSERT_TRUE(store_->AcknowledgeBundle(2));
  EXPECT_EQ(store_->SaveBundle(BundleOf(1, 3, "x")).error().code, ErrorCode::kInvalid);
}

TEST_F(BundleShelfTest, CountsRecordsOfAnUnreadableHaveSetAsNotTaken) {
  ASSERT_TRUE(store_->database().Execute("UPDATE downlink_bundle SET have = x'FF' WHERE number = 1"));
  const auto loaded = store_->LoadBundles();
  ASSERT_TRUE(loaded) << ToString(loaded.error());
  EXPECT_EQ(loaded->waiting_size(), 2);
  EXPECT_EQ(CountOf(loaded->taken()), 1u);
}

}  // namespace
}  // namespace moondb
