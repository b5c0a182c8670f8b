// SessionChecker: what one agent has handed over to another in its present session and has not heard of again, as one
// who listens to both knows it, without the session's own word for it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "actors/sharing/codec.h"
#include "actors/sharing/fragments.h"
#include "actors/sharing/run_decoders.h"
#include "actors/sharing/sharing_session.h"
#include "model/have_set.h"
#include "proto/message.pb.h"

namespace moondb::simulation {

class SessionChecker {
 public:
  explicit SessionChecker(SharingSession::Options limits = {}) : limits_(limits) {}

  // The sender sends these. What is wrong with a batch, each broken rule with a text: unacked_bounded, end_is_last; one
  // that does not decode breaks nothing_refused.
  void OnHello(const proto::Hello& hello);
  std::vector<std::pair<std::string, std::string>> OnBatch(const proto::Message& message);
  // The sender handles it.
  void OnHave(const proto::Have& have);

 private:
  struct Handed {
    std::vector<RecordKey> keys;
    std::size_t bytes = 0;
  };
  Result<Handed> Open(const proto::Message& message);
  bool IsCovered(const Handed& batch) const;

  SharingSession::Options limits_;
  std::uint64_t session_id_ = 0;
  HaveSet have_;  // Of the receiver, as the sender heard it.
  std::map<std::uint32_t, Handed> in_flight_;
  // All that was sent is decoded, in its order.
  FragmentCollector fragments_{2 * kWholeBytesMax};
  RunDecoders runs_{1, {}};
  std::uint32_t unheard_run_ = 0;  // It began in pieces, some of which were not sent to here.
};

}  // namespace moondb::simulation
