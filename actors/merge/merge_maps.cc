#include "actors/merge/merge_maps.h"

#include <memory>
#include <utility>
#include <vector>

#include "actors/merge/merger.h"
#include "proto/types.pb.h"

namespace moondb {

RecordKey NumberedMapKey(AgentId agent, std::uint64_t seq) {
  return {{agent, 0, proto::LOCAL_TRAVERSABILITY_MAP}, seq};
}

Result<MergedMap> MergeMaps(std::span<const MapAtPose> maps, std::span<const Pose> footprints,
                            const MergeOptions& options) {
  if (Result<void> checked = CheckGrid(options.grid); !checked) return tl::unexpected(checked.error());
  Result<std::unique_ptr<GatherBackend>> backend = CreateGatherBackend(options.backend);
  if (!backend) return tl::unexpected(backend.error());
  std::vector<PlacedMap> placed;
  placed.reserve(maps.size());
  for (const MapAtPose& map : maps) {
    Result<std::shared_ptr<const LocalMap>> local = MakeLocalMap(map.key, map.timestamp_ns, map.map, options.grid);
    if (!local) return tl::unexpected(local.error());
    placed.push_back({std::move(*local), map.map_from_node});
  }
  std::vector<Footprint> bodies;
  bodies.reserve(footprints.size());
  for (const Pose& pose : footprints) bodies.push_back({NodeKey{1, bodies.size()}, pose});

  Merger merger(options.grid, std::move(*backend));
  const std::vector<Error> refused = merger.Assign(placed, bodies);
  if (!refused.empty()) return tl::unexpected(refused.front());
  const Result<MergeSummary> merged = merger.Merge({});
  if (!merged) return tl::unexpected(merged.error());
  return merger.ReadCells(merger.extent());
}

}  // namespace moondb
