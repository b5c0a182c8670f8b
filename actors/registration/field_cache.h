// FieldCache: the hazard fields of the maps that were matched last. Not thread-safe.
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <utility>

#include "actors/registration/hazard_field.h"
#include "actors/registration/known_maps.h"

namespace moondb {

class FieldCache {
 public:
  explicit FieldCache(std::size_t fields_max) : fields_max_(fields_max) {}

  // Returns the field of a registered map; null if `maps` does not hold the map's cells.
  std::shared_ptr<const HazardField> FieldOf(const RegisteredMap& map, const KnownMaps& maps);
  void Clear() { fields_.clear(); }

 private:
  const std::size_t fields_max_;
  std::list<std::pair<RecordKey, std::shared_ptr<const HazardField>>> fields_;  // The last used first.
};

}  // namespace moondb
