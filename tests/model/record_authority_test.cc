#include "model/record_authority.h"

#include <gtest/gtest.h>

#include "model/custom_types.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

// Returns options for a team in which rover 1 leads and rover 2 is the designated survivor.
RoleChain::Options Options() {
  RoleChain::Options options;
  options.initial.set_leader(1);
  options.initial.set_survivor(2);
  options.may_command = [](AgentId) { return false; };
  return options;
}

proto::RoleAssignment Second() {
  proto::RoleAssignment roles = RoleChain::Next(Options().initial, /*is_command=*/false);
  roles.mutable_term()->set_issuer(2);
  roles.set_leader(2);
  roles.set_survivor(3);
  roles.set_signature("signed");
  return roles;
}

RecordKey FirstKeyOf(AgentId origin, DataType type) { return {{origin, 7, type}, 1}; }

proto::Record PoseIn(const proto::Term& term) {
  proto::Record record;
  *record.mutable_optimized_pose()->mutable_term() = term;
  return record;
}

proto::Record VerdictIn(const proto::Term& term) {
  proto::Record record;
  *record.mutable_edge_verdict()->mutable_term() = term;
  return record;
}

proto::Record MatchIn(const proto::Term& term) {
  proto::Record record;
  *record.mutable_map_match()->mutable_term() = term;
  return record;
}

TEST(RecordAuthorityTest, MapMatchesCountIfTheirOriginLedInTheirTerm) {
  RecordAuthority authority(Options());
  const proto::Term file = Options().initial.term();
  EXPECT_TRUE(authority.Counts(FirstKeyOf(1, proto::MAP_MATCH), MatchIn(file)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(2, proto::MAP_MATCH), MatchIn(file)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(2, proto::MAP_MATCH), MatchIn(Second().term())));
  proto::Record assignment;
  *assignment.mutable_role_assignment() = Second();
  EXPECT_TRUE(authority.Counts(FirstKeyOf(2, proto::ROLE_ASSIGNMENT), assignment));
  EXPECT_TRUE(authority.Counts(FirstKeyOf(2, proto::MAP_MATCH), MatchIn(Second().term())));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(1, proto::MAP_MATCH), MatchIn(Second().term())));
}

TEST(RecordAuthorityTest, PosesAndVerdictsCountIfTheirOriginLedInTheirTerm) {
  RecordAuthority authority(Options());
  const proto::Term file = Options().initial.term();
  EXPECT_TRUE(authority.Counts(FirstKeyOf(1, proto::OPTIMIZED_POSE), PoseIn(file)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::OPTIMIZED_POSE), PoseIn(file)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(2, proto::EDGE_VERDICT), VerdictIn(file))) << "who survives does not solve";
  proto::Term high;
  high.set_number(1'000'000);
  high.set_issuer(3);
  EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::OPTIMIZED_POSE), PoseIn(high)));
  proto::Record node;
  node.mutable_pose_graph_node()->mutable_node()->set_agent_id(3);
  EXPECT_TRUE(authority.Counts(FirstKeyOf(3, proto::POSE_GRAPH_NODE), node));
  EXPECT_FALSE(authority.TakeOutdated());
}

TEST(RecordAuthorityTest, RecordsAreReadAgainWhenAMissingAssignmentArrives) {
  RecordAuthority authority(Options());
  EXPECT_FALSE(authority.Counts(FirstKeyOf(2, proto::OPTIMIZED_POSE), PoseIn(Second().term())));
  proto::Record assignment;
  *assignment.mutable_role_assignment() = Second();
  EXPECT_TRUE(authority.Counts(FirstKeyOf(2, proto::ROLE_ASSIGNMENT), assignment));
  EXPECT_TRUE(authority.TakeOutdated());
  EXPECT_FALSE(authority.TakeOutdated()) << "once";
  EXPECT_TRUE(authority.Counts(FirstKeyOf(2, proto::OPTIMIZED_POSE), PoseIn(Second().term())));
}

TEST(RecordAuthorityTest, PriorsCountOfTheNodesAgentAndOfCommanders) {
  RoleChain::Options options = Options();
  options.may_command = [](AgentId agent) { return agent == 4; };
  RecordAuthority authority(options);
  proto::Record prior;
  prior.mutable_pose_prior()->mutable_node()->set_agent_id(3);
  EXPECT_TRUE(authority.Counts(FirstKeyOf(3, proto::POSE_PRIOR), prior));
  EXPECT_TRUE(authority.Counts(FirstKeyOf(4, proto::POSE_PRIOR), prior));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(2, proto::POSE_PRIOR), prior)) << "neither names the node nor may command";
}

TEST(RecordAuthorityTest, RolesDoNotMatterInATeamWithoutKeys) {
  RecordAuthority authority(RoleChain::WithoutKeys());
  EXPECT_TRUE(authority.Counts(FirstKeyOf(3, proto::OPTIMIZED_POSE), PoseIn(Second().term())));
}

proto::NodeKey Node(AgentId agent, std::uint64_t index) {
  proto::NodeKey node;
  node.set_agent_id(agent);
  node.set_index(index);
  return node;
}

proto::Record Edge(const proto::NodeKey& from, const proto::NodeKey& to) {
  proto::Record record;
  *record.mutable_pose_graph_edge()->mutable_from() = from;
  *record.mutable_pose_graph_edge()->mutable_to() = to;
  if (from.agent_id() == to.agent_id()) {
    record.mutable_pose_graph_edge()->mutable_relative_pose();
  } else {
    record.mutable_pose_graph_edge()->mutable_range();
  }
  return record;
}

