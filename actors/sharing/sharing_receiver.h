// SharingReceiver: the receiving side of all sessions of one kind.
//
//   Hello -> HaveRequest to storage -> Have (a page of the whole) to the sender
//   Batch -> decoded -> StoreRequest to storage -> StoreReply, after the commit -> Have (touched streams), which
//            acknowledges
//
// Keeps nothing that matters: what was stored shows in the have-set. A sender has one session; its newer Hello
// replaces it. A Hello costs one page (model/have_page.h), whatever it asks for, and the next page is made when the
// session's sender asks for it. Everything is bounded: sessions, StoreRequests that wait per sender, coded and decoded
// bytes. A batch of an unknown session is refused with kNotFound, so that its sender starts over at once; a damaged one
// is counted and dropped; for one that leans on others that are not here its sender is asked for a new run
// (run_decoders.h). Records are taken from any agent of the team, whatever its role or term: they are immutable and
// named.
//
// A plain state machine like SharingSession; whether the sender belongs to the team is the caller's to check.
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
    std::string team;     // Its name, for people.
    std::string team_id;  // As messages carry it (model/team_id.h); Hellos of another one are refused.
    std::uint64_t config_hash = 0;
    proto::SharingKind kind = proto::SHARING_KIND_SYNC;
    std::uint32_t unacked_bytes_max = 8 * 1024;  // The credit that those who are sending are granted together.
    // Who was silent for longer, and than a sender is that keeps to its part of the budget, has no part of it.
    std::chrono::nanoseconds sending_after = std::chrono::seconds(5);
    double bytes_per_second_max = 0;  // Of the radio's budget, likewise; 0: no limit.
    TypeSchemas schemas;              // What this agent understands by each type.
    PaperSql paper_sql;               // For CODEC_PAPER_SQL.
    std::size_t sessions_max = 16;    // When full, one that was silent for idle_after gives way.
    std::chrono::nanoseconds idle_after = std::chrono::seconds(60);
    std::size_t run_places_max = 8;                  // Of senders whose runs of maps are kept (run_decoders.h).
    std::size_t waiting_stores_per_sender_max = 16;  // A batch beyond is dropped and counted.
    std::size_t have_page_bytes_max = kHavePageBytesMax;
  };

  struct Counts {
    double received_records = 0;  // Stored as new rows.
    double rejected_records = 0;  // Refused by storage, but for what the sender may not bring.
    double damaged_messages = 0;
    double dropped_messages = 0;  // Too much waits for storage, or the sender's batches become too much when decoded.
    double refused_hellos = 0;
  };

  // `first_request_id` is random: answers to an earlier life's requests must not fit.
  SharingReceiver(Options options, std::uint64_t first_request_id);

  // From a peer.
  SharingActions OnHello(AgentId sender, const proto::Hello& hello, Time now);
  // Reads `message.batch`. kCorrupt where it is damaged (already counted; for the log).
  Result<SharingActions> OnBatch(AgentId sender, const proto::Message& message, Time now);

  // From storage; answers to requests that are not waiting are ignored.
  SharingActions OnHaveReply(std::uint64_t request_id, const proto::HaveReply& reply);
  SharingActions OnStoreReply(std::uint64_t request_id, const proto::StoreReply& reply);

  // What this actor has heard of one sender since it started.
  struct Heard {
    double coded_bytes = 0;       // Of batches.
    std::uint64_t remaining = 0;  // Records behind the last batch.
    std::uint64_t batches = 0;
    proto::OrderEnd order_end;          // The last one that is stored here; its not_taken counts all of the session.
    std::uint64_t completed_order = 0;  // The last one of which nothing is left, and everything was taken.
    int refusals = 0;                   // Since a batch of the sender was stored last.
    std::string refusal;                // The last one.
  };
  const Heard& heard(AgentId sender) const;

  // Senders that have sent no end yet and are not silent: each has its part of credit and budget.
  std::size_t MovingSessions(Time now) const;
  // Sessions of this agent's that are moving beside these, and have their part of the budget.
  void SetMovingElsewhere(std::size_t sessions) { moving_elsewhere_ = sessions; }

  const Counts& counts() const { return counts_; }
  // Whose last Hello since the link came up named another team configuration; it was taken nevertheless.
  const std::set<AgentId>& other_configs() const { return other_configs_; }
  // The link came up: the peer may run with another team file than before, and may have nothing to send.
  void OnConnected(AgentId peer) { other_configs_.erase(peer); }

 private:
  // What is answered when storage has stored a batch.
  struct WaitingStore {
    proto::Message acknowledgment;  // But for its have-set.
    proto::OrderEnd order_end;
    std::vector<RecordKey> keys;  // Of the batch that has an order's end.
  };

  struct Incoming {
    std::uint64_t session_id = 0;
    std::uint64_t have_request_id = 0;                     // 0: none waits.
    Time have_asked_at{};                                  // When that one was sent to storage.
    std::optional<proto::Hello> next_hello;                // Answered after that one.
    RecordKey have_from;                                   // Where the page begins that was asked for last.
    std::map<std::uint64_t, WaitingStore> waiting_stores;  // By request id.
    Time last_heard{};
    bool is_other_schema = false;
    bool is_at_end = false;  // It said that nothing remains.
    std::uint32_t last_fragment_batch = 0;
    std::uint32_t last_run_batch = 0;  // Of a run of maps, that was decoded.
    double bytes_per_second = 0;       // As granted last; 0: no limit.
  };

  Result<void> CheckHello(const proto::Hello& hello) const;
  SharingActions AskForPage(Incoming& incoming, const proto::Hello& hello);
  // What stands on the last page alone.
  void CompleteAnswer(AgentId sender, const Incoming& incoming, proto::Have& have);
  SharingActions RefuseHello(AgentId sender, const proto::Hello& hello, Error error);
  void NoteStored(AgentId sender, const WaitingStore& stored, const proto::StoreReply& reply);
  SharingActions RefuseBatch(AgentId sender, std::uint64_t session_id, Error error);
  bool MakeRoom(Time now);
  // `whole`: of pieces, all their bytes.
  Result<proto::RecordBatch> Decode(AgentId sender, const proto::Message& message,
                                    const std::optional<std::string>& whole, bool is_late);
  SharingActions AnswerWithoutRecords(AgentId sender, const proto::Message& message, Incoming& incoming) const;
  void Grant(Incoming& incoming, proto::Have& have) const;
  bool IsMoving(const Incoming& incoming, Time now) const;

  Options options_;
  std::uint64_t next_request_id_;
  std::map<AgentId, Incoming> incoming_;
  std::map<AgentId, Heard> heard_;
  std::map<AgentId, DecodeBudget> decode_budgets_;  // By sender, whatever its sessions.
  FragmentCollector fragments_{2 * kWholeBytesMax};
  RunDecoders runs_;
  Time now_{};  // Of what was heard last.
  std::size_t moving_elsewhere_ = 0;
  std::uint64_t schema_hash_;
  std::set<AgentId> other_configs_;
  Counts counts_;
};

}  // namespace moondb
