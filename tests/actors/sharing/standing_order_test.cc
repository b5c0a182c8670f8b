#include "actors/sharing/standing_order.h"

#include <gtest/gtest.h>

#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

using std::chrono::seconds;

using Window = SharingSession::Window;

class StandingOrderTest : public SessionFixture {};

TEST_F(StandingOrderTest, ReportsHowEachAgentsNewestOrderEnded) {
  const auto order = [this](std::uint64_t number, AgentId agent, std::uint64_t bytes_max = 0) {
    Take(session_.Order(proto::RecordFilter(), now_, bytes_max, {agent, number}));
  };
  order(41, kDestination);
  order(7, kSelf);
  source_.Insert(kSelf, proto::POWER, "a");
  AnswerHello();
  RunToEnd();
  order(42, kDestination);
  Take(session_.Close());
  const proto::ShareSession status = session_.Status(now_);
  ASSERT_EQ(status.orders_size(), 2);
  EXPECT_EQ(status.orders(0).agent(), kDestination);
  EXPECT_EQ(status.orders(0).ordered(), 42u);
  EXPECT_EQ(status.orders(0).completed(), 41u);
  EXPECT_EQ(status.orders(0).closed(), 42u);
  EXPECT_EQ(status.orders(1).agent(), kSelf);
  EXPECT_EQ(status.orders(1).completed(), 7u);
  EXPECT_EQ(status.orders(1).closed(), 0u) << "it had ended before";
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POWER, Noise(100));
  order(43, kDestination, /*bytes_max=*/1000);
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(session_.Status(now_).orders(0).limited(), 43u);
  EXPECT_EQ(session_.Status(now_).orders(0).completed(), 41u);
}

TEST_F(StandingOrderTest, AnOrderInAShutWindowWaitsForItToOpen) {
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Take(session_.SetWindow(Window::kShut, now_));
  Order();
  Take(session_.OnConnected(now_));
  EXPECT_FALSE(session_.deadline());
  Advance(seconds(100));
  EXPECT_TRUE(session_.is_open());
  EXPECT_TRUE(TakeSent().empty());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(StandingOrderTest, AcceptsAcknowledgmentsInAShutWindowAndResumesWhereItStopped) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  const auto first = TakeSent();
  ASSERT_GE(first.size(), 2u);
  Take(session_.SetWindow(Window::kShut, now_));
  Advance(seconds(100));
  for (const proto::Message& batch : first) Acknowledge(batch);
  proto::Refusal restarted;
  restarted.set_session_id(first[0].batch().session_id());
  restarted.mutable_error()->set_code(proto::ERROR_CODE_NOT_FOUND);
  Take(session_.OnRefusal(restarted, now_));
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
  const double acknowledged = Status().acknowledged_records();
  EXPECT_EQ(acknowledged, Status().sent_records());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().sent_records(), 300);
}

TEST_F(StandingOrderTest, CompletesInAShutWindowWhenAllIsAcknowledged) {
  Order();
  AnswerHello();
  const auto end = TakeSent();
  Take(session_.SetWindow(Window::kShut, now_));
  for (const proto::Message& batch : end) Acknowledge(batch);
  EXPECT_FALSE(session_.is_open());
  Take(session_.SetWindow(Window::kOpen, now_));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(StandingOrderTest, OnlyStatesPassAWindowForStates) {
  source_.Insert(kSelf, proto::POWER, "p");
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  Order();
  AnswerHello();
  auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].data_type(), static_cast<std::uint32_t>(proto::POWER));
  EXPECT_EQ(batches[0].batch().record_count(), 1u);
  EXPECT_GT(batches[0].remaining(), 0u) << "it is not the end of the order";
  EXPECT_TRUE(session_.is_open());
  EXPECT_FALSE(session_.deadline());
  Acknowledge(batches[0]);  // The acknowledgment arrives twice.
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());

  // There are no new states, so the order leads to a Hello but to no batch.
  Order();
  AnswerHello();
  EXPECT_TRUE(TakeSent().empty());

  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  batches = RunToEnd();
  EXPECT_EQ(batches.back().remaining(), 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().sent_records(), 101);
}

