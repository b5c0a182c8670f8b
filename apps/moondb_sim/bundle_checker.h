// BundleChecker: checks that one simulated agent's bundles for the ground station behave as docs/commands/downlink.md
// says. It sees only the requests and answers of the client that orders, fetches and acknowledges the bundles.
//
// - bundle_kept: A bundle stays available and unchanged until it is acknowledged, across restarts of the process.
// - bundle_once: No record is in two bundles. When the team is quiescent, each record that the ground station wants is
//   in one bundle.
//
// A checker covers one disk: OnDiskLost resets it.
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
  using Broken = std::optional<std::pair<std::string, std::string>>;  // Name of the violated invariant, and a text.

  void OnDiskLost();
  void OnRestart() { ++boot_; }

  // Called when the client sends `request`. Until the answer arrives, the effect of the request is unknown.
  void OnAsked(const proto::DownlinkRequest& request);
  // Checks an answer. `is_at_once` means that nothing else happened between the request and the answer.
  Broken OnReply(const proto::DownlinkRequest& request, const proto::DownlinkReply& reply, bool is_at_once);
  // Checks an error answer to an acknowledgement: the agent claims that it knows no bundle of this number.
  Broken OnNotFound(std::uint32_t number) const;
  // Checks the complete file of a bundle. Returns null if this checker does not know the bundle.
  Broken OnFile(std::uint32_t number, const std::string& file);

  // Returns the number of a bundle that was fetched and that no request has acknowledged yet; 0 if none.
  std::uint32_t FetchedBundle() const;
  // Returns the number of an unacknowledged bundle whose file was not fetched yet; 0 if none.
  std::uint32_t UnknownBundle() const;
  // Returns whether the agent's process has restarted since the bundle was first reported.
  bool OutlivedProcess(std::uint32_t number) const;

  // Checks that every record of `wanted` is in a bundle. Requires: the team is quiescent. Returns null if all are. Also
  // returns null after OnDiskLost, because a restored older disk may know bundles that this checker does not know.
  Broken WhyLost(const HaveSet& wanted) const;

 private:
  struct Bundle {
    std::uint64_t hash = 0;
    std::uint64_t boot = 0;  // Value of `boot_` when the bundle was first reported.
    std::optional<HaveSet> have;
    bool may_be_acknowledged = false;
    bool is_acknowledged = false;
  };

  Broken Add(const proto::DownlinkBundle& bundle);
  Broken CheckWaiting(const proto::DownlinkReply& reply) const;

  std::map<std::uint32_t, Bundle> bundles_;  // Bundles by number.
  std::uint64_t boot_ = 0;
  bool was_disk_lost_ = false;
};

}  // namespace moondb::simulation
