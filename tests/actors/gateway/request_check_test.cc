#include "actors/gateway/request_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "actors/gateway/command_table.h"
#include "model/term.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

proto::TeamConfig Team() {
  proto::TeamConfig team;
  team.set_team("test");
  for (const std::uint32_t id : {1, 2, 3}) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(id);
    agent.set_name("rover" + std::to_string(id));
  }
  return team;
}

// Returns the field that CheckRequest's error names, or "ok" if there is no error.
std::string FieldOf(const proto::ControlRequest& request) {
  const auto checked = CheckRequest(Team(), /*self=*/1, request);
  if (checked) return "ok";
  EXPECT_EQ(checked.error().code, ErrorCode::kInvalid);
  EXPECT_FALSE(checked.error().text.empty());
  return checked.error().field;
}

TEST(RequestCheckTest, RefusesAnEmptyRequest) { EXPECT_EQ(FieldOf({}), "request"); }

TEST(RequestCheckTest, NamesTheRecordWhoseAgentIsNotInTheTeam) {
  proto::ControlRequest request;
  EXPECT_EQ((request.mutable_insert(), FieldOf(request)), "insert.records");
  request.mutable_insert()->add_records()->mutable_temperature();
  EXPECT_EQ(FieldOf(request), "ok");
  auto* node = request.mutable_insert()->add_records()->mutable_pose_graph_node()->mutable_node();
  node->set_agent_id(9);
  EXPECT_EQ(FieldOf(request), "insert.records[1].pose_graph_node.node.agent_id");
  node->set_agent_id(3);
  EXPECT_EQ(FieldOf(request), "ok");
  auto* edge = request.mutable_insert()->add_records()->mutable_pose_graph_edge();
  edge->mutable_from()->set_agent_id(1);
  EXPECT_EQ(FieldOf(request), "insert.records[2].pose_graph_edge.to.agent_id");
}