TEST_F(StandingOrderTest, TheStartOfADriveStopsStatesTooUntilTheNextOrder) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  TakeSent();
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  EXPECT_TRUE(TakeSent().empty());
  source_.Insert(kSelf, proto::MODE, "m");
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].data_type(), static_cast<std::uint32_t>(proto::MODE));
  Take(session_.SetWindow(Window::kShut, now_));
  Acknowledge(sent[0]);
  EXPECT_TRUE(session_.is_open()) << "what is not a state was not sent";
  EXPECT_TRUE(TakeSent().empty());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(StandingOrderTest, AsksForStatesOnlyInAWindowForStates) {
  proto::RecordFilter filter;
  filter.add_origin_agents(kSelf);
  filter.add_data_types(proto::POWER);
  filter.add_data_types(proto::POSE_GRAPH_NODE);
  filter.set_own_records_of(kDestination);
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  Take(session_.Order(filter, now_));
  AnswerHello();
  proto::RecordFilter states;
  states.add_origin_agents(kSelf);
  states.add_data_types(proto::POWER);
  EXPECT_EQ(asked_for_.DebugString(), states.DebugString());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  EXPECT_EQ(asked_for_.DebugString(), filter.DebugString());
}

TEST_F(StandingOrderTest, AnOrderWithoutStatesWaitsInAWindowForStates) {
  source_.Insert(kSelf, proto::POWER, "p");
  proto::RecordFilter filter;
  filter.add_data_types(proto::POSE_GRAPH_NODE);
  filter.set_own_records_of(kDestination);
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  Take(session_.Order(filter, now_));
  EXPECT_TRUE(session_.is_open());
  EXPECT_TRUE(TakeSent().empty());
}

// The first order covers only kSelf's records, so the session requests only kSelf's streams of the destination's
// have-set. The destination also holds all records of agent kSelf + 1, which the session must not send.
TEST_F(StandingOrderTest, AsksOnlyForTheOriginsInItsFilterAndAgainForOthers) {
  for (int i = 0; i < 20; ++i) {
    const RecordKey other = source_.Insert(kSelf + 1, proto::POSE_GRAPH_NODE, Noise(60));
    destination_.Insert(kSelf + 1, proto::POSE_GRAPH_NODE, source_.records().at(other));
    source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
  }
  proto::RecordFilter own;
  own.add_origin_agents(kSelf);
  Take(session_.Order(own, now_));
  ASSERT_EQ(sent_.size(), 1u);
  ASSERT_EQ(sent_[0].hello().origin_agents_size(), 1);
  EXPECT_EQ(sent_[0].hello().origin_agents(0), kSelf);
  proto::Have have;
  have.set_session_id(TakeHello());
  have.set_is_whole(true);
  have.set_unacked_bytes_max(8 * 1024);
  Take(session_.OnHave(have, now_));
  // Extends the order to all origins while the first batch is in flight.
  Take(session_.Order(proto::RecordFilter(), now_));
  EXPECT_TRUE(sent_.back().has_hello());
  EXPECT_EQ(sent_.back().hello().origin_agents_size(), 0);
  AnswerHello();
  for (const auto& message : RunToEnd()) {
    const proto::Batch& batch = message.batch();
    const auto records = DecodeBatch(batch.codec(), batch.coded(), batch.record_count());
    for (const proto::StoredRecord& record : records->records()) EXPECT_EQ(record.key().origin_agent(), kSelf);
  }
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(StandingOrderTest, ALimitedOrderEndsWhenItsBytesAreUsedUp) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/10'000));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().completed_sessions(), 0);
  EXPECT_EQ(Status().closed_sessions(), 0);
  EXPECT_EQ(Status().limited_sessions(), 1);
  EXPECT_GE(Status().coded_bytes(), 10'000);
  EXPECT_LE(Status().coded_bytes(), 10'000 + 1200);
  EXPECT_EQ(Status().acknowledged_records(), Status().sent_records());
  EXPECT_NE(Status().last_error().find("its order's byte limit"), std::string::npos) << Status().last_error();

  // The remaining records fit into the limit.
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/1'000'000));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_EQ(Status().sent_records(), 300);
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(StandingOrderTest, ALimitDoesNotNarrowAnOpenOrderWithoutOne) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/1'000));
  RunToEnd();
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(StandingOrderTest, ALimitAppliesToRecordsInFragmentsToo) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(30'000));
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/10'000));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_LE(Status().coded_bytes(), 10'000 + 1200);
  Order();
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_LT(Status().coded_bytes(), 33'000) << "it goes on where it ended";
}

TEST_F(StandingOrderTest, LeavesOutTypesThatTheDestinationDefinesDifferently) {
  schemas_ = SchemasOf({});
  for (proto::TypeSchema& schema : schemas_) {
    if (schema.data_type() == proto::MODE) schema.set_hash(schema.hash() + 1);
  }
  source_.Insert(kSelf, proto::MODE, "m");
  Order();
  AnswerHello();
  RunToEnd();
  ASSERT_EQ(asked_for_.not_data_types_size(), 1);
  EXPECT_EQ(asked_for_.not_data_types(0), static_cast<std::uint32_t>(proto::MODE));
  EXPECT_EQ(Status().other_schema_types_size(), 1);
  // The destination no longer reports a different schema.
  schemas_.Clear();
  Order();
  AnswerHello();
  EXPECT_TRUE(asked_for_.not_data_types().empty());
  EXPECT_TRUE(Status().other_schema_types().empty());
}

TEST_F(StandingOrderTest, SendsPeriodicStatesWithoutCountingOrReportingAnEnd) {
  source_.Insert(kSelf, proto::POWER, "p");
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));
  EXPECT_TRUE(Status().is_periodic());
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].data_type(), static_cast<std::uint32_t>(proto::POWER));
  EXPECT_GT(batches[0].remaining(), 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().completed_sessions() + Status().closed_sessions(), 0);

  Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));  // There are no new records.
  AnswerHello();
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_FALSE(session_.is_open());
}

