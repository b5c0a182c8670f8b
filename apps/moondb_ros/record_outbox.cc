#include "apps/moondb_ros/record_outbox.h"

#include <utility>

namespace moondb {
namespace {

// A node has at most a node, an edge and a map.
constexpr std::size_t kRecordsOfNode = 3;

}  // namespace

std::size_t RecordOutbox::Count() const {
  std::size_t count = 0;
  for (const RobotMapper::Made& made : waiting_) count += made.records.size();
  return count;
}

bool RecordOutbox::HasRoom() const {
  const std::lock_guard lock(mutex_);
  return waiting_.size() * (kRecordsOfNode - 1) + kRecordsOfNode <= kRecordsMax;
}

std::size_t RecordOutbox::Add(RobotMapper::Made made) {
  const std::lock_guard lock(mutex_);
  waiting_.push_back(std::move(made));
  changed_.notify_all();
  std::size_t dropped_count = 0;
  std::size_t count = Count();
  // The first node may be on its way to the agent, so its records stay.
  for (std::size_t i = 1; i < waiting_.size() && count > kRecordsMax; ++i) {
    const std::size_t maps =
        std::erase_if(waiting_[i].records, [](const auto& record) { return record.has_local_traversability_map(); });
    dropped_count += maps;
    count -= maps;
  }
  return dropped_count;
}

std::optional<RobotMapper::Made> RecordOutbox::Next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return is_closed_ || !waiting_.empty(); });
  if (is_closed_) return std::nullopt;
  return waiting_.front();
}

void RecordOutbox::Remove() {
  const std::lock_guard lock(mutex_);
  if (!waiting_.empty()) waiting_.pop_front();
}

void RecordOutbox::Close() {
  const std::lock_guard lock(mutex_);
  is_closed_ = true;
  changed_.notify_all();
}

}  // namespace moondb
