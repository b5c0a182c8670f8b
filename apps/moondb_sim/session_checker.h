// SessionChecker: tracks the unacknowledged batches that one agent sends to another in their present session. It uses
// only the messages of both agents, not the session's own state.
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

  // Called when the sender sends a Hello or a batch. OnBatch returns each violated invariant with a text:
  // unacked_bounded, end_is_last, or nothing_refused for a batch that does not decode.
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
  // Decoders of the sent batches. They receive every batch, in the order of sending.
  FragmentCollector fragments_{2 * kWholeBytesMax};
  RunDecoders runs_{1, {}};
  // Compression run of the last fragmented record that cannot be decoded, because this session did not send all its
  // fragments. Batches of this run cannot be decoded either. 0: none.
  std::uint32_t unheard_run_ = 0;
};

}  // namespace moondb::simulation