TEST_F(StandingOrderTest, AnOrderReplacesPeriodicStatesAndKeepsItsOwnLimit) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  source_.Insert(kSelf, proto::POWER, "p");
  Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));
  AnswerHello();
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/10'000));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().limited_sessions(), 1);
  EXPECT_EQ(Status().closed_sessions(), 0);
  EXPECT_LE(Status().coded_bytes(), 10'000 + 1300);
  const std::string error = Status().last_error();
  EXPECT_FALSE(error.empty());
  Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));
  EXPECT_EQ(Status().last_error(), error) << "the order's end is still to be seen";
}

TEST_F(StandingOrderTest, RecordsWithoutAnOrderIncludeThoseStoredMeanwhile) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.SharePeriodic(proto::RecordFilter(), /*is_for_states=*/false, now_));
  EXPECT_TRUE(Status().is_periodic());
  AnswerHello();
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().completed_sessions() + Status().closed_sessions(), 0);
}

TEST_F(StandingOrderTest, RecordsWithoutAnOrderWaitWhileOnlyStatesPass) {
  source_.Insert(kSelf, proto::POWER, "p");
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  Take(session_.SharePeriodic(proto::RecordFilter(), /*is_for_states=*/false, now_));
  EXPECT_TRUE(TakeSent().empty());
  Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].data_type(), static_cast<std::uint32_t>(proto::POWER));
}

TEST_F(StandingOrderTest, AllRecordsTakeThePlaceOfPeriodicStates) {
  source_.Insert(kSelf, proto::POWER, "p");
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));
  Take(session_.SharePeriodic(proto::RecordFilter(), /*is_for_states=*/false, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(StandingOrderTest, AnOrderReplacesRecordsWithoutAnOrderAndKeepsItsOwnLimit) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.SharePeriodic(proto::RecordFilter(), /*is_for_states=*/false, now_));
  AnswerHello();
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/10'000));
  const double before = Status().coded_bytes();
  RunToEnd();
  EXPECT_EQ(Status().limited_sessions(), 1);
  EXPECT_LE(Status().coded_bytes() - before, 10'000 + 1300);
}

TEST_F(StandingOrderTest, RemindersNeitherDelayNorExtendAnOrder) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/30'000));
  AnswerHello();
  while (!sent_.empty()) {
    for (const proto::Message& message : TakeSent()) {
      Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));
      Acknowledge(message);
      if (session_.is_open()) Take(session_.SharePeriodic(proto::RecordFilter(), /*is_for_states=*/false, now_));
    }
  }
  EXPECT_FALSE(session_.is_ordered());
  EXPECT_EQ(Status().limited_sessions(), 1);
  EXPECT_LE(Status().coded_bytes(), 30'000 + 1300);
}

