#include "runtime/derived_reader.h"

#include <gmock/gmock.h>

#include "model/record_check.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

using simulation::SimulatedTeam;
using testing::ElementsAre;

// Rover 1 leads and rover 2 is the designated survivor.
RoleChain::Options FirstRoles() {
  RoleChain::Options options;
  options.initial.set_leader(1);
  options.initial.set_survivor(2);
  options.may_command = [](AgentId) { return false; };
  return options;
}

// Rover 2 makes itself the leader.
proto::RoleAssignment SecondRoles() {
  proto::RoleAssignment roles = RoleChain::Next(FirstRoles().initial, /*is_command=*/false);
  roles.mutable_term()->set_issuer(2);
  roles.set_leader(2);
  roles.set_survivor(3);
  roles.set_signature("signed");
  return roles;
}

// An actor that reads optimized poses. The test answers in storage's place.
class DerivedReaderTest : public testing::Test {
 protected:
  static constexpr AgentId kSelf = 1;
  static inline const Address kStorage{kSelf, actor_name::kStorage};
  static inline const Address kReader{kSelf, "reader"};

  DerivedReaderTest() {
    team_.AddAgent(kSelf);
    team_.Spawn(kSelf, kReader.actor, OnEachMessage([this](Context& context, const proto::Message& message) {
                  if (message.custom().value() == "report") return reader_.Report(context, *report_without_room_);
                  if (message.has_custom()) return reader_.Read(context);
                  if (reader_.OnMessage(context, message)) return;
                  if (message.has_records_stored()) reader_.OnRecordsStored(message.records_stored());
                }));
  }

  // A pose that rover 2 wrote as the leader.
  static proto::Record PoseOf(std::uint64_t index) {
    proto::Record record;
    record.mutable_optimized_pose()->mutable_node()->set_index(index);
    *record.mutable_optimized_pose()->mutable_term() = SecondRoles().term();
    return record;
  }
  static proto::Record Assignment() {
    proto::Record record;
    *record.mutable_role_assignment() = SecondRoles();
    return record;
  }

  void Post(const Address& from, proto::Message message) {
    ASSERT_EQ(team_.Post(from, kReader, std::move(message)), SendResult::kAccepted);
    team_.RunUntilIdle();
  }
  // Answers the reader's questions with the rows behind the asked one, until it asks no more.
  void Serve() {
    for (auto asked = team_.TakeMessages(kStorage); !asked.empty(); asked = team_.TakeMessages(kStorage)) {
      for (const proto::Message& question : asked) {
        if (question.has_left_out_report()) ++reports_;
        if (!question.has_read_request()) continue;
        proto::Message answer;
        answer.set_request_id(question.request_id());
        answer.mutable_read_reply()->set_is_complete(true);
        for (std::uint64_t row = question.read_request().after_row_id() + 1; row <= rows_.size(); ++row) {
          proto::StoredRecord& stored = *answer.mutable_read_reply()->add_records();
          const proto::Record& record = rows_[row - 1];
          *stored.mutable_key() = ToProto(RecordKey{{2, 9, TypeOf(record)}, row});
          stored.set_content(record.SerializeAsString());
          answer.mutable_read_reply()->add_row_ids(row);
        }
        Post(kStorage, std::move(answer));
      }
    }
  }
  void Read() {
    proto::Message order;
    order.mutable_custom();
    Post({kSelf, "test"}, order);
    Serve();
    if (!report_without_room_) return;
    order.mutable_custom()->set_value("report");
    Post({kSelf, "test"}, std::move(order));
    Serve();
  }

  static RecordReader::Options ReaderOptions() {
    RecordReader::Options options;
    options.data_types = {proto::OPTIMIZED_POSE, proto::ROLE_ASSIGNMENT};
    return options;
  }

  std::vector<proto::Record> rows_;
  std::vector<std::uint64_t> taken_;  // Indices of the poses that were taken.
  int forgotten_ = 0;
  int reports_ = 0;
  std::optional<std::map<AgentId, std::uint64_t>> report_without_room_;  // Reported after each reading.
  DerivedReader reader_{FirstRoles(), ReaderOptions(),
                        [this] {
                          ++forgotten_;
                          taken_.clear();
                        },
                        [this](const RecordKey&, const proto::Record& record) {
                          if (record.has_optimized_pose()) taken_.push_back(record.optimized_pose().node().index());
                        }};
  SimulatedTeam team_{/*seed=*/1};
};

TEST_F(DerivedReaderTest, ReadsNewRecordsOnce) {
  rows_ = {Assignment(), PoseOf(1)};
  Read();
  EXPECT_THAT(taken_, ElementsAre(1));
  rows_.push_back(PoseOf(1));
  Read();
  EXPECT_THAT(taken_, ElementsAre(1, 1));
  EXPECT_EQ(forgotten_, 0);
  EXPECT_FALSE(reader_.is_reading());
}

TEST_F(DerivedReaderTest, ReadsAllAgainAfterRecordsWerePruned) {
  rows_ = {Assignment(), PoseOf(1), PoseOf(1)};
  Read();
  EXPECT_THAT(taken_, ElementsAre(1, 1));
  proto::Message news;
  news.mutable_records_stored()->set_is_pruned(true);
  Post(kStorage, std::move(news));
  rows_.pop_back();
  Read();
  EXPECT_EQ(forgotten_, 1);
  EXPECT_THAT(taken_, ElementsAre(1));
}

TEST_F(DerivedReaderTest, ReadsAllAgainOnceAnAssignmentMakesARecordValid) {
  rows_ = {PoseOf(1)};
  Read();
  EXPECT_TRUE(taken_.empty()) << "nobody led in this term";
  rows_.push_back(Assignment());
  Read();
  EXPECT_EQ(forgotten_, 1);
  EXPECT_THAT(taken_, ElementsAre(1));
}

TEST_F(DerivedReaderTest, ReportsTheRecordsThatDoNotCountOnce) {
  rows_ = {PoseOf(1)};
  Read();
  report_without_room_.emplace();
  (*report_without_room_)[3] = 5;
  Read();
  EXPECT_EQ(reports_, 1);
  Read();
  EXPECT_EQ(reports_, 1) << "unchanged";
}

}  // namespace
}  // namespace moondb
