// SharingReceiver: the receiving side of all sessions of one kind. With SharingSession it implements anti-entropy: the
// receiver reports its have-set (a version vector whose entries are interval sets), and the sender sends the missing
// records. Delivery is at least once; storing a record again has no effect.
//
//   Hello -> HaveRequest to storage -> Have (one page of the have-set) to the sender
//   Batch -> decoded -> StoreRequest to storage -> StoreReply after the commit -> Have (touched streams), which
//            acknowledges the batch
//
// Holds no durable state; everything stored is visible in the have-set. Each sender has one session, which a newer
// Hello replaces. The sender requests each page of the have-set (model/have_page.h) with a Hello. Sessions, waiting
// StoreRequests per sender, coded bytes and decoded bytes are all bounded.
//
// A batch of an unknown session is refused with kNotFound, so its sender starts over at once. A damaged batch is
// counted and dropped. A batch may come from any agent of the team, whatever its role or term; storage decides which
// records of the batch to accept (actors/storage/peer_authority.h).
//
// A state machine: each input returns the messages to send, and the caller passes the time. Not thread-safe. Requires:
// the caller checked that the sender belongs to the team.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actors/sharing/codec.h"
#include "actors/sharing/decode_budget.h"
#include "actors/sharing/fragments.h"
#include "actors/sharing/run_decoders.h"
#include "actors/sharing/sharing_action.h"
#include "model/error.h"
#include "model/have_page.h"
#include "model/record_key.h"
#include "model/type_schema.h"
#include "proto/message.pb.h"

namespace moondb {

class SharingReceiver {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  struct Options {
    std::string team;     // Name of the team, for error texts.
    std::string team_id;  // The team's id on the wire (model/team_id.h). A Hello with another id is refused.
    std::uint64_t config_hash = 0;
    proto::SharingKind kind = proto::SHARING_KIND_SYNC;
    std::uint32_t unacked_bytes_max = 8 * 1024;  // Credit in bytes, divided among the moving senders (MovingSessions).
    // A sender does not count as moving (MovingSessions) if nothing was heard from it for this time. If two batches
    // take longer than this time at the sender's granted rate, the longer time is the limit.
    std::chrono::nanoseconds sending_after = std::chrono::seconds(5);
    double bytes_per_second_max = 0;  // Radio budget, divided among all moving sessions; 0: no limit.
    TypeSchemas schemas;              // This agent's schema of each data type.
    PaperSql paper_sql;               // Used for CODEC_PAPER_SQL.
    // If this many sessions are open, a new session replaces one that was silent for at least idle_after. If no
    // session was silent for so long, the new session is refused.
    std::size_t sessions_max = 16;
    std::chrono::nanoseconds idle_after = std::chrono::seconds(60);
    std::size_t run_places_max = 8;  // Number of senders whose runs of maps are kept (run_decoders.h).
    // While this many StoreRequests of a sender wait, further batches of this sender are dropped and counted.
    std::size_t waiting_stores_per_sender_max = 16;
    std::size_t have_page_bytes_max = kHavePageBytesMax;
  };

  struct Counts {
    double received_records = 0;  // Records stored as new rows.
    double rejected_records = 0;  // Records that storage refused, except records that the sender may not supply.
    double damaged_messages = 0;
    double dropped_messages = 0;  // Messages dropped for too many waiting StoreRequests or too many decoded bytes.
    double refused_hellos = 0;
  };

  // Requires: `first_request_id` is random, so answers to requests from before a restart match no new request.
  SharingReceiver(Options options, std::uint64_t first_request_id);

  SharingActions OnHello(AgentId sender, const proto::Hello& hello, Time now);
  // Handles a message that contains a batch. Returns kCorrupt if the batch is damaged. The error is already counted;
  // the caller logs it.
  Result<SharingActions> OnBatch(AgentId sender, const proto::Message& message, Time now);

  // Handle answers from storage. An answer that matches no waiting request is ignored.
  SharingActions OnHaveReply(std::uint64_t request_id, const proto::HaveReply& reply);
  SharingActions OnStoreReply(std::uint64_t request_id, const proto::StoreReply& reply);