TEST_F(StandingOrderTest, PeriodicStatesWaitForAShutWindowWithoutCountingResends) {
  source_.Insert(kSelf, proto::POWER, "p");
  Take(session_.SetWindow(Window::kShut, now_));
  for (int i = 0; i < 10; ++i) Take(session_.SharePeriodic(States(), /*is_for_states=*/true, now_));
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_EQ(Status().resends(), 0);
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(StandingOrderTest, CoversOnlyTheStatesOfItsFilterInAWindowForStates) {
  StandingOrder order({proto::POWER, proto::MODE}, /*first_mark=*/1);
  proto::RecordFilter filter;
  filter.add_origin_agents(kSelf);
  filter.add_data_types(proto::POWER);
  filter.add_data_types(proto::POSE_GRAPH_NODE);
  filter.set_own_records_of(kDestination);
  order.Set(filter, 0, {}, /*is_added=*/false);
  order.SetOtherSchemaTypes({proto::POSE_GRAPH_EDGE});
  order.StartOver();
  EXPECT_FALSE(order.is_for_states());
  EXPECT_EQ(order.Meant().data_types_size(), 2);
  EXPECT_EQ(order.Meant().not_data_types(0), static_cast<std::uint32_t>(proto::POSE_GRAPH_EDGE));

  EXPECT_TRUE(order.SetWindow(Window::kStatesOnly));
  EXPECT_FALSE(order.SetWindow(Window::kStatesOnly)) << "it is no change";
  EXPECT_TRUE(order.is_waiting()) << "the states, too, until it looks again";
  order.EvaluateAgain();
  EXPECT_FALSE(order.is_waiting());
  order.StartOver();
  EXPECT_TRUE(order.is_for_states());
  ASSERT_EQ(order.Meant().data_types_size(), 1);
  EXPECT_EQ(order.Meant().data_types(0), static_cast<std::uint32_t>(proto::POWER));
  EXPECT_EQ(order.Meant().own_records_of(), 0u);
  EXPECT_FALSE(order.NeedsNewStart());
  EXPECT_TRUE(order.SetWindow(Window::kOpen));
  EXPECT_TRUE(order.NeedsNewStart()) << "more may pass";
}

TEST_F(StandingOrderTest, NeedsARestartForStreamsThatTheDestinationWasNotAskedAbout) {
  StandingOrder order({}, /*first_mark=*/1);
  proto::Hello hello;
  proto::RecordFilter own;
  own.add_origin_agents(kSelf);
  order.Set(own, 0, {}, /*is_added=*/false);
  order.FillRequest(hello);
  EXPECT_FALSE(order.NeedsNewStart());
  own.add_everyones_types(proto::MAP_QUARANTINE);
  order.Set(own, 0, {}, /*is_added=*/true);
  EXPECT_TRUE(order.NeedsNewStart());
  order.FillRequest(hello);
  EXPECT_FALSE(order.NeedsNewStart());
  order.Set(proto::RecordFilter(), 0, {}, /*is_added=*/true);
  EXPECT_TRUE(order.NeedsNewStart());
  order.FillRequest(hello);
  EXPECT_EQ(hello.origin_agents_size(), 0);
  order.Set(own, 0, {}, /*is_added=*/true);
  EXPECT_FALSE(order.NeedsNewStart()) << "it was asked about all";
}

TEST_F(StandingOrderTest, KeepsALimitOnlyIfTheOpenOrderHasOne) {
  StandingOrder order({}, /*first_mark=*/1);
  order.Set({}, 1000, {}, /*is_added=*/false);
  order.SpendBytes(400);
  EXPECT_EQ(order.bytes_left(), 600u);
  order.SpendBytes(1000);
  EXPECT_TRUE(order.is_used_up());
  order.Set({}, 2000, {}, /*is_added=*/true);
  EXPECT_EQ(order.bytes_left(), 2000u);
  order.Set({}, 0, {}, /*is_added=*/true);
  order.Set({}, 3000, {}, /*is_added=*/true);
  EXPECT_FALSE(order.bytes_left());
  EXPECT_FALSE(order.is_used_up());
}

}  // namespace
}  // namespace moondb
