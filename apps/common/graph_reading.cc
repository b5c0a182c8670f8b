#include "apps/common/graph_reading.h"

#include <tuple>

#include "model/term.h"

namespace moondb {
namespace {

// Duplicates under one natural key: the smaller record key stands.
class GraphReader {
 public:
  Result<void> Take(const proto::StoredRecord& stored, const proto::Record& record) {
    if (record.has_optimized_pose()) return TakeOptimized(record.optimized_pose());
    const RecordKey key = FromProto(stored.key());
    PoseGraph one;
    if (auto added = AddRecord(record, one); !added) return added;
    for (GraphNode& node : one.nodes) KeepSmaller(nodes_, node.key, key, std::move(node));
    for (OdometryEdge& edge : one.odometry) KeepSmaller(odometry_, {edge.from, edge.to}, key, std::move(edge));
    for (RangeEdge& edge : one.ranges) KeepSmaller(ranges_, {edge.from, edge.to}, key, std::move(edge));
    return {};
  }

  ReadGraph Finish() {
    for (auto& [name, entry] : nodes_) read_.graph.nodes.push_back(std::move(entry.second));
    for (auto& [name, entry] : odometry_) read_.graph.odometry.push_back(std::move(entry.second));
    for (auto& [name, entry] : ranges_) read_.graph.ranges.push_back(std::move(entry.second));
    return std::move(read_);
  }

 private:
  using EdgeName = std::pair<NodeKey, NodeKey>;

  template <typename Name, typename Value>
  static void KeepSmaller(std::map<Name, std::pair<RecordKey, Value>>& values, const Name& name, const RecordKey& key,
                          Value value) {
    const auto found = values.find(name);
    if (found == values.end()) {
      values.emplace(name, std::pair(key, std::move(value)));
    } else if (key < found->second.first) {
      found->second = {key, std::move(value)};
    }
  }

  Result<void> TakeOptimized(const proto::OptimizedPose& optimized) {
    auto pose = FromProto(optimized.map_from_node());
    if (!pose) return Fail(ErrorCode::kCorrupt, pose.error().text, "optimized_pose." + pose.error().field);
    const NodeKey node = FromProto(optimized.node());
    const Version version{OrderOf(optimized.term()), optimized.run()};
    const auto found = versions_.find(node);
    if (found != versions_.end() && found->second >= version) return {};
    versions_[node] = version;
    read_.optimized[node] = *pose;
    return {};
  }

  using Version = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;

  ReadGraph read_;
  std::map<NodeKey, std::pair<RecordKey, GraphNode>> nodes_;
  std::map<EdgeName, std::pair<RecordKey, OdometryEdge>> odometry_;
  std::map<EdgeName, std::pair<RecordKey, RangeEdge>> ranges_;
  std::map<NodeKey, Version> versions_;
};

}  // namespace

Result<ReadGraph> ReadGraphOf(Client& client) {
  proto::ReadRequest request;
  for (const auto type : {proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_EDGE, proto::OPTIMIZED_POSE}) {
    request.add_data_types(type);
  }
  request.set_records_max(1024);
  GraphReader reader;
  const auto read = client.ReadAll(request, [&reader](const proto::StoredRecord& stored, const proto::Record& record) {
    return reader.Take(stored, record);
  });
  if (!read) return tl::unexpected(read.error());
  return reader.Finish();
}

}  // namespace moondb
