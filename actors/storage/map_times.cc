#include "actors/storage/map_times.h"

#include <map>
#include <utility>

#include "actors/storage/clock_judge.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

// Does not read the content, because a status may be asked for often, and a map may have megabytes.
Result<std::int64_t> TimestampOf(Database& database, const RecordKey& key) {
  Query query =
      database.Prepare("SELECT timestamp_ns FROM local_traversability_map WHERE origin = ? AND epoch = ? AND seq = ?");
  query << key.stream.origin << key.stream.epoch << key.seq;
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  const std::int64_t timestamp_ns = *row ? query.Integer(0) : 0;
  return timestamp_ns < kTimestampMin_ns ? 0 : timestamp_ns;
}

}  // namespace

Result<void> AddMapTimes(Database& database, const HaveSet& have, proto::StorageStatus& status) {
  std::map<AgentId, std::pair<RecordKey, RecordKey>> ends;  // The first and the last map of each origin.
  for (const auto& [stream, state] : have.streams()) {
    if (stream.type != proto::LOCAL_TRAVERSABILITY_MAP || state.held.is_empty()) continue;
    const RecordKey first{stream, state.held.intervals().front().first};
    const RecordKey last{stream, state.held.Max()};
    // The streams of an origin are sorted by epoch.
    ends.try_emplace(stream.origin, first, last).first->second.second = last;
  }
  for (const auto& [origin, keys] : ends) {
    const Result<std::int64_t> first_ns = TimestampOf(database, keys.first);
    if (!first_ns) return tl::unexpected(first_ns.error());
    const Result<std::int64_t> last_ns = TimestampOf(database, keys.second);
    if (!last_ns) return tl::unexpected(last_ns.error());
    proto::MapTimes& times = *status.add_map_times();
    times.set_origin_agent(origin);
    times.set_first_ns(*first_ns);
    times.set_last_ns(*last_ns);
  }
  return {};
}

}  // namespace moondb
