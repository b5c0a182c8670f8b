#include "actors/storage/missing_records.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <vector>

#include "actors/storage/peer_authority.h"
#include "actors/storage/record_tables.h"

namespace moondb {

namespace {

constexpr std::size_t kDroppedIntervalBytes = 12;  // Approximate size of one interval on the wire.
constexpr std::size_t kDroppedIntervalsMin = 16;

bool Contains(const google::protobuf::RepeatedField<std::uint32_t>& values, std::uint32_t value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

class MissingFinder {
 public:
  MissingFinder(Database& database, const HaveSet& have, const SharingRules& rules, bool brings_others,
                const HaveSet* marked, const proto::RecordFilter& filter, const HaveSet& destination)
      : database_(database),
        have_(have),
        rules_(rules),
        brings_others_(brings_others),
        marked_(marked),
        filter_(filter),
        destination_(destination) {}

  Result<void> AddRecords(std::uint64_t bytes_max, std::uint64_t records_max, proto::MissingReply& reply) {
    for (const StreamKey& stream : StreamsInOrder()) {
      const Result<IntervalSet> lacking = Lacking(stream);
      if (!lacking) return tl::unexpected(lacking.error());
      for (const IntervalSet::Interval& interval : lacking->intervals()) {
        const Result<void> added = AddInterval(stream, interval, bytes_max, records_max, reply);
        if (!added) return added;
      }
    }
    return {};
  }

  void AddDropped(std::size_t intervals_max, proto::MissingReply& reply) const {
    for (const StreamKey& stream : StreamsInOrder()) {
      if (!rules_.MayBeDropped(stream.type) || IsPartial(stream) || IsNewestOnly(stream)) continue;
      const IntervalSet unknown = have_.Get(stream).dropped.Minus(destination_.Get(stream).dropped);
      if (unknown.is_empty() || intervals_max == 0) continue;
      proto::StreamHave& added = *reply.add_dropped();
      added.set_origin_agent(stream.origin);
      added.set_epoch(stream.epoch);
      added.set_data_type(stream.type);
      for (const IntervalSet::Interval& interval : unknown.intervals()) {
        if (intervals_max == 0) break;
        --intervals_max;
        added.add_dropped()->set_first(interval.first);
        added.mutable_dropped()->rbegin()->set_last(interval.last);
      }
    }
  }

 private:
  bool IsWanted(const StreamKey& stream) const {
    if (!rules_.IsShared(stream) || !FindRecordTable(stream.type)) return false;
    const bool is_taken = brings_others_ || stream.origin == rules_.self || PeerAuthority::IsSignedType(stream.type);
    if (!is_taken) return false;
    if (Contains(filter_.not_data_types(), stream.type)) return false;
    if (IsOwn(stream)) return true;
    if (Contains(filter_.everyones_types(), stream.type)) return true;
    if (!filter_.origin_agents().empty() && !Contains(filter_.origin_agents(), stream.origin)) return false;
    if (Contains(filter_.not_origin_agents(), stream.origin)) return false;
    return filter_.data_types().empty() || Contains(filter_.data_types(), stream.type);
  }

  bool IsOwn(const StreamKey& stream) const { return stream.origin == filter_.own_records_of(); }

  bool IsNewestOnly(const StreamKey& stream) const {
    return Contains(filter_.newest_only_types(), stream.type) && !IsOwn(stream);
  }

  // Returns the seqs of the stream that pass the filter and that the destination lacks.
  Result<IntervalSet> Lacking(const StreamKey& stream) {
    IntervalSet lacking = have_.Get(stream).held.Minus(destination_.Get(stream).Covered());
    if (marked_ != nullptr && !rules_.MayBeDropped(stream.type) && !IsNewestOnly(stream)) {
      lacking = lacking.Intersection(marked_->Get(stream).held);
    }
    if (lacking.is_empty() || !IsNewestOnly(stream)) return lacking;
    const std::pair<AgentId, DataType> series(stream.origin, stream.type);
    auto found = newest_.find(series);
    if (found == newest_.end()) {
      auto newest = FindRecordTable(stream.type)->FindNewest(database_, stream.origin, stream.type);
      if (!newest) return tl::unexpected(newest.error());
      found = newest_.emplace(series, *std::move(newest)).first;
    }
    return lacking.Intersection(found->second[stream.epoch]);
  }

  // Returns true if only some of the stream's records pass the filter.
  bool IsPartial(const StreamKey& stream) const { return AgentMeant(stream) != 0; }

  // Returns the agent to whose poses and verdicts the filter limits this stream; 0 if the filter has no such limit.
  AgentId AgentMeant(const StreamKey& stream) const {
    const bool is_limited = FindRecordTable(stream.type)->knows_agent() && !IsOwn(stream) &&
                            !Contains(filter_.everyones_types(), stream.type);
    return is_limited ? filter_.optimized_poses_of_agent() : 0;
  }

  std::vector<StreamKey> StreamsInOrder() const {
    std::vector<StreamKey> streams;
    for (const auto& [key, stream] : have_.streams()) {
      if (IsWanted(key)) streams.push_back(key);
    }
    std::sort(streams.begin(), streams.end(), [this](const StreamKey& a, const StreamKey& b) {
      return std::tuple(rules_.RankOf(a.type), a.epoch, a.type, a.origin) <
             std::tuple(rules_.RankOf(b.type), b.epoch, b.type, b.origin);
    });
    return streams;
  }

  // Adds records of the interval to the reply until a limit is reached. Adds the number of records that did not fit to
  // the reply's field `remaining`.
  Result<void> AddInterval(const StreamKey& stream, const IntervalSet::Interval& interval, std::uint64_t bytes_max,
                           std::uint64_t records_max, proto::MissingReply& reply) {
    const RecordTable& table = *FindRecordTable(stream.type);
    std::uint64_t next_seq = interval.first;
    if (!is_full_) {
      Query query = table.ReadInterval(database_, stream, interval.first, interval.last, AgentMeant(stream));
      while (true) {
        const Result<bool> row = query.Step();
        if (!row) return tl::unexpected(row.error());
        if (!*row) return {};
        proto::StoredRecord record = table.Read(query);
        next_seq = record.key().seq();
        const bool fits = bytes_ + record.content().size() <= bytes_max &&
                          static_cast<std::uint64_t>(reply.records_size()) < records_max;
        if (!fits && reply.records_size() > 0) break;
        bytes_ += record.content().size();
        *reply.add_records() = std::move(record);
      }
      is_full_ = true;
    }
    std::uint64_t left = interval.last - next_seq + 1;
    if (IsPartial(stream)) {
      const Result<std::uint64_t> count =
          table.CountInterval(database_, stream, next_seq, interval.last, AgentMeant(stream));
      if (!count) return tl::unexpected(count.error());
      left = *count;
    }
    reply.set_remaining(reply.remaining() + left);
    if (left == 0) return {};
    const bool is_known = !reply.backlog().empty() && reply.backlog().rbegin()->data_type() == stream.type;
    proto::TypeBacklog& backlog = is_known ? *reply.mutable_backlog()->rbegin() : *reply.add_backlog();
    backlog.set_data_type(stream.type);
    backlog.set_records(backlog.records() + static_cast<double>(left));
    return {};
  }

  Database& database_;
  const HaveSet& have_;
  const SharingRules& rules_;
  const bool brings_others_;
  const HaveSet* const marked_;
  const proto::RecordFilter& filter_;
  const HaveSet& destination_;
  // Newest seqs of each (origin, type), by epoch.
  std::map<std::pair<AgentId, DataType>, std::map<std::uint64_t, IntervalSet>> newest_;
  std::uint64_t bytes_ = 0;
  bool is_full_ = false;
};

std::uint32_t Limit(std::uint32_t asked, std::uint32_t standard, std::uint32_t max) {
  return asked == 0 ? standard : std::min(asked, max);
}

}  // namespace

Result<proto::MissingReply> FindMissing(Database& database, const HaveSet& have, const SharingRules& rules,
                                        bool brings_others, const HaveSet* marked,
                                        const proto::MissingRequest& request) {
  const Result<HaveSet> destination = FromProto(request.destination_have());
  if (!destination) return tl::unexpected(destination.error());
  const std::uint32_t bytes_max = Limit(request.content_bytes_max(), kMissingBytesDefault, kMissingBytesMax);
  const std::uint32_t records_max = Limit(request.records_max(), kMissingRecordsDefault, kMissingRecordsMax);
  MissingFinder finder(database, have, rules, brings_others, marked, request.filter(), *destination);
  proto::MissingReply reply;
  if (const Result<void> added = finder.AddRecords(bytes_max, records_max, reply); !added) {
    return tl::unexpected(added.error());
  }
  if (reply.remaining() == 0) {
    finder.AddDropped(std::max<std::size_t>(bytes_max / kDroppedIntervalBytes, kDroppedIntervalsMin), reply);
  }
  return reply;
}

}  // namespace moondb