TEST(RequestCheckTest, RefusesRequestsForAnAgentThatHasLeftButAcceptsItsRecords) {
  proto::TeamConfig team = Team();
  team.mutable_agents(1)->set_left(true);
  proto::ControlRequest request;
  auto* node = request.mutable_insert()->add_records()->mutable_pose_graph_node()->mutable_node();
  node->set_agent_id(2);
  EXPECT_TRUE(CheckForAgent(team, request));
  request.set_for_agent(3);
  EXPECT_TRUE(CheckForAgent(team, request));
  request.set_for_agent(2);
  const Result<void> refused = CheckForAgent(team, request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_EQ(ToString(refused.error()), "for_agent: agent 2 has left the team");
}

TEST(RequestCheckTest, ChecksTheExpectedRolesOfARequest) {
  proto::ControlRequest request;
  request.mutable_role_set()->set_is_swap(true);
  proto::RoleAssignment& expected = *request.mutable_role_set()->mutable_expected();
  EXPECT_EQ(FieldOf(request), "ok");
  expected.mutable_term()->set_issuer(9);
  EXPECT_EQ(FieldOf(request), "role_set.expected.term.issuer");
  expected.mutable_term()->set_issuer(3);
  expected.mutable_term()->set_number(kTermNumberMax + 1);
  EXPECT_EQ(FieldOf(request), "role_set.expected.term.number");
  expected.mutable_term()->set_number(7);
  expected.set_leader(9);
  EXPECT_EQ(FieldOf(request), "role_set.expected.leader");
  expected.set_leader(1);
  expected.set_survivor(9);
  EXPECT_EQ(FieldOf(request), "role_set.expected.survivor");
  expected.set_survivor(2);
  EXPECT_EQ(FieldOf(request), "ok");
}

TEST(RequestCheckTest, ChecksTheExpectedTermOfAnOrder) {
  proto::ControlRequest request;
  request.mutable_share()->set_kind(proto::SHARING_KIND_SYNC);
  request.mutable_share()->mutable_expected_term()->set_issuer(9);
  EXPECT_EQ(FieldOf(request), "share.expected_term.issuer");
  request.mutable_share()->mutable_expected_term()->set_issuer(2);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_share()->set_order(5);
  EXPECT_EQ(FieldOf(request), "share.order");
}

TEST(RequestCheckTest, BoundsHowLongAReadWaits) {
  proto::ControlRequest request;
  request.mutable_read()->set_wait_s(60);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_read()->set_is_newest_first(true);
  EXPECT_EQ(FieldOf(request), "read.wait_s");
  for (const double bad : {-1., 60.5, std::nan("")}) {
    request.mutable_read()->set_wait_s(bad);
    EXPECT_EQ(FieldOf(request), "read.wait_s") << bad;
  }
}

TEST(RequestCheckTest, RequiresTheTimestampOfAFindingInAnAcknowledgment) {
  proto::ControlRequest request;
  request.mutable_acknowledge();
  EXPECT_EQ(FieldOf(request), "ok") << "refused commands have no timestamp";
  request.mutable_acknowledge()->set_until_ns(-5);
  EXPECT_EQ(FieldOf(request), "acknowledge.until_ns");
  request.mutable_acknowledge()->set_until_ns(5);
  EXPECT_EQ(FieldOf(request), "ok");
}

TEST(RequestCheckTest, RefusesAReadThatWaitsForHistory) {
  proto::ControlRequest request;
  request.mutable_read()->set_is_history(true);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_read()->set_wait_s(1);
  EXPECT_EQ(FieldOf(request), "read.wait_s");
}

TEST(RequestCheckTest, RefusesAReadFromALaterToAnEarlierTime) {
  proto::ControlRequest request;
  request.mutable_read()->set_from_ns(INT64_MIN);
  request.mutable_read()->set_to_ns(INT64_MAX);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_read()->set_from_ns(5);
  request.mutable_read()->set_to_ns(5);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_read()->set_to_ns(4);
  EXPECT_EQ(FieldOf(request), "read.from_ns");
}

TEST(RequestCheckTest, RefusesAReadOfTooManyKeysOrOfKeysAndConditions) {
  proto::ControlRequest request;
  for (int i = 0; i < kFilterEntriesMax; ++i) request.mutable_read()->add_keys();
  EXPECT_EQ(FieldOf(request), "ok");
  proto::ControlRequest bad = request;
  for (int i = 0; i < 10'000; ++i) bad.mutable_read()->add_keys();
  EXPECT_EQ(FieldOf(bad), "read.keys");
  const auto refused = [&request](auto set) {
    proto::ControlRequest other = request;
    set(*other.mutable_read());
    return FieldOf(other) == "read.keys";
  };
  EXPECT_TRUE(refused([](proto::ReadRequest& read) { read.add_data_types(1); }));
  EXPECT_TRUE(refused([](proto::ReadRequest& read) { read.add_origin_agents(1); }));
  EXPECT_TRUE(refused([](proto::ReadRequest& read) { read.set_from_ns(0); }));
  EXPECT_TRUE(refused([](proto::ReadRequest& read) { read.set_to_ns(0); }));
  EXPECT_TRUE(refused([](proto::ReadRequest& read) { read.set_is_newest_first(true); }));
  EXPECT_TRUE(refused([](proto::ReadRequest& read) { read.set_is_history(true); }));
  EXPECT_TRUE(refused([](proto::ReadRequest& read) { read.set_wait_s(1); }));
  EXPECT_FALSE(refused([](proto::ReadRequest& read) { read.set_after_row_id(5); }));
}

TEST(RequestCheckTest, RefusesInvalidPrunes) {
  proto::ControlRequest request;
  proto::PruneOrder& prune = *request.mutable_prune();
  EXPECT_EQ(FieldOf(request), "ok");
  prune.set_older_than_s(-1);
  EXPECT_EQ(FieldOf(request), "prune.older_than_s");
  prune.set_older_than_s(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(FieldOf(request), "prune.older_than_s");
  prune.set_older_than_s(60);
  prune.set_content_bytes_max(std::numeric_limits<double>::infinity());
  EXPECT_EQ(FieldOf(request), "prune.content_bytes_max");
  prune.set_content_bytes_max(1e6);
  prune.set_occluded_maps(true);
  EXPECT_EQ(FieldOf(request), "ok");
  prune.set_is_history(true);
  EXPECT_EQ(FieldOf(request), "prune.is_history");
  prune.set_is_history(false);
  prune.add_data_types(proto::LOCAL_TRAVERSABILITY_MAP);
  EXPECT_EQ(FieldOf(request), "prune.data_types");
  prune.set_occluded_maps(false);
  EXPECT_EQ(FieldOf(request), "ok");
  for (int i = 0; i < kFilterEntriesMax; ++i) prune.add_data_types(1);
  EXPECT_EQ(FieldOf(request), "prune.data_types");
}

TEST(RequestCheckTest, RefusesEventsInsertedByClients) {
  proto::ControlRequest request;
  request.mutable_insert()->add_records()->mutable_agent_event()->set_text("role swap");
  EXPECT_EQ(FieldOf(request), "insert.records[0].agent_event");
}

TEST(RequestCheckTest, RefusesRecordsThatOnlyTheLeaderDerives) {
  proto::ControlRequest request;
  request.mutable_insert()->add_records()->mutable_optimized_pose();
  EXPECT_EQ(FieldOf(request), "insert.records[0].optimized_pose");
  request.mutable_insert()->mutable_records(0)->mutable_edge_verdict();
  EXPECT_EQ(FieldOf(request), "insert.records[0].edge_verdict");
  request.mutable_insert()->mutable_records(0)->mutable_map_match();
  EXPECT_EQ(FieldOf(request), "insert.records[0].map_match");
}

TEST(RequestCheckTest, RefusesImplausibleMeasurements) {
  proto::ControlRequest request;
  proto::Record& record = *request.mutable_insert()->add_records();
  record.mutable_temperature()->set_celsius(-274);
  EXPECT_EQ(FieldOf(request), "insert.records[0].temperature.celsius");
  record.mutable_temperature()->set_celsius(-273);
  EXPECT_EQ(FieldOf(request), "ok");

  proto::PoseGraphNode& node = *record.mutable_pose_graph_node();
  node.mutable_node()->set_agent_id(1);
  node.mutable_map_from_node()->mutable_orientation()->set_w(2);
  EXPECT_EQ(FieldOf(request), "insert.records[0].pose_graph_node.map_from_node.orientation");
  node.mutable_map_from_node()->mutable_orientation()->set_w(0.999);
  EXPECT_EQ(FieldOf(request), "ok") << "rounded";
  node.mutable_map_from_node()->mutable_position_m()->set_x(1e12);
  EXPECT_EQ(FieldOf(request), "insert.records[0].pose_graph_node.map_from_node.position_m");

  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  edge.mutable_from()->set_agent_id(1);
  edge.mutable_to()->set_agent_id(1);
  edge.mutable_relative_pose()->mutable_from_from_to()->mutable_orientation()->set_z(-1.5);
  EXPECT_EQ(FieldOf(request), "insert.records[0].pose_graph_edge.relative_pose.from_from_to.orientation");

  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  map.mutable_node()->set_agent_id(1);
  map.mutable_node_from_map()->mutable_orientation()->set_w(0.5);
  EXPECT_EQ(FieldOf(request), "insert.records[0].local_traversability_map.node_from_map.orientation");
}

TEST(RequestCheckTest, BoundsTheRecordsOfOneInsert) {
  proto::ControlRequest request;
  for (int i = 0; i <= kClientInsertRecordsMax; ++i) request.mutable_insert()->add_records()->mutable_temperature();
  EXPECT_EQ(FieldOf(request), "insert.records");
}

TEST(RequestCheckTest, RefusesRoleChangesThatChangeNothingOrNameUnknownAgents) {
  proto::ControlRequest request;
  EXPECT_EQ((request.mutable_role_set(), FieldOf(request)), "role_set");
  request.mutable_role_set()->set_leader(4);
  EXPECT_EQ(FieldOf(request), "role_set.leader");
  request.mutable_role_set()->set_leader(2);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_role_set()->set_survivor(70000);
  EXPECT_EQ(FieldOf(request), "role_set.survivor");
  request.mutable_role_set()->set_survivor(3);
  request.mutable_role_set()->set_reason(std::string(kRoleReasonBytesMax + 1, 'x'));
  EXPECT_EQ(FieldOf(request), "role_set.reason");
}

TEST(RequestCheckTest, RefusesAWindowFromScratchAndCovariancesOfUnknownOrTooManyNodes) {
  proto::ControlRequest request;
  proto::OptimizeRequest& optimize = *request.mutable_optimize();
  EXPECT_EQ(FieldOf(request), "ok");
  optimize.set_window_nodes(10);
  EXPECT_EQ(FieldOf(request), "ok");
  optimize.set_from_scratch(true);
  EXPECT_EQ(FieldOf(request), "optimize.window_nodes");
  optimize.Clear();
  optimize.add_covariance_of()->set_agent_id(99);
  EXPECT_EQ(FieldOf(request), "optimize.covariance_of[0].agent_id");
  optimize.Clear();
  for (int i = 0; i <= kCovariancesMax; ++i) optimize.add_covariance_of()->set_agent_id(1);
  EXPECT_EQ(FieldOf(request), "optimize.covariance_of");
}

TEST(RequestCheckTest, RefusesToShareWithItselfOrUnknownAgents) {
  proto::ControlRequest request;
  EXPECT_EQ((request.mutable_share(), FieldOf(request)), "share.kind");
  request.mutable_share()->set_kind(proto::SHARING_KIND_SYNC);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_share()->set_destination(1);
  EXPECT_EQ(FieldOf(request), "share.destination");
  request.mutable_share()->set_destination(2);
  request.mutable_share()->add_from_agents(8);
  EXPECT_EQ(FieldOf(request), "share.from_agents[0]");
}

TEST(RequestCheckTest, NamesTheInvalidFieldOfAQuestionAboutTheMap) {
  proto::ControlRequest request;
  request.mutable_map_why()->set_y_m(-5);
  EXPECT_EQ(FieldOf(request), "ok");
  request.mutable_map_why()->set_y_m(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(FieldOf(request), "map_why.y_m");
  EXPECT_EQ((request.mutable_map_stats(), FieldOf(request)), "ok");
  proto::MapTilesRequest& tiles = *request.mutable_map_tiles();
  EXPECT_EQ(FieldOf(request), "ok");
  tiles.set_wait_s(61);
  EXPECT_EQ(FieldOf(request), "map_tiles.wait_s");
  tiles.set_wait_s(60);
  tiles.mutable_region()->set_x_max_m(4);
  EXPECT_EQ(FieldOf(request), "ok");
  tiles.mutable_region()->set_x_min_m(5);
  EXPECT_EQ(FieldOf(request), "map_tiles.region");
  tiles.mutable_region()->set_x_min_m(-2e9);
  EXPECT_EQ(FieldOf(request), "map_tiles.region.x_min_m");
  auto& quarantine = *request.mutable_insert()->add_records()->mutable_map_quarantine();
  quarantine.set_agent_id(9);
  EXPECT_EQ(FieldOf(request), "insert.records[0].map_quarantine.agent_id");
}

TEST(RequestCheckTest, LimitsThePageSize) {
  proto::ReadRequest request;
  BoundPage(request);
  EXPECT_EQ(request.records_max(), kReadRecordsDefault);
  EXPECT_EQ(request.content_bytes_max(), kReadContentBytesDefault);
  request.set_records_max(0xFFFF'FFFF);
  request.set_content_bytes_max(0xFFFF'FFFF);
  BoundPage(request);
  EXPECT_EQ(request.records_max(), kReadRecordsMax);
  EXPECT_EQ(request.content_bytes_max(), kReadContentBytesMax);
}

}  // namespace
}  // namespace moondb
