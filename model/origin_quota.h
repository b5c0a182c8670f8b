// OriginQuota: divides a limited total weight of records fairly among the origins of the records (max-min fairness). A
// reader of records uses it to limit its memory.
//
// Each record has a weight (1, or its bytes). The level is the maximum weight per origin: the highest value at which
// the kept records of all origins together fit into the limit. An origin whose records together weigh more than the
// level keeps only its newest records, those with the highest (epoch, seq). A record that is kept "has room". The
// result depends only on the set of records, not on their order of arrival. A record that has lost its room never
// regains it.
//
// `Note` is the type of the caller's data about a record, returned when the record loses its room. Not thread-safe.
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

// Sort key for the order in which an origin created its records: epoch, seq, type.
using RecordAge = std::tuple<std::uint64_t, std::uint64_t, DataType>;
inline RecordAge AgeOf(const RecordKey& key) { return {key.stream.epoch, key.seq, key.stream.type}; }

// Returns the highest level at which weights that are cut to the level have a sum of at most `limit`: the largest
// weight if all of them fit (max-min fairness). `limit` if there is no weight.
inline std::uint64_t FairLevel(std::vector<std::uint64_t> weights, std::uint64_t limit) {
  std::sort(weights.begin(), weights.end());
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const std::uint64_t level = limit / (weights.size() - i);
    if (weights[i] > level) return level;
    limit -= weights[i];
  }
  return weights.empty() ? limit : weights.back();
}

template <typename Note>
class OriginQuota {
 public:
  struct Removed {
    RecordKey key;
    Note note;
  };

  // `limit`: maximum total weight of the records that have room. `of_origin_max`: maximum weight of one origin, even if
  // the others leave room. Requires: `limit` is below 2^48, and fewer than 2^15 records with a weight above `limit` are
  // added; otherwise sums overflow.
  explicit OriginQuota(std::uint64_t limit, std::uint64_t of_origin_max = UINT64_MAX)
      : limit_(limit), level_(of_origin_max), of_origin_max_(of_origin_max) {}

  // Adds a record. Returns the records that lose their room because of the new record, which may itself be among them.
  // Requires: the record was not added before.
  std::vector<Removed> Add(const RecordKey& key, std::uint64_t weight, Note note) {
    weight = std::min(weight, limit_ + 1);  // A weight above the limit never fits; cap it to avoid overflow.
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
    } else {
      Cut(key.stream.origin, origin, removed);
    }
    return removed;
  }

  // Adds to `counts`, per origin, the number of records that have no room.
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
    std::uint64_t weight = 0;  // Total weight of all records added, including those that have no room.
    std::uint64_t left_out_count = 0;
    std::optional<RecordAge> newest_left_out;  // The newest record without room; no older record has room.
    std::map<RecordAge, Kept> kept;
    std::uint64_t kept_weight = 0;
  };

  void UpdateLevel() {
    std::vector<std::uint64_t> weights;
    for (const auto& [agent, origin] : origins_) weights.push_back(origin.weight);
    level_ = std::min(FairLevel(std::move(weights), limit_), of_origin_max_);
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
  std::uint64_t weight_ = 0;  // Total weight of the records added for all origins.
  std::uint64_t level_;       // Maximum weight per origin. of_origin_max_ until weight_ exceeds limit_.
  std::uint64_t of_origin_max_;
  std::map<AgentId, Origin> origins_;
};

}  // namespace moondb
