#include "model/derived_records.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb {
namespace {

// Rover 1 leads and rover 2 survives by the team file.
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

RecordKey KeyOf(AgentId origin, DataType type) { return {{origin, 7, type}, 1}; }

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

TEST(DerivedRecordsTest, CountWhereTheirOriginLedInTheirTerm) {
  DerivedRecords derived(Options());
  const proto::Term file = Options().initial.term();
  EXPECT_TRUE(derived.Counts(KeyOf(1, proto::OPTIMIZED_POSE), PoseIn(file)));
  EXPECT_FALSE(derived.Counts(KeyOf(3, proto::OPTIMIZED_POSE), PoseIn(file)));
  EXPECT_FALSE(derived.Counts(KeyOf(2, proto::EDGE_VERDICT), VerdictIn(file))) << "who survives does not solve";
  proto::Term high;
  high.set_number(1'000'000);
  high.set_issuer(3);
  EXPECT_FALSE(derived.Counts(KeyOf(3, proto::OPTIMIZED_POSE), PoseIn(high)));
  proto::Record node;
  node.mutable_pose_graph_node();
  EXPECT_TRUE(derived.Counts(KeyOf(3, proto::POSE_GRAPH_NODE), node));
  EXPECT_FALSE(derived.TakeOutdated());
}

TEST(DerivedRecordsTest, AreReadAnewOnceTheirAssignmentComes) {
  DerivedRecords derived(Options());
  EXPECT_FALSE(derived.Counts(KeyOf(2, proto::OPTIMIZED_POSE), PoseIn(Second().term())));
  proto::Record assignment;
  *assignment.mutable_role_assignment() = Second();
  EXPECT_TRUE(derived.Counts(KeyOf(2, proto::ROLE_ASSIGNMENT), assignment));
  EXPECT_TRUE(derived.TakeOutdated());
  EXPECT_FALSE(derived.TakeOutdated()) << "once";
  EXPECT_TRUE(derived.Counts(KeyOf(2, proto::OPTIMIZED_POSE), PoseIn(Second().term())));
}

TEST(DerivedRecordsTest, CountAllInATeamWithoutKeys) {
  DerivedRecords derived(RoleChain::WithoutKeys());
  EXPECT_TRUE(derived.Counts(KeyOf(3, proto::OPTIMIZED_POSE), PoseIn(Second().term())));
}

}  // namespace
}  // namespace moondb
