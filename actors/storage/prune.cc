#include "actors/storage/prune.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "actors/storage/bundle_shelf.h"
#include "actors/storage/clock_judge.h"
#include "model/prune_rules.h"
#include "proto/downlink.pb.h"
#include "proto/retention.pb.h"

namespace moondb {

namespace {

constexpr double kNanosecondsPerSecond = 1e9;

bool IsNumber(double value) { return value >= 0 && std::isfinite(value); }

Result<std::vector<HaveSet>> ReadAcknowledged(const proto::PruneRequest& request) {
  std::vector<HaveSet> acknowledged;
  for (const proto::HaveSet& reported : request.acknowledged()) {
    Result<HaveSet> have = FromProto(reported);
    if (!have) return tl::unexpected(have.error());
    acknowledged.push_back(*std::move(have));
  }
  if (acknowledged.empty())
    return Fail(ErrorCode::kInvalid, "no other agent has reported its have-set", "acknowledged");
  return acknowledged;
}

class Chooser {
 public:
  Chooser(Database& database, const SharingRules& rules, const proto::PruneRequest& request,
          std::vector<HaveSet> acknowledged, std::optional<HaveSet> bundled, std::int64_t utc_now_ns)
      : database_(database),
        rules_(rules),
        request_(request),
        acknowledged_(std::move(acknowledged)),
        bundled_(std::move(bundled)) {
    if (request.older_than_s() > 0) {
      timestamp_before_ns_ = utc_now_ns - static_cast<std::int64_t>(request.older_than_s() * kNanosecondsPerSecond);
    }
    for (const proto::RecordKey& key : request.records()) {
      if (key.seq() >= 1 && key.seq() <= kSeqMax) named_[FromProto(key).stream].held.Add(key.seq());
    }
  }

  Result<PruneChoice> Choose(const HaveSet& have) {
    for (const auto& [stream, in_stream] : have.streams()) {
      if (!IsMeant(stream.type)) continue;
      const IntervalSet meant =
          request_.records().empty() ? in_stream.held : in_stream.held.Intersection(named_.Get(stream).held);
      IntervalSet acknowledged = meant;
      for (const HaveSet& peer : acknowledged_) acknowledged = acknowledged.Intersection(peer.Get(stream).Covered());
      if (bundled_ && rules_.for_ground.contains(stream.type)) {
        acknowledged = acknowledged.Intersection(bundled_->Get(stream).Covered());
      }
      if (const Result<void> done = AddCandidates(stream, acknowledged); !done) return tl::unexpected(done.error());
      if (const Result<void> done = CountKept(stream, meant.Minus(acknowledged)); !done) {
        return tl::unexpected(done.error());
      }
    }
    if (const Result<void> done = TakeOldest(); !done) return tl::unexpected(done.error());
    return std::move(choice_);
  }

 private:
  bool IsMeant(DataType type) const {
    if (rules_.PolicyOf(type) != proto::POLICY_ALL || FindRecordTable(type) == nullptr) return false;
    const auto& types = request_.data_types();
    if (types.empty()) return !IsKeptUnlessNamed(type);
    return std::find(types.begin(), types.end(), type) != types.end();
  }

  // Calls `take` for each row of `seqs` that is old enough, until `take` returns false.
  template <typename Take>
  Result<void> VisitOld(const StreamKey& stream, const IntervalSet& seqs, Take take) {
    const RecordTable& table = *FindRecordTable(stream.type);
    for (const IntervalSet::Interval& interval : seqs.intervals()) {
      Query query = table.ReadHeads(database_, stream, interval.first, interval.last);
      while (true) {
        const Result<bool> step = query.Step();
        if (!step) return tl::unexpected(step.error());
        if (!*step) break;
        PruneChoice::Chosen row{&table, query.Integer(2), {}};
        row.row.row_id = query.Unsigned(0);
        row.row.key = {stream, query.Unsigned(1)};
        row.row.content_bytes = query.Unsigned(3);
        // Records from before 2020 were stored when no origin judged their timestamps; their age is unknown.
        const bool is_dated = row.timestamp_ns >= kTimestampMin_ns;
        const bool is_old = !timestamp_before_ns_ || (is_dated && row.timestamp_ns < *timestamp_before_ns_);
        if (is_old && !take(std::move(row))) return {};
      }
    }
    return {};
  }

