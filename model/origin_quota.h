// OriginQuota: which records a reader with limited room uses, so that no agent takes the room of another.
//
// Each record has a weight (1, or its bytes). All origins whose records weigh at most the level keep all of them; every
// other origin keeps the newest of its records that weigh at most the level together. The level is the highest at which
// all origins fit into the limit together (max-min fairness). The newest records of an origin are those of the highest
// (epoch, seq). So the outcome depends on the set of records alone, not on their order. A record that once has no room
// never gets room again: the level only falls, and records newer than it only come to be more.
//
// `Note` is what the user remembers of a record, to find it when it loses its room. Memory grows with the records that
// have room, and with the agents of the team. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "model/record_key.h"

namespace moondb {

// The order in which an origin made its records: epoch, seq, type.
using RecordAge = std::tuple<std::uint64_t, std::uint64_t, DataType>;
inline RecordAge AgeOf(const RecordKey& key) { return {key.stream.epoch, key.seq, key.stream.type}; }

template <typename Note>
class OriginQuota {
 public:
  struct Removed {
    RecordKey key;
    Note note;
  };

  // `limit`: what the records that have room weigh together, at most. Below 2^48, and fewer than 2^15 records may come
  // that weigh more than it, so that sums fit.
  explicit OriginQuota(std::uint64_t limit) : limit_(limit) {}

  // Adds a record, which must not be added twice. Returns the records that lose their room by it; the new one is among
  // them if there is no room for it at all.
  std::vector<Removed> Add(const RecordKey& key, std::uint64_t weight, Note note) {
    weight = std::min(weight, limit_ + 1);  // There is no room for either.
    Origin& origin = origins_[key.stream.origin];
    origin.weight += weight;
    weight_ += weight;
    const RecordAge age = AgeOf(key);
    std::vector<Removed> removed;
    if (origin.newest_left_out && age < *origin.newest_left_out) {
      ++origin.left_out_count;
      removed.push_back({key, std::move(note)});
    } else {
      origin.kept.emplace(age, Kept{weight, std::move(note)});
      origin.kept_weight += weight;
    }
    if (weight_ > limit_) {
      UpdateLevel();
      for (auto& [agent, of_agent] : origins_) Cut(agent, of_agent, removed);
    }
    return removed;
  }

  // Adds the number of records without room, of each origin that has such.
  void CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const {
    for (const auto& [agent, origin] : origins_) {
      if (origin.left_out_count > 0) counts[agent] += origin.left_out_count;
    }
  }

 private:
  struct Kept {
    std::uint64_t weight = 0;
    Note note;
  };

  struct Origin {
    std::uint64_t weight = 0;  // All records that were added.
    std::uint64_t left_out_count = 0;
    std::optional<RecordAge> newest_left_out;  // Nothing that is older has room.
    std::map<RecordAge, Kept> kept;
    std::uint64_t kept_weight = 0;
  };

  void UpdateLevel() {
    std::vector<std::uint64_t> weights;
    for (const auto& [agent, origin] : origins_) weights.push_back(origin.weight);
    std::sort(weights.begin(), weights.end());
    std::uint64_t left = limit_;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      level_ = left / (weights.size() - i);
      if (weights[i] > level_) return;
      left -= weights[i];
    }
  }

  void Cut(AgentId agent, Origin& origin, std::vector<Removed>& removed) {
    while (origin.kept_weight > level_) {
      auto oldest = origin.kept.begin();
      const auto& [epoch, seq, type] = oldest->first;
      removed.push_back({{{agent, epoch, type}, seq}, std::move(oldest->second.note)});
      origin.newest_left_out = oldest->first;
      ++origin.left_out_count;
      origin.kept_weight -= oldest->second.weight;
      origin.kept.erase(oldest);
    }
  }

  std::uint64_t limit_;
  std::uint64_t weight_ = 0;  // All records that were added.
  std::uint64_t level_ = 0;   // Once they do not fit.
  std::map<AgentId, Origin> origins_;
};

}  // namespace moondb
