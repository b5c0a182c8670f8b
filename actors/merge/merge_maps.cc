#include "actors/merge/merge_maps.h"

#include <memory>
#include <utility>
#include <vector>

namespace moondb {

RecordKey NumberedMapKey(AgentId agent, std::uint64_t seq) {
  return {{agent, 0, proto::LOCAL_TRAVERSABILITY_MAP}, seq};
}

Result<MergedMap> MergeMaps(std::span<const MapAtPose> maps, std::span<const Pose> footprints,
                            const MergeOptions& options) {
  std::vector<PlacedMap> placed;
  placed.reserve(maps.size());
  for (const MapAtPose& map : maps) {
    Result<std::shared_ptr<const LocalMap>> local = MakeLocalMap(map.key, map.stamp_ns, map.map, options.grid);
    if (!local) return tl::unexpected(local.error());
    placed.push_back({std::move(*local), map.map_from_node});
  }
  const Result<MapPlacement> placement = PlaceMaps(std::move(placed), footprints, options.grid);
  if (!placement) return tl::unexpected(placement.error());
  const Result<std::unique_ptr<Merger>> merger = CreateMerger(options.backend);
  if (!merger) return tl::unexpected(merger.error());
  Result<MergeResult> result = (*merger)->Merge(*placement);
  if (!result) return tl::unexpected(result.error());
  return std::move(result->merged);
}

}  // namespace moondb
