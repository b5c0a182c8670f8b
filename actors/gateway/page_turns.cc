#include "actors/gateway/page_turns.h"

#include <algorithm>

#include "model/check.h"

namespace moondb {

bool PageTurns::Add(const std::string& queue, std::uint64_t id) {
  std::deque<std::uint64_t>& requests = queues_[queue];
  Check(std::ranges::find(requests, id) == requests.end(), "a request waits once for its turn");
  requests.push_back(id);
  return requests.size() == 1;
}

std::optional<std::uint64_t> PageTurns::Remove(const std::string& queue, std::uint64_t id) {
  const auto found = queues_.find(queue);
  if (found == queues_.end()) return std::nullopt;
  std::deque<std::uint64_t>& requests = found->second;
  const bool had_turn = requests.front() == id;
  std::erase(requests, id);
  if (requests.empty()) {
    queues_.erase(found);
    return std::nullopt;
  }
  return had_turn ? std::optional(requests.front()) : std::nullopt;
}

}  // namespace moondb