proto::Record QuarantineOf(AgentId agent, const proto::Term& term = {}) {
  proto::Record record;
  record.mutable_map_quarantine()->set_agent_id(agent);
  *record.mutable_map_quarantine()->mutable_term() = term;
  return record;
}

proto::Record LiftOf(AgentId origin, const proto::Term& term = {}) {
  proto::Record record;
  record.mutable_map_quarantine()->mutable_lifts()->set_origin_agent(origin);
  *record.mutable_map_quarantine()->mutable_term() = term;
  return record;
}

TEST(CheckSpeakerTest, AnAgentStatesItsOwnNodesOdometryAndMaps) {
  proto::Record node;
  *node.mutable_pose_graph_node()->mutable_node() = Node(1, 5);
  proto::Record map;
  *map.mutable_local_traversability_map()->mutable_node() = Node(1, 5);
  const proto::Record odometry = Edge(Node(1, 5), Node(1, 6));
  for (const proto::Record& record : {node, map, odometry}) {
    EXPECT_TRUE(CheckSpeaker(record, 1)) << record.ShortDebugString();
    const Result<void> by_other = CheckSpeaker(record, 3);
    ASSERT_FALSE(by_other) << record.ShortDebugString();
    EXPECT_EQ(by_other.error().code, ErrorCode::kInvalid);
  }
  EXPECT_EQ(CheckSpeaker(odometry, 3).error().field, "pose_graph_edge.from.agent_id");
}

TEST(CheckSpeakerTest, EitherEndStatesARange) {
  const proto::Record range = Edge(Node(1, 5), Node(2, 5));
  EXPECT_TRUE(CheckSpeaker(range, 1));
  EXPECT_TRUE(CheckSpeaker(range, 2));
  EXPECT_EQ(CheckSpeaker(range, 3).error().text, "joins agents 1 and 2; only one of these inserts it");
}

TEST(CheckSpeakerTest, TypesWithoutARuleAreStatedByAnyAgent) {
  proto::Record event;
  event.mutable_agent_event();
  proto::Record custom;
  custom.mutable_custom()->set_data_type(kCustomDataTypeMin);
  for (const proto::Record& record : {event, custom, QuarantineOf(1), PoseIn({})}) EXPECT_TRUE(CheckSpeaker(record, 3));
}

TEST(RecordAuthorityTest, ReadersLeaveOutWhatNoOriginMayStateAlsoWithoutKeys) {
  const proto::Record odometry = Edge(Node(1, 5), Node(1, 6));
  for (const RoleChain::Options& options : {Options(), RoleChain::WithoutKeys()}) {
    RecordAuthority authority(options);
    EXPECT_TRUE(authority.Counts(FirstKeyOf(1, proto::POSE_GRAPH_EDGE), odometry));
    EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::POSE_GRAPH_EDGE), odometry));
  }
}

TEST(RecordAuthorityTest, AnAgentQuarantinesItsOwnMapsAndLiftsItsOwnQuarantines) {
  RecordAuthority authority(Options());
  EXPECT_TRUE(authority.Counts(FirstKeyOf(3, proto::MAP_QUARANTINE), QuarantineOf(3)));
  EXPECT_TRUE(authority.Counts(FirstKeyOf(3, proto::MAP_QUARANTINE), LiftOf(3)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::MAP_QUARANTINE), QuarantineOf(2)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::MAP_QUARANTINE), LiftOf(1)));
}

TEST(RecordAuthorityTest, OthersMapsCanBeQuarantinedByTheTermsLeaderOrACommandingAgent) {
  RoleChain::Options options = Options();
  options.may_command = [](AgentId agent) { return agent == 4; };
  RecordAuthority authority(options);
  const proto::Term file = options.initial.term();
  EXPECT_TRUE(authority.Counts(FirstKeyOf(1, proto::MAP_QUARANTINE), QuarantineOf(2, file)));
  EXPECT_TRUE(authority.Counts(FirstKeyOf(4, proto::MAP_QUARANTINE), QuarantineOf(2)));
  EXPECT_TRUE(authority.Counts(FirstKeyOf(4, proto::MAP_QUARANTINE), LiftOf(1)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(2, proto::MAP_QUARANTINE), QuarantineOf(1, file))) << "it survives";
  EXPECT_FALSE(authority.Counts(FirstKeyOf(2, proto::MAP_QUARANTINE), QuarantineOf(1, Second().term())))
      << "not known yet";
  proto::Record assignment;
  *assignment.mutable_role_assignment() = Second();
  EXPECT_TRUE(authority.Counts(FirstKeyOf(2, proto::ROLE_ASSIGNMENT), assignment));
  EXPECT_TRUE(authority.TakeOutdated());
  authority.Restart();
  EXPECT_TRUE(authority.Counts(FirstKeyOf(2, proto::MAP_QUARANTINE), QuarantineOf(1, Second().term())));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::MAP_QUARANTINE), QuarantineOf(1, Second().term())))
      << "the term of another agent";
}

TEST(RecordAuthorityTest, ReportsHowManyRecordsOfEachOriginDoNotCountWhenThatChanges) {
  RecordAuthority authority(Options());
  EXPECT_FALSE(authority.TakeReport({}).has_value());
  EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::MAP_QUARANTINE), QuarantineOf(2)));
  EXPECT_FALSE(authority.Counts(FirstKeyOf(3, proto::MAP_QUARANTINE), QuarantineOf(1)));
  EXPECT_EQ(authority.TakeReport({}).value().left_out_report().without_role().at(3), 2);
  EXPECT_FALSE(authority.TakeReport({}).has_value());
  authority.Restart();
  EXPECT_EQ(authority.TakeReport({}).value().left_out_report().without_role_size(), 0);
}

}  // namespace
}  // namespace moondb
