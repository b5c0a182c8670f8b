#include "apps/common/graph_reading.h"

namespace moondb {

Result<KnownGraph> ReadGraphOf(Client& client) {
  proto::ReadRequest request;
  for (const auto type : {proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_EDGE, proto::OPTIMIZED_POSE, proto::EDGE_VERDICT}) {
    request.add_data_types(type);
  }
  request.set_records_max(1024);
  KnownGraph graph;
  const auto read =
      client.ReadAll(request, [&graph](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
        auto added = graph.Add(FromProto(stored.key()), record);
        if (!added) return Fail(ErrorCode::kCorrupt, added.error().text, added.error().field);
        return {};
      });
  if (!read) return tl::unexpected(read.error());
  return graph;
}

}  // namespace moondb
