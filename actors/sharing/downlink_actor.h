// DownlinkActor ("downlink"): packs what this agent holds and the ground lacks into bundles, files of a given size that
// somebody else carries there (a relay satellite's pass, a memory stick).
//
//   DownlinkRequest{bytes_max}     makes the next bundle: what `ground` of the team file asks for and no bundle has
//                                  held, most urgent class first, until the file is full. Storage keeps it.
//   DownlinkRequest{acknowledge}   the ground has that bundle: its file goes. What was in it counts as downlinked.
//   DownlinkRequest{}              shows what waits.
//
// A bundle that was not acknowledged stays as it is, however often it is fetched (ReadBundleRequest, to storage), and
// its records are in no other. At most kBundlesWaitingMax wait. Numbers count from 1 within one life of the store:
// after a lost disk they begin anew, so that a bundle's hash says whether two are the same.
//
// From actors of this agent alone; one order at a time, and a few that wait. Errors: kInvalid (a size beyond the limits
// of actors/sharing/bundle_file.h, or too small for the next record; both fields), kRefused (`ground` asks for nothing;
// too many bundles wait), kNotFound (no such bundle), kFull (too many orders), kTimedOut (storage), or storage's own.
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
    proto::TeamConfig team;  // Complete and checked.
    std::size_t orders_max = 16;
    Duration timeout = std::chrono::seconds(60);  // Of storage, for each answer.
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
  void AskForRecords(Context& context);
  void Fill(Context& context, const proto::MissingReply& reply);
  void Save(Context& context);
  void Ask(Context& context, proto::Message message);
  void EndWithError(Context& context, const Error& error);
  void End(Context& context);  // Answers, and goes on to the next order.

  const Options options_;
  std::deque<Order> orders_;  // The first is being worked on.
  // What belongs to the order that is being worked on.
  std::uint64_t question_ = 0;  // To storage, whose answer is waited for.
  TimerId timer_ = 0;
  proto::DownlinkReply reply_;
  HaveSet taken_;                       // In bundles, the one being made included.
  std::optional<BundleWriter> writer_;  // While it is being filled.
  proto::DownlinkBundle bundle_;        // The one being made.
};

}  // namespace moondb