  // Returns true if the request selects by age and the record's timestamp comes from a suspect clock. Reads the whole
  // record, so call this only for rows that are otherwise selected.
  Result<bool> IsOfUnknownAge(const PruneChoice::Chosen& row) {
    if (!timestamp_before_ns_) return false;
    const Result<proto::Record> record = row.table->ReadRecord(database_, row.row.row_id);
    if (!record) return tl::unexpected(record.error());
    return record->is_clock_suspect();
  }

  Result<void> AddCandidates(const StreamKey& stream, const IntervalSet& seqs) {
    return VisitOld(stream, seqs, [this](PruneChoice::Chosen row) {
      if (choice_.rows.size() < kPruneCandidatesMax) {
        choice_.rows.push_back(std::move(row));
      } else {
        choice_.is_complete = false;
      }
      return choice_.is_complete;
    });
  }

  Result<void> CountKept(const StreamKey& stream, const IntervalSet& seqs) {
    if (!timestamp_before_ns_) {
      choice_.unacknowledged_count += static_cast<double>(seqs.Count());
      return {};
    }
    return VisitOld(stream, seqs, [this](const PruneChoice::Chosen&) {
      ++choice_.unacknowledged_count;
      return true;
    });
  }

  Result<void> TakeOldest() {
    std::vector<PruneChoice::Chosen> candidates = std::exchange(choice_.rows, {});
    std::sort(candidates.begin(), candidates.end(), [](const PruneChoice::Chosen& a, const PruneChoice::Chosen& b) {
      return std::tie(a.timestamp_ns, a.row.key) < std::tie(b.timestamp_ns, b.row.key);
    });
    double bytes = 0;
    for (PruneChoice::Chosen& row : candidates) {
      const auto row_bytes = static_cast<double>(row.row.content_bytes);
      if (request_.content_bytes_max() > 0 && bytes >= request_.content_bytes_max()) {
        choice_.is_complete = true;  // The requested number of bytes is reached.
        break;
      }
      const std::size_t count = choice_.rows.size();
      const bool is_full =
          count == kPruneRowsMax || (count > 0 && bytes + row_bytes > static_cast<double>(kPruneContentBytesMax));
      if (is_full && !request_.is_dry_run()) {
        choice_.is_complete = false;
        break;
      }
      const Result<bool> is_of_unknown_age = IsOfUnknownAge(row);
      if (!is_of_unknown_age) return tl::unexpected(is_of_unknown_age.error());
      if (*is_of_unknown_age) continue;
      bytes += row_bytes;
      choice_.rows.push_back(std::move(row));
    }
    return {};
  }

  Database& database_;
  const SharingRules& rules_;
  const proto::PruneRequest& request_;
  const std::vector<HaveSet> acknowledged_;
  // Records in bundles for a ground station; null if no bundle was ever made.
  const std::optional<HaveSet> bundled_;
  std::optional<std::int64_t> timestamp_before_ns_;
  HaveSet named_;
  PruneChoice choice_;
};

}  // namespace

Result<void> CheckPruneLimits(const proto::PruneRequest& request) {
  if (request.records_size() > kPruneNamedMax) {
    return Fail(ErrorCode::kInvalid, "more than " + std::to_string(kPruneNamedMax) + " records", "records");
  }
  if (!IsNumber(request.older_than_s()) || request.older_than_s() > kPruneAgeMax_s) {
    return Fail(ErrorCode::kInvalid, "must lie between 0 and 1e9 s", "older_than_s");
  }
  if (!IsNumber(request.content_bytes_max())) {
    return Fail(ErrorCode::kInvalid, "must not be negative", "content_bytes_max");
  }
  return {};
}

Result<PruneChoice> ChooseToPrune(Database& database, const HaveSet& have, const SharingRules& rules,
                                  const proto::PruneRequest& request, std::int64_t utc_now_ns) {
  if (const Result<void> checked = CheckPruneLimits(request); !checked) return tl::unexpected(checked.error());
  Result<std::vector<HaveSet>> acknowledged = ReadAcknowledged(request);
  if (!acknowledged) return tl::unexpected(acknowledged.error());
  std::optional<HaveSet> bundled;
  Result<proto::LoadBundlesReply> bundles;
  // Only records of the types in for_ground have to be in a bundle.
  if (!rules.for_ground.empty()) bundles = LoadBundles(database);
  if (!bundles) return tl::unexpected(bundles.error());
  if (bundles->last_number() > 0) {
    Result<HaveSet> taken = FromProto(bundles->taken());
    if (!taken) return tl::unexpected(taken.error());
    bundled = *std::move(taken);
  }
  return Chooser(database, rules, request, *std::move(acknowledged), std::move(bundled), utc_now_ns).Choose(have);
}

}  // namespace moondb
