// BundleChecker: checks that one simulated agent's bundles for the ground station behave as docs/commands/downlink.md
// says. It uses only the requests and answers of the client that orders, fetches and acknowledges the bundles.
//
// - bundle_kept: A bundle stays available and unchanged until it is acknowledged, across restarts of the process.
// - bundle_once: No record is in two bundles. When the team is quiescent, each record that the ground station wants is
//   in one bundle.
//
// OnDiskLost resets the checker, because bundles are lost with the disk.
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
  // Name and description of the violated invariant; null if none is violated.
  using Broken = std::optional<std::pair<std::string, std::string>>;

  void OnDiskLost();
  void OnRestart() { ++boot_; }

  // Called when the client sends `request`. Until the answer arrives, the effect of the request is unknown.
  void OnAsked(const proto::DownlinkRequest& request);
  // Checks a successful answer. Returns a violated invariant; null if there is none. `is_at_once` means that nothing
  // else happened between the request and the answer.
  Broken OnReply(const proto::DownlinkRequest& request, const proto::DownlinkReply& reply, bool is_at_once);
  // Call if the agent answers an acknowledgement of bundle `number` with kNotFound. Returns bundle_kept if the agent
  // once listed this bundle; null otherwise.
  Broken OnNotFound(std::uint32_t number) const;
  // Checks the complete file of a bundle. Returns the violated invariant; null if the file is correct, or if the agent
  // never listed the bundle.
  Broken OnFile(std::uint32_t number, const std::string& file);

  // Returns the number of a fetched bundle that no request has acknowledged yet; 0 if there is none.
  std::uint32_t FetchedBundle() const;
  // Returns the number of an unacknowledged bundle whose file was not fetched yet; 0 if there is none.
  std::uint32_t UnknownBundle() const;
  // Returns whether the agent's process has restarted since the agent first listed the bundle.
  bool OutlivedProcess(std::uint32_t number) const;

  // Returns bundle_once if a record held in `wanted` is in no fetched bundle; null otherwise. Requires: the team is
  // quiescent. After OnDiskLost, always returns null: a restored older disk may have bundles that this checker does not
  // know.
  Broken WhyLost(const HaveSet& wanted) const;

 private:
  struct Bundle {
    std::uint64_t hash = 0;
    std::uint64_t boot = 0;  // Value of `boot_` when the agent first listed the bundle.
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
