// BundleChecker: whether one simulated agent's bundles for the ground are what docs/DOWNLINK.md says of them, as the
// client knows it who orders, fetches and acknowledges them:
//
//   bundle_kept  a bundle that was made waits, unchanged, until it is acknowledged, whatever happens to the process
//   bundle_once  no record is in two bundles; at rest each record that the ground wants is in one
//
// Of one disk: OnDiskLost begins anew.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "model/have_set.h"
#include "proto/control.pb.h"

namespace moondb::simulation {

class BundleChecker {
 public:
  using Broken = std::optional<std::pair<std::string, std::string>>;  // Rule and text.

  void OnDiskLost();
  void OnRestart() { ++boot_; }

  // It was asked for this, and whether it will do it is not known before the answer.
  void OnAsked(const proto::DownlinkRequest& request);
  // `is_at_once`: nothing happened between question and answer.
  Broken OnReply(const proto::DownlinkRequest& request, const proto::DownlinkReply& reply, bool is_at_once);
  // The ground asked it to acknowledge the bundle, and got an error that says that there is none of that number.
  Broken OnNotFound(std::uint32_t number) const;
  // The file of a bundle that is known here.
  Broken OnFile(std::uint32_t number, const std::string& file);

  // One that waits and was fetched; 0: none.
  std::uint32_t FetchedBundle() const;
  // One whose file is not known here yet; 0: none.
  std::uint32_t UnknownBundle() const;
  // The bundle was made in an earlier life of the process, and is acknowledged now.
  bool OutlivedProcess(std::uint32_t number) const;

  // At rest, all that the ground wants was packed: what of `wanted` is in no bundle. Nothing where the disk was lost:
  // an older one may know of bundles that nobody here does.
  Broken WhyLost(const HaveSet& wanted) const;

 private:
  struct Bundle {
    std::uint64_t hash = 0;
    std::uint64_t boot = 0;  // Of the process that made it, or showed it first.
    std::optional<HaveSet> have;
    bool may_be_acknowledged = false;
    bool is_acknowledged = false;
  };

  Broken Add(const proto::DownlinkBundle& bundle);
  Broken CheckWaiting(const proto::DownlinkReply& reply) const;

  std::map<std::uint32_t, Bundle> bundles_;  // By number.
  std::uint64_t boot_ = 0;
  bool was_disk_lost_ = false;
};

}  // namespace moondb::simulation
