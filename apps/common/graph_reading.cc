#include "apps/common/graph_reading.h"

#include "apps/common/valid_records.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

// An export may hold more than a solve of the leader uses.
constexpr KnownGraph::Limits kReadLimits{.nodes_max = 200'000, .edges_max = 600'000};

}  // namespace

Result<KnownGraph> ReadGraphOf(Client& client, const proto::TeamConfig& team,
                               const std::function<void(const RecordKey&, const proto::Record&)>& added) {
  KnownGraph graph(kReadLimits);
  const auto add = [&](const RecordKey& key, const proto::Record& record) -> Result<void> {
    if (auto done = graph.Add(key, record); !done) {
      return Fail(ErrorCode::kCorrupt, done.error().text, done.error().field);
    }
    if (added) added(key, record);
    return {};
  };
  proto::ReadRequest request;
  request.set_records_max(1024);
  for (const DataType type : {proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_EDGE, proto::POSE_PRIOR, proto::MAP_MATCH,
                              proto::OPTIMIZED_POSE, proto::EDGE_VERDICT, proto::MAP_QUARANTINE}) {
    request.add_data_types(type);
  }
  if (auto read = ValidRecords(client, team).ReadAll(request, add); !read) return tl::unexpected(read.error());
  return graph;
}

}  // namespace moondb
