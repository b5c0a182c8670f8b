#include "apps/moondb_sim/bundle_checker.h"

#include <algorithm>

#include "actors/sharing/bundle_file.h"
#include "model/record_key.h"

namespace moondb::simulation {
namespace {

std::string BundleNameOf(std::uint32_t number) { return "bundle " + std::to_string(number); }

}  // namespace

void BundleChecker::OnDiskLost() {
  bundles_.clear();
  was_disk_lost_ = true;
}

void BundleChecker::OnAsked(const proto::DownlinkRequest& request) {
  const auto bundle = bundles_.find(request.acknowledge());
  if (bundle != bundles_.end()) bundle->second.may_be_acknowledged = true;
}

BundleChecker::Broken BundleChecker::OnReply(const proto::DownlinkRequest& request, const proto::DownlinkReply& reply,
                                             bool is_at_once) {
  if (reply.has_made() && bundles_.contains(reply.made().number())) {
    return std::pair("bundle_kept", BundleNameOf(reply.made().number()) + " is made a second time");
  }
  const auto acknowledged = bundles_.find(request.acknowledge());
  if (acknowledged != bundles_.end()) acknowledged->second.is_acknowledged = true;
  if (is_at_once) {
    if (Broken broken = CheckWaiting(reply)) return broken;
  }
  for (const proto::DownlinkBundle& bundle : reply.waiting()) {
    if (Broken broken = Add(bundle)) return broken;
  }
  return std::nullopt;
}

BundleChecker::Broken BundleChecker::Add(const proto::DownlinkBundle& bundle) {
  const auto [entry, is_new] = bundles_.try_emplace(bundle.number());
  if (is_new) {
    entry->second.hash = bundle.hash();
    entry->second.boot = boot_;
  }
  if (entry->second.hash == bundle.hash()) return std::nullopt;
  return std::pair("bundle_kept", BundleNameOf(bundle.number()) + " is another one than before");
}

BundleChecker::Broken BundleChecker::CheckWaiting(const proto::DownlinkReply& reply) const {
  for (const auto& [number, bundle] : bundles_) {
    const auto is_it = [number = number](const proto::DownlinkBundle& other) { return other.number() == number; };
    const bool is_waiting = std::any_of(reply.waiting().begin(), reply.waiting().end(), is_it);
    if (bundle.is_acknowledged && is_waiting) {
      return std::pair("bundle_kept", BundleNameOf(number) + " was acknowledged and waits again");
    }
    if (!is_waiting && !bundle.may_be_acknowledged) return std::pair("bundle_kept", BundleNameOf(number) + " is gone");
  }
  return std::nullopt;
}

BundleChecker::Broken BundleChecker::OnNotFound(std::uint32_t number) const {
  if (!bundles_.contains(number)) return std::nullopt;
  return std::pair("bundle_kept",
                   BundleNameOf(number) + " cannot be acknowledged: the agent does not know it any more");
}

BundleChecker::Broken BundleChecker::OnFile(std::uint32_t number, const std::string& file) {
  const auto bundle = bundles_.find(number);
  if (bundle == bundles_.end()) return std::nullopt;
  if (HashOfBundle(file) != bundle->second.hash) return std::pair("bundle_kept", BundleNameOf(number) + " is changed");
  const Result<proto::BundleFile> head = ReadBundle(file, [](const proto::StoredRecord&) { return Result<void>(); });
  if (!head) return std::pair("bundle_kept", BundleNameOf(number) + ": " + ToString(head.error()));
  const Result<HaveSet> have = FromProto(head->have());
  if (!have) return std::pair("bundle_kept", BundleNameOf(number) + ": " + ToString(have.error()));
  for (const auto& [other_number, other] : bundles_) {
    if (other_number == number || !other.have) continue;
    for (const auto& [stream, seqs] : have->streams()) {
      const IntervalSet& packed = other.have->Get(stream).held;
      const IntervalSet twice = seqs.held.Intersection(packed);
      if (twice.is_empty()) continue;
      return std::pair("bundle_once", ToString(RecordKey{stream, twice.Max()}) + " is in " + BundleNameOf(number) +
                                          " and in " + BundleNameOf(other_number));
    }
  }
  bundle->second.have = *have;
  return std::nullopt;
}

std::uint32_t BundleChecker::FetchedBundle() const {
  for (const auto& [number, bundle] : bundles_) {
    if (bundle.have && !bundle.may_be_acknowledged) return number;
  }
  return 0;
}

std::uint32_t BundleChecker::UnknownBundle() const {
  for (const auto& [number, bundle] : bundles_) {
    if (!bundle.have && !bundle.may_be_acknowledged) return number;
  }
  return 0;
}

bool BundleChecker::OutlivedProcess(std::uint32_t number) const {
  const auto bundle = bundles_.find(number);
  return bundle != bundles_.end() && bundle->second.boot < boot_;
}

BundleChecker::Broken BundleChecker::WhyLost(const HaveSet& wanted) const {
  if (was_disk_lost_) return std::nullopt;
  HaveSet packed;
  for (const auto& [number, bundle] : bundles_) {
    if (bundle.have) packed.Merge(*bundle.have);
  }
  for (const auto& [stream, seqs] : wanted.streams()) {
    const IntervalSet lacking = seqs.held.Minus(packed.Get(stream).held);
    if (lacking.is_empty()) continue;
    return std::pair("bundle_once", ToString(RecordKey{stream, lacking.Max()}) + " and " +
                                        std::to_string(lacking.Count() - 1) + " more are in no bundle");
  }
  return std::nullopt;
}

}  // namespace moondb::simulation
