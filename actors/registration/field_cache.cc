#include "actors/registration/field_cache.h"

#include <algorithm>
#include <optional>

namespace moondb {

std::shared_ptr<const HazardField> FieldCache::FieldOf(const RegisteredMap& map, const KnownMaps& maps) {
  const auto found = std::ranges::find(fields_, map.key, [](const auto& field) { return field.first; });
  if (found != fields_.end()) {
    fields_.splice(fields_.begin(), fields_, found);
    return found->second;
  }
  const std::optional<TraversabilityMap> cells = maps.FindMap(map.key);
  if (!cells) return nullptr;
  fields_.emplace_front(map.key, std::make_shared<const HazardField>(*cells, maps.FindRovers(map)));
  if (fields_.size() > fields_max_) fields_.pop_back();
  return fields_.front().second;
}

}  // namespace moondb
