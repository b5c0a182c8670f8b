#include "model/record_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "model/data_types.h"
#include "model/event.h"
#include "model/geometry.h"
#include "model/pose_graph.h"
#include "model/record_key.h"
#include "model/term.h"
#include "model/traversability_map.h"
#include "proto/types.pb.h"
#include "tests/sample_record.h"

namespace moondb {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

proto::Record RangeRecord() {
  proto::Record record;
  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  *edge.mutable_from() = ToProto(NodeKey{1, 4});
  *edge.mutable_to() = ToProto(NodeKey{2, 4});
  edge.mutable_range()->set_range_m(3.5);
  edge.mutable_range()->set_variance_m2(0.01);
  return record;
}

proto::Record OdometryRecord() {
  proto::Record record;
  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  *edge.mutable_from() = ToProto(NodeKey{1, 4});
  *edge.mutable_to() = ToProto(NodeKey{1, 5});
  *edge.mutable_relative_pose()->mutable_from_from_to() = ToProto(Pose::FromPlanar(1, 0, 0.1));
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      edge.mutable_relative_pose()->add_covariance(row == column ? 0.01 : 0);
    }
  }
  return record;
}

proto::Record MapRecord() {
  TraversabilityMap map{NodeKey{1, 4}, Pose::FromPlanar(0.2, 0, 0), {}};
  map.layers.push_back(MapLayer{Grid(5, 3, Cell::kFree), 50'000, 0, 0});
  map.layers.push_back(MapLayer{Grid(5, 3, Cell::kHazard), 100'000, 0, 0});
  proto::Record record;
  *record.mutable_local_traversability_map() = ToProto(map);
  return record;
}

// Applies `spoil` to `record` and checks the record. Returns the rejected field, or an empty text if the record is
// valid.
std::string Refused(proto::Record record, const std::function<void(proto::Record&)>& spoil) {
  spoil(record);
  const Result<void> result = CheckRecord(record);
  return result ? "" : result.error().field;
}

TEST(RecordCheckTest, AcceptsWholeRecords) {
  const auto nothing = [](proto::Record&) {};
  EXPECT_EQ(Refused(RangeRecord(), nothing), "");
  EXPECT_EQ(Refused(OdometryRecord(), nothing), "");
  EXPECT_EQ(Refused(MapRecord(), nothing), "");
}

TEST(RecordCheckTest, RefusesARecordWithoutBody) {
  EXPECT_EQ(Refused(proto::Record(), [](proto::Record&) {}), "body");
}

TEST(RecordCheckTest, NamesTheStateThatIsWrong) {
  proto::Record record;
  EXPECT_EQ(Refused(record, [](auto& r) { r.mutable_temperature()->set_celsius(kNan); }), "temperature.celsius");
  EXPECT_EQ(Refused(record, [](auto& r) { r.mutable_power()->set_battery_ratio(1.5); }), "power.battery_ratio");
  EXPECT_EQ(Refused(record, [](auto& r) { r.mutable_exploration()->set_explored_ratio(kNan); }),
            "exploration.explored_ratio");
  EXPECT_EQ(Refused(record, [](auto& r) { r.mutable_mode()->set_activity(static_cast<proto::Activity>(77)); }),
            "mode.activity");
}

TEST(RecordCheckTest, NamesTheEdgeFieldThatIsWrong) {
  const auto edge = [](proto::Record& r) { return r.mutable_pose_graph_edge(); };
  EXPECT_EQ(Refused(RangeRecord(), [&](auto& r) { edge(r)->mutable_range()->set_range_m(-1); }),
            "pose_graph_edge.range.range_m");
  EXPECT_EQ(Refused(RangeRecord(), [&](auto& r) { edge(r)->mutable_range()->set_variance_m2(0); }),
            "pose_graph_edge.range.variance_m2");
  EXPECT_EQ(Refused(RangeRecord(), [&](auto& r) { edge(r)->mutable_to()->set_agent_id(1); }), "pose_graph_edge.to");
  EXPECT_EQ(Refused(RangeRecord(), [&](auto& r) { edge(r)->mutable_to()->set_agent_id(0); }),
            "pose_graph_edge.to.agent_id");
  EXPECT_EQ(Refused(OdometryRecord(), [&](auto& r) { edge(r)->mutable_to()->set_agent_id(2); }),
            "pose_graph_edge.to.agent_id");
  EXPECT_EQ(Refused(OdometryRecord(),
                    [&](auto& r) { edge(r)->mutable_relative_pose()->mutable_covariance()->Set(0, -0.01); }),
            "pose_graph_edge.relative_pose.covariance");
  EXPECT_EQ(
      Refused(OdometryRecord(), [&](auto& r) { edge(r)->mutable_relative_pose()->mutable_covariance()->RemoveLast(); }),
      "pose_graph_edge.relative_pose.covariance");
  EXPECT_EQ(Refused(OdometryRecord(),
                    [&](auto& r) {
                      edge(r)->mutable_relative_pose()->mutable_from_from_to()->mutable_position_m()->set_x(kNan);
                    }),
            "pose_graph_edge.relative_pose.from_from_to.position_m");
  EXPECT_EQ(Refused(OdometryRecord(),
                    [&](auto& r) {
                      edge(r)->mutable_relative_pose()->mutable_from_from_to()->mutable_orientation()->set_w(0);
                    }),
            "pose_graph_edge.relative_pose.from_from_to.orientation");
}

TEST(RecordCheckTest, NamesTheMapFieldThatIsWrong) {
  const auto layer = [](proto::Record& r, int i) { return r.mutable_local_traversability_map()->mutable_layers(i); };
  EXPECT_EQ(Refused(MapRecord(), [&](auto& r) { layer(r, 1)->set_width_cells(6); }),
            "local_traversability_map.layers[1].cells");
  EXPECT_EQ(Refused(MapRecord(), [&](auto& r) { layer(r, 0)->set_width_cells(0); }),
            "local_traversability_map.layers[0].width_cells");
  EXPECT_EQ(Refused(MapRecord(), [&](auto& r) { layer(r, 1)->set_height_cells(4'000'000'000u); }),
            "local_traversability_map.layers[1]");
  EXPECT_EQ(Refused(MapRecord(), [&](auto& r) { layer(r, 1)->set_resolution_um(0); }),
            "local_traversability_map.layers[1].resolution_um");
  EXPECT_EQ(Refused(MapRecord(), [&](auto& r) { (*layer(r, 0)->mutable_cells())[0] = '\xff'; }),
            "local_traversability_map.layers[0].cells");
  EXPECT_EQ(Refused(MapRecord(), [&](auto& r) { layer(r, 0)->set_center_x_m(kNan); }),
            "local_traversability_map.layers[0].center_m");
  EXPECT_EQ(Refused(MapRecord(), [](auto& r) { r.mutable_local_traversability_map()->clear_layers(); }),
            "local_traversability_map.layers");
  EXPECT_EQ(Refused(MapRecord(), [](auto& r) { r.mutable_local_traversability_map()->clear_node(); }),
            "local_traversability_map.node.agent_id");
}

TEST(RecordCheckTest, RefusesPosesAndVerdictsOfTheFarFuture) {
  proto::Record record;
  proto::OptimizedPose& pose = *record.mutable_optimized_pose();
  pose.mutable_node()->set_agent_id(1);
  pose.mutable_map_from_node()->mutable_position_m();
  pose.mutable_map_from_node()->mutable_orientation()->set_w(1);
  pose.mutable_term()->set_issuer(1);
  pose.mutable_term()->set_number(kTermNumberMax);
  EXPECT_TRUE(CheckRecord(record));
  pose.mutable_term()->set_number(kTermNumberMax + 1);
  ASSERT_FALSE(CheckRecord(record));
  EXPECT_EQ(CheckRecord(record).error().field, "optimized_pose.term.number");
}

TEST(RecordCheckTest, NamesTheFieldOfAQuarantineThatIsWrong) {
  proto::Record record;
  record.mutable_map_quarantine()->set_agent_id(2);
  record.mutable_map_quarantine()->set_from_ns(-5);
  const auto refused = [&record](const std::function<void(proto::MapQuarantine&)>& spoil) {
    return Refused(record, [&spoil](proto::Record& r) { spoil(*r.mutable_map_quarantine()); });
  };
  EXPECT_EQ(refused([](auto&) {}), "");
  EXPECT_EQ(refused([](auto& q) { q.set_agent_id(0); }), "map_quarantine.agent_id");
  EXPECT_EQ(refused([](auto& q) { q.set_to_ns(-6); }), "map_quarantine.to_ns");
  EXPECT_EQ(refused([](auto& q) { q.set_reason(std::string(1025, 'x')); }), "map_quarantine.reason");
  EXPECT_EQ(refused([](auto& q) { q.mutable_lifts()->set_origin_agent(1); }), "map_quarantine.lifts.data_type");
  const auto lift = [](proto::MapQuarantine& q) {
    q.Clear();
    *q.mutable_lifts() = ToProto(RecordKey{{1, 7, proto::MAP_QUARANTINE}, 3});
  };
  EXPECT_EQ(refused(lift), "");
  EXPECT_EQ(refused([&lift](auto& q) {
              lift(q);
              q.mutable_lifts()->set_seq(0);
            }),
            "map_quarantine.lifts");
}

TEST(RecordCheckTest, NamesTheQuarantinedPartThatIsWrong) {
  proto::Record record;
  proto::MapQuarantine& quarantine = *record.mutable_map_quarantine();
  quarantine.set_agent_id(2);
  *quarantine.mutable_node() = ToProto(NodeKey{2, 500});
  EXPECT_TRUE(CheckRecord(record));
  quarantine.set_agent_id(3);
  EXPECT_EQ(CheckRecord(record).error().field, "map_quarantine.node.agent_id");
  *quarantine.mutable_factor()->mutable_from() = ToProto(NodeKey{3, 1});
  EXPECT_EQ(CheckRecord(record).error().field, "map_quarantine.factor.to.agent_id");
  *quarantine.mutable_factor()->mutable_to() = ToProto(NodeKey{2, 1});
  EXPECT_TRUE(CheckRecord(record));
  quarantine.mutable_factor()->set_source(std::string(kRegistrationSource));
  EXPECT_TRUE(CheckRecord(record)) << "of a map match";
  quarantine.set_agent_id(4);
  EXPECT_EQ(CheckRecord(record).error().field, "map_quarantine.factor");
  quarantine.mutable_producer()->set_source("apriltag");
  EXPECT_TRUE(CheckRecord(record));
  quarantine.mutable_producer()->set_source(std::string(33, 'a'));
  EXPECT_EQ(CheckRecord(record).error().field, "map_quarantine.producer.source");
}

TEST(RecordCheckTest, ALoopClosureStatesItsSource) {
  const auto edge = [](proto::Record& r) { return r.mutable_pose_graph_edge(); };
  const auto closure = [&](const std::string& source) {
    proto::Record record = OdometryRecord();
    edge(record)->mutable_to()->set_agent_id(2);
    edge(record)->set_source(source);
    return record;
  };
  EXPECT_TRUE(CheckRecord(closure("apriltag")));
  EXPECT_EQ(CheckRecord(closure("")).error().field, "pose_graph_edge.to.agent_id") << "odometry of two agents";
  EXPECT_EQ(CheckRecord(closure("registration")).error().field, "pose_graph_edge.source");
  EXPECT_EQ(Refused(RangeRecord(), [&](auto& r) { edge(r)->set_source("apriltag"); }), "pose_graph_edge.source");
  EXPECT_NE(NaturalKey(closure("apriltag")), NaturalKey(closure("slam_toolbox")));
}

TEST(RecordCheckTest, NamesThePriorFieldThatIsWrong) {
  const auto sample = [] {
    proto::Record record;
    proto::PosePrior& prior = *record.mutable_pose_prior();
    *prior.mutable_node() = ToProto(NodeKey{1, 4});
    prior.mutable_position_m()->set_x(3);
    for (const double number : {1, 0, 0, 1, 0, 1}) prior.add_covariance(number);
    prior.set_source("gnss");
    return record;
  };
  EXPECT_TRUE(CheckRecord(sample()));
  const auto prior = [](proto::Record& r) { return r.mutable_pose_prior(); };
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->clear_source(); }), "pose_prior.source");
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->clear_measurement(); }), "pose_prior.measurement");
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->mutable_position_m()->set_y(kNan); }), "pose_prior.position_m");
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->mutable_position_m()->set_y(2e9); }), "pose_prior.position_m");
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->mutable_point_m()->set_y(kNan); }), "pose_prior.point_m");
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->set_covariance(0, 0); }), "pose_prior.covariance") << "singular";
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->mutable_position_yaw()->mutable_position_m(); }),
            "pose_prior.covariance")
      << "of another size";
  EXPECT_EQ(Refused(sample(),
                    [&](auto& r) {
                      *prior(r)->mutable_pose() = ToProto(Pose());
                      prior(r)->mutable_point_m();
                    }),
            "pose_prior.point_m");
  EXPECT_EQ(Refused(sample(), [&](auto& r) { prior(r)->mutable_node()->set_agent_id(0); }), "pose_prior.node.agent_id");
}

