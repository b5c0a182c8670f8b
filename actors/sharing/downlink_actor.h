// DownlinkActor ("downlink"): packs records that a ground station lacks into bundles, which are files of a given size.
// The files reach the ground station by means outside moondb, such as a relay satellite's pass or a memory stick.
//
//   DownlinkRequest{bytes_max}     Makes the next bundle from the records that `ground` of the team file asks for and
//                                  that are in no earlier bundle, most urgent class first, until the file is full.
//                                  Storage keeps the file.
//   DownlinkRequest{acknowledge}   Reports that the ground station has this bundle. Deletes the bundle's
//                                  file; its records count as downlinked.
//   DownlinkRequest{}              Lists the bundles that wait for an acknowledgment.
//
// A bundle does not change until it is acknowledged, and no record is in two bundles. At most kBundlesWaitingMax
// bundles wait. Bundle numbers count from 1, and start at 1 again after the disk was lost, so a bundle is identified by
// its number and its hash together.
//
// Accepts requests only from actors of this agent. Serves one request at a time, from a queue of at most orders_max
// requests. Requests fail with these errors.
//   `kInvalid`: the size is outside the limits of actors/sharing/bundle_file.h or too small for the next record, or the
//       request has both fields.
//   `kRefused`: `ground` asks for no records, or too many bundles wait for an acknowledgment.
//   `kNotFound`: there is no such bundle.
//   `kFull`: too many requests wait, or storage's mailbox is full.
//   `kTimedOut`: storage did not answer.
//   `kUnavailable`: storage could not read the missing records.
//   Errors of storage are passed on.
#pragma once

#include <deque>
#include <optional>

#include "actors/sharing/bundle_file.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb {

inline constexpr int kBundlesWaitingMax = 16;

class DownlinkActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // The validated team configuration.
    std::size_t orders_max = 16;
    Duration timeout = std::chrono::seconds(60);  // How long to wait for each answer of storage.
  };

  explicit DownlinkActor(Options options) : options_(std::move(options)) {}

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  struct Order {
    Address requester;
    std::uint64_t request_id = 0;
    proto::DownlinkRequest request;
  };

  void OnOrder(Context& context, const proto::Message& message);
  void BeginNext(Context& context);
  void OnLoaded(Context& context, const proto::LoadBundlesReply& reply);
  void OnMissing(Context& context, const proto::MissingReply& reply);
  void OnSaved(Context& context, const proto::SaveBundleReply& reply);
  void Load(Context& context);
  void RequestRecords(Context& context);
  void Fill(Context& context, const proto::MissingReply& reply);
  void Save(Context& context);
  void Ask(Context& context, proto::Message message);
  void EndWithError(Context& context, const Error& error);
  void End(Context& context);  // Replies to the current order and starts the next one.

  const Options options_;
  std::deque<Order> orders_;  // The first order is the current one.
  // The members below describe the state of the current order.
  std::uint64_t question_ = 0;  // Id of the last request to storage.
  TimerId timer_ = 0;
  proto::DownlinkReply reply_;
  HaveSet taken_;                       // Records that are in bundles, including the new bundle.
  std::optional<BundleWriter> writer_;  // Set while a new bundle is being made.
  proto::DownlinkBundle bundle_;        // Description of the new bundle.
};

}  // namespace moondb
