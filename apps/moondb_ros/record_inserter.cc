#include "apps/moondb_ros/record_inserter.h"

#include <utility>

namespace moondb {

std::uint64_t IndexOf(const RobotMapper::Made& made) { return made.records.front().pose_graph_node().node().index(); }

Result<void> RecordInserter::Insert(const RobotMapper::Made& made, const Agent& agent) {
  if (is_unsure_) {
    const Result<std::optional<RobotMapper::Stored>> newest = agent.read_newest_node();
    if (!newest) return tl::unexpected(newest.error());
    is_unsure_ = false;
    const bool is_stored =
        *newest && (*newest)->index == IndexOf(made) && (*newest)->timestamp_ns == made.records.front().timestamp_ns();
    if (is_stored) return {};
  }
  Result<void> inserted = agent.insert(made.records);
  if (!inserted && (inserted.error().code == ErrorCode::kFull || inserted.error().code == ErrorCode::kInvalid)) {
    inserted = InsertWithoutMap(made.records, agent, inserted.error());
  }
  is_unsure_ = !inserted && inserted.error().code != ErrorCode::kInvalid;
  return inserted;
}

Result<void> RecordInserter::InsertWithoutMap(std::vector<proto::Record> records, const Agent& agent,
                                              const Error& with_map) {
  const auto is_map = [](const proto::Record& record) { return record.has_local_traversability_map(); };
  if (std::erase_if(records, is_map) == 0) return tl::unexpected(with_map);
  const Result<void> inserted = agent.insert(records);
  const std::string text = "nodes are stored without maps: " + ToString(with_map);
  if (inserted && std::exchange(printed_, text) != text) print_(text);
  return inserted;
}

}  // namespace moondb
