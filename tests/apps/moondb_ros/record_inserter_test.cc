#include "apps/moondb_ros/record_inserter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using testing::HasSubstr;

// An agent that stores records, or fails as the test orders.
class RecordInserterTest : public testing::Test {
 protected:
  static RobotMapper::Made NodeWithMap(std::uint64_t index) {
    RobotMapper::Made made;
    proto::Record& node = made.records.emplace_back();
    node.set_timestamp_ns(static_cast<std::int64_t>(index) * 1'000'000'000);
    node.mutable_pose_graph_node()->mutable_node()->set_index(index);
    made.records.emplace_back().mutable_local_traversability_map();
    return made;
  }

  Result<void> Insert(std::uint64_t index) {
    return inserter_.Insert(NodeWithMap(index),
                            {[this](const std::vector<proto::Record>& records) { return Store(records); },
                             [this] { return Result<std::optional<RobotMapper::Stored>>(newest_); }});
  }

  Result<void> Store(const std::vector<proto::Record>& records) {
    const bool has_map = records.back().has_local_traversability_map();
    if (has_map && map_error_) return tl::unexpected(*map_error_);
    if (error_ && !is_stored_despite_error_) return tl::unexpected(*error_);
    newest_ =
        RobotMapper::Stored{records.front().pose_graph_node().node().index(), records.front().timestamp_ns(), {}, {}};
    ++insert_count_;
    map_count_ += has_map;
    if (error_) return tl::unexpected(*error_);
    return {};
  }

  std::optional<Error> error_;      // The answer to all records.
  std::optional<Error> map_error_;  // The answer to records with a map.
  bool is_stored_despite_error_ = false;
  std::optional<RobotMapper::Stored> newest_;
  int insert_count_ = 0;
  int map_count_ = 0;
  std::vector<std::string> lines_;
  RecordInserter inserter_{[this](const std::string& line) { lines_.push_back(line); }};
};

TEST_F(RecordInserterTest, ANodeForWhoseMapThereIsNoRoomIsStoredWithoutIt) {
  map_error_ = Error{ErrorCode::kFull, "the disk is nearly full", ""};
  ASSERT_TRUE(Insert(0));
  ASSERT_TRUE(Insert(1));
  EXPECT_EQ(newest_->index, 1u);
  EXPECT_EQ(map_count_, 0);
  ASSERT_EQ(lines_.size(), 1u);  // Once, and not for each node.
  EXPECT_THAT(lines_.front(), HasSubstr("the disk is nearly full"));
  map_error_.reset();
  ASSERT_TRUE(Insert(2));
  EXPECT_EQ(map_count_, 1);
}

TEST_F(RecordInserterTest, ANodeWhoseMapIsRefusedIsStoredWithoutIt) {
  map_error_ = Error{ErrorCode::kInvalid, "too many layers", ""};
  ASSERT_TRUE(Insert(0));
  EXPECT_EQ(newest_->index, 0u);
  EXPECT_THAT(lines_.front(), HasSubstr("too many layers"));
}

TEST_F(RecordInserterTest, ARefusedNodeIsAnError) {
  error_ = Error{ErrorCode::kInvalid, "node 0 exists with other content", ""};
  EXPECT_EQ(Insert(0).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(insert_count_, 0);
  EXPECT_TRUE(lines_.empty());
}

TEST_F(RecordInserterTest, AFullStoreKeepsTheNodeWaiting) {
  error_ = Error{ErrorCode::kFull, "no room", ""};
  EXPECT_EQ(Insert(0).error().code, ErrorCode::kFull);
  error_.reset();
  EXPECT_TRUE(Insert(0));
  EXPECT_EQ(map_count_, 1);
}

TEST_F(RecordInserterTest, ANodeThatWasStoredWithoutAnAnswerIsNotInsertedTwice) {
  error_ = Error{ErrorCode::kTimedOut, "no answer", ""};
  is_stored_despite_error_ = true;
  EXPECT_EQ(Insert(0).error().code, ErrorCode::kTimedOut);
  error_.reset();
  EXPECT_TRUE(Insert(0));
  EXPECT_EQ(insert_count_, 1);
  EXPECT_TRUE(Insert(1));
  EXPECT_EQ(insert_count_, 2);
}

}  // namespace
}  // namespace moondb
