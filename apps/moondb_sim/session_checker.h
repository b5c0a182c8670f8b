// SessionChecker: tracks the unacknowledged batches in the present session of one agent's actor with another agent, and
// checks the limits of the session. It uses only messages, not the session's own state.
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

  // Call when the sender sends a Hello or a batch. OnBatch returns name and description of each violated invariant:
  // unacked_bounded, end_is_last, or nothing_refused if the batch cannot be decoded.
  void OnHello(const proto::Hello& hello);
  std::vector<std::pair<std::string, std::string>> OnBatch(const proto::Message& message);
  // Called when the sender handles an acknowledgement.
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
  HaveSet have_;  // The receiver's have-set, as the sender knows it.
  std::map<std::uint32_t, Handed> in_flight_;
  // `fragments_` and `runs_` decode all sent batches, in the order of sending.
  FragmentCollector fragments_{2 * kWholeBytesMax};
  RunDecoders runs_{1, {}};
  // Compression run of the last fragmented record that could not be decoded, because the present session did not send
  // all fragments of the record; 0 if there is none. Other batches of this run cannot be decoded either.
  std::uint32_t unheard_run_ = 0;
};

}  // namespace moondb::simulation