TEST(RecordCheckTest, NamesTheMapMatchFieldThatIsWrong) {
  const auto refused = [](const std::function<void(proto::MapMatch&)>& spoil) {
    return Refused(SampleRecord(proto::MAP_MATCH, 1), [&](proto::Record& r) { spoil(*r.mutable_map_match()); });
  };
  const auto pose = [](proto::MapMatch& m) { return m.mutable_relative_pose()->mutable_from_from_to(); };
  EXPECT_EQ(refused([](auto&) {}), "");
  EXPECT_EQ(refused([](auto& m) { m.mutable_from()->set_agent_id(0); }), "map_match.from.agent_id");
  EXPECT_EQ(refused([](auto& m) { m.mutable_to()->set_agent_id(kAgentIdMax + 1); }), "map_match.to.agent_id");
  EXPECT_EQ(refused([](auto& m) { *m.mutable_to() = m.from(); }), "map_match.to");
  EXPECT_EQ(refused([&](auto& m) { pose(m)->mutable_orientation()->set_w(9); }),
            "map_match.relative_pose.from_from_to.orientation");
  EXPECT_EQ(refused([&](auto& m) { pose(m)->mutable_position_m()->set_x(kNan); }),
            "map_match.relative_pose.from_from_to.position_m");
  EXPECT_EQ(refused([&](auto& m) { pose(m)->mutable_position_m()->set_x(-999.9); }), "");
  EXPECT_EQ(refused([&](auto& m) { pose(m)->mutable_position_m()->set_x(-1001); }),
            "map_match.relative_pose.from_from_to.position_m");
  EXPECT_EQ(refused([](auto& m) { m.mutable_relative_pose()->set_covariance(0, -1); }),
            "map_match.relative_pose.covariance");
  EXPECT_EQ(refused([](auto& m) { m.mutable_relative_pose()->mutable_covariance()->RemoveLast(); }),
            "map_match.relative_pose.covariance");
  EXPECT_EQ(refused([](auto& m) { m.mutable_from_map()->set_data_type(proto::POSE_GRAPH_NODE); }),
            "map_match.from_map.data_type");
  EXPECT_EQ(refused([](auto& m) { m.mutable_from_map()->set_origin_agent(2); }), "map_match.from_map.origin_agent");
  EXPECT_EQ(refused([](auto& m) { m.mutable_to_map()->set_origin_agent(2); }), "map_match.to_map.origin_agent");
  EXPECT_EQ(refused([](auto& m) { m.mutable_to_map()->set_epoch(0); }), "map_match.to_map");
  EXPECT_EQ(refused([](auto& m) { m.mutable_to_map()->set_seq(0); }), "map_match.to_map");
  EXPECT_EQ(refused([](auto& m) { m.set_overlap(-0.1); }), "map_match.overlap");
  EXPECT_EQ(refused([](auto& m) { m.set_matched(kNan); }), "map_match.matched");
  EXPECT_EQ(refused([](auto& m) { m.set_second_best(1.1); }), "map_match.second_best");
  EXPECT_EQ(refused([](auto& m) { m.mutable_term()->set_issuer(0); }), "map_match.term.issuer");
  EXPECT_EQ(refused([](auto& m) { m.mutable_term()->set_number(kTermNumberMax + 1); }), "map_match.term.number");
}

