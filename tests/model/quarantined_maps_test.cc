#include "model/quarantined_maps.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb {
namespace {

RecordKey KeyOf(std::uint64_t seq) { return {{9, 1, proto::MAP_QUARANTINE}, seq}; }

proto::MapQuarantine MapsOf(AgentId agent, std::int64_t from_ns, std::int64_t to_ns) {
  proto::MapQuarantine quarantine;
  quarantine.set_agent_id(agent);
  quarantine.set_from_ns(from_ns);
  quarantine.set_to_ns(to_ns);
  return quarantine;
}

TEST(QuarantinedMapsTest, ContainTheMapsOfAnAgentFromTheFirstToTheLastTimestamp) {
  QuarantineSet set(10);
  set.Add(KeyOf(1), MapsOf(1, 10, 20));
  set.Add(KeyOf(2), MapsOf(1, 15, 30));
  set.Add(KeyOf(3), MapsOf(1, 40, 40));
  const QuarantinedMaps maps(set);
  for (const std::int64_t inside_ns : {10, 20, 25, 30, 40}) EXPECT_TRUE(maps.Contains(1, inside_ns)) << inside_ns;
  for (const std::int64_t outside_ns : {9, 31, 39, 41}) EXPECT_FALSE(maps.Contains(1, outside_ns)) << outside_ns;
  EXPECT_FALSE(maps.Contains(2, 20));
}

TEST(QuarantinedMapsTest, ContainNoLiftedQuarantineAndNoGraphPart) {
  QuarantineSet set(10);
  set.Add(KeyOf(1), MapsOf(1, 10, 20));
  proto::MapQuarantine lift;
  *lift.mutable_lifts() = ToProto(KeyOf(1));
  set.Add(KeyOf(2), lift);
  proto::MapQuarantine node = MapsOf(1, 0, 0);
  *node.mutable_node() = ToProto(NodeKey{1, 4});
  set.Add(KeyOf(3), node);
  const QuarantinedMaps maps(set);
  EXPECT_FALSE(maps.Contains(1, 15));
  EXPECT_FALSE(maps.Contains(1, 0));
}

}  // namespace
}  // namespace moondb
