#include "apps/common/graph_reading.h"

#include <initializer_list>

#include "model/record_authority.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb {
namespace {

// An export may hold more than a solve of the leader uses.
constexpr KnownGraph::Limits kReadLimits{.nodes_max = 200'000, .edges_max = 600'000};

proto::ReadRequest RequestOf(std::initializer_list<DataType> types) {
  proto::ReadRequest request;
  for (const DataType type : types) request.add_data_types(type);
  request.set_records_max(1024);
  return request;
}

}  // namespace

Result<KnownGraph> ReadGraphOf(Client& client, const proto::TeamConfig& team,
                               const std::function<void(const RecordKey&, const proto::Record&)>& added) {
  RecordAuthority authority(RoleChainOptions(team));
  const auto take = [&authority](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
    (void)authority.Counts(FromProto(stored.key()), record);
    return {};
  };
  // Read all role assignments first: they decide which poses are valid.
  if (auto read = client.ReadAll(RequestOf({proto::ROLE_ASSIGNMENT}), take); !read) return tl::unexpected(read.error());
  KnownGraph graph(kReadLimits);
  const auto add = [&](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
    const RecordKey key = FromProto(stored.key());
    if (!authority.Counts(key, record)) return {};
    if (auto done = graph.Add(key, record); !done) {
      return Fail(ErrorCode::kCorrupt, done.error().text, done.error().field);
    }
    if (added) added(key, record);
    return {};
  };
  const auto request = RequestOf({proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_EDGE, proto::POSE_PRIOR, proto::MAP_MATCH,
                                  proto::OPTIMIZED_POSE, proto::EDGE_VERDICT, proto::MAP_QUARANTINE});
  if (auto read = client.ReadAll(request, add); !read) return tl::unexpected(read.error());
  return graph;
}

}  // namespace moondb