TEST(RecordCheckTest, AMapMatchWithTheSameEndsSupersedesOlderOnes) {
  const proto::Record match = SampleRecord(proto::MAP_MATCH, 1);
  EXPECT_EQ(LatestKey(match), "1:1 1:2");
  proto::Record reversed = match;
  reversed.mutable_map_match()->mutable_from()->Swap(reversed.mutable_map_match()->mutable_to());
  EXPECT_NE(LatestKey(reversed), LatestKey(match));
  proto::Record newer = match;
  newer.mutable_map_match()->set_run(2);
  EXPECT_EQ(LatestKey(newer), LatestKey(match));
  const DataTypeRow& row = *FindDataType(proto::MAP_MATCH);
  EXPECT_LT(row.version(match), row.version(newer));
}

TEST(RecordCheckTest, NodesAndEdgesHaveDistinctNaturalKeys) {
  EXPECT_NE(NaturalKey(RangeRecord()), NaturalKey(OdometryRecord()));
  EXPECT_EQ(NaturalKey(RangeRecord()), NaturalKey(RangeRecord()));
  EXPECT_EQ(NaturalKey(MapRecord()), "");
}

TEST(RecordCheckTest, BoundsCustomRecords) {
  proto::Record record;
  proto::CustomRecord& custom = *record.mutable_custom();
  custom.set_data_type(1000);
  custom.set_latest_key(std::string(256, '\0'));
  custom.set_metadata(std::string(1024, 'x'));
  EXPECT_TRUE(CheckRecord(record));
  EXPECT_EQ(TypeOf(record), 1000u);
  EXPECT_EQ(LatestKey(record), custom.latest_key());

  custom.set_metadata("\xFF");
  EXPECT_EQ(CheckRecord(record).error().field, "custom.metadata");
  custom.set_metadata(std::string(1025, 'x'));
  EXPECT_EQ(CheckRecord(record).error().field, "custom.metadata");
  custom.set_payload(std::string(8 * 1024 * 1024 + 1, 'x'));
  EXPECT_EQ(CheckRecord(record).error().field, "custom.payload");
  custom.set_latest_key(std::string(257, 'x'));
  EXPECT_EQ(ToString(CheckRecord(record).error()), "custom.latest_key: is longer than 256 bytes");
  // A custom record with a built-in or undeclared type number is rejected.
  for (const DataType type : {0u, static_cast<DataType>(proto::TEMPERATURE), 999u, 2000u}) {
    custom.set_data_type(type);
    EXPECT_EQ(ToString(CheckRecord(record).error()), "custom.data_type: must be 1000 to 1999");
    EXPECT_EQ(TypeOf(record), proto::DATA_TYPE_UNSPECIFIED);
  }
}

TEST(RecordCheckTest, RefusesEventsThatAreNotOneLineOfText) {
  const proto::Record event = MakeEvent(proto::EVENT_KIND_COMMAND, "sync\nnow", "anna@hill", 5);
  EXPECT_EQ(event.agent_event().text(), "sync?now");
  const auto refused = [&event](const std::function<void(proto::AgentEvent&)>& spoil) {
    return Refused(event, [&spoil](proto::Record& r) { spoil(*r.mutable_agent_event()); });
  };
  EXPECT_EQ(refused([](auto&) {}), "");
  EXPECT_EQ(refused([](auto& e) { e.clear_kind(); }), "agent_event.kind");
  EXPECT_EQ(refused([](auto& e) { e.set_text(std::string(kEventTextBytesMax + 1, 'x')); }), "agent_event.text");
  EXPECT_EQ(refused([](auto& e) { e.set_by(std::string(kEventByBytesMax + 1, 'x')); }), "agent_event.by");
  EXPECT_EQ(Refused(MakeEvent(proto::EVENT_KIND_ROLES, std::string(9999, '\xC3'), std::string(9999, 'x'), 5),
                    [](proto::Record&) {}),
            "");
}

}  // namespace
}  // namespace moondb