  // Counters and order states of one sender since this actor started.
  struct Heard {
    double coded_bytes = 0;       // Coded bytes of all batches.
    std::uint64_t remaining = 0;  // Records that remained to be sent after the last batch.
    std::uint64_t batches = 0;
    // The last OrderEnd whose batch is stored. OrderEnd.not_taken includes the records of this batch, if storage did
    // not store them.
    proto::OrderEnd order_end;
    std::uint64_t completed_order = 0;  // The last order of which all records were sent and stored.
    int refusals = 0;                   // Refused batches since a batch of the sender was last stored.
    std::string refusal;                // Error text of the last refusal.
  };
  const Heard& heard(AgentId sender) const;

  // Returns the number of moving senders. A sender is moving if it has records left to send and is not silent
  // (Options::sending_after). Each moving sender gets an equal part of the credit and the budget.
  std::size_t MovingSessions(Time now) const;
  // Sets how many sessions of this agent, outside this receiver, use the radio now. These sessions also get a part of
  // the budget.
  void SetMovingElsewhere(std::size_t sessions) { moving_elsewhere_ = sessions; }

  const Counts& counts() const { return counts_; }
  // Agents whose last Hello since they connected contained the hash of another team configuration. Their sessions are
  // accepted nevertheless.
  const std::set<AgentId>& other_configs() const { return other_configs_; }
  // Call when a peer connected. Removes the peer from other_configs(), since its team file may have been replaced.
  void OnConnected(AgentId peer) { other_configs_.erase(peer); }

 private:
  // The answer that is sent when storage has stored a batch.
  struct WaitingStore {
    proto::Message acknowledgment;  // Complete except for its have-set, which comes from the StoreReply.
    proto::OrderEnd order_end;
    std::vector<RecordKey> keys;  // Keys of the batch's records; empty unless the batch contains an OrderEnd.
  };

  struct Incoming {
    std::uint64_t session_id = 0;
    std::uint64_t have_request_id = 0;                     // Id of the waiting HaveRequest; 0: none waits.
    Time have_asked_at{};                                  // When the waiting HaveRequest was sent.
    std::optional<proto::Hello> next_hello;                // Hello to answer after the waiting HaveRequest.
    RecordKey have_from;                                   // First key of the page that was requested last.
    std::map<std::uint64_t, WaitingStore> waiting_stores;  // Waiting StoreRequests by request id.
    Time last_heard{};
    bool is_other_schema = false;
    bool is_at_end = false;                 // The sender's last batch reported that no records remain to be sent.
    std::uint32_t last_fragment_batch = 0;  // Number of the last batch with a fragment.
    std::uint32_t last_run_batch = 0;       // Number of the last decoded batch that belongs to a run of maps.
    double bytes_per_second = 0;            // The last granted rate; 0: no limit.
  };

  Result<void> CheckHello(const proto::Hello& hello) const;
  SharingActions RequestPage(Incoming& incoming, const proto::Hello& hello);
  // Adds the fields that only the last page of an answer has.
  void CompleteAnswer(AgentId sender, const Incoming& incoming, proto::Have& have);
  SharingActions RefuseHello(AgentId sender, const proto::Hello& hello, Error error);
  void ObserveStored(AgentId sender, const WaitingStore& stored, const proto::StoreReply& reply);
  SharingActions RefuseBatch(AgentId sender, std::uint64_t session_id, Error error);
  bool MakeRoom(Time now);
  // `whole`: the joined bytes of all fragments; nullopt if the batch is not fragmented.
  Result<proto::RecordBatch> Decode(AgentId sender, const proto::Message& message,
                                    const std::optional<std::string>& whole, bool is_late);
  SharingActions AnswerWithoutRecords(AgentId sender, const proto::Message& message, Incoming& incoming) const;
  void Grant(Incoming& incoming, proto::Have& have) const;
  bool IsMoving(const Incoming& incoming, Time now) const;

  Options options_;
  std::uint64_t next_request_id_;
  std::map<AgentId, Incoming> incoming_;
  std::map<AgentId, Heard> heard_;
  std::map<AgentId, DecodeBudget> decode_budgets_;  // By sender. A new session of the sender does not reset its budget.
  FragmentCollector fragments_{2 * kWholeBytesMax};
  RunDecoders runs_;
  Time now_{};  // Time of the last message from a peer.
  std::size_t moving_elsewhere_ = 0;
  std::uint64_t schema_hash_;
  std::set<AgentId> other_configs_;
  Counts counts_;
};

}  // namespace moondb
