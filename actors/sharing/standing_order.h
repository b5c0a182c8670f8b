// StandingOrder: the order that one session carries out: its records, its byte limit, and the agents that gave it.
//
// An order stays open until the session ends it. The window to the destination admits all records, only states, or no
// records. Each start of the session sets the scope (what the session sends): all records of the order, only states of
// the order because the window admits no others, or periodically shared records without an order. Plain value.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "actors/sharing/session_counts.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"
#include "proto/storage.pb.h"

namespace moondb::proto {
class ShareSession;
}  // namespace moondb::proto

namespace moondb {

// The agent that gave an order, and the number that it gave to the order (model/order_number.h). Number 0: no agent or
// client waits for the order.
struct ShareOrderId {
  AgentId agent = 0;
  std::uint64_t number = 0;
};

class StandingOrder {
 public:
  enum class Window { kOpen, kStatesOnly, kShut };

  // Records of `state_types` may be sent in a window of kStatesOnly. Requires: `first_mark` is random, so no mark of an
  // earlier process is used again.
  StandingOrder(std::vector<DataType> state_types, std::uint64_t first_mark)
      : state_types_(std::move(state_types)), mark_(first_mark) {}

  // Sets the order. `is_added`: the new order replaces an open order. If the open order has no limit, the new order has
  // none either. `bytes_max` 0: no limit.
  void Set(proto::RecordFilter filter, std::uint64_t bytes_max, ShareOrderId id, bool is_added);
  // The state of the order `id`. If a later order of the same agent has replaced it, the later order's state counts.
  // kUnknown: the session was never given this order.
  enum class Reached { kUnknown, kOpen, kCompleted, kClosed, kLimited };
  Reached StateOf(ShareOrderId id) const;
  // Sets the records that are sent without an order. `is_for_states`: they are states.
  void SetPeriodic(const proto::RecordFilter& filter, bool is_for_states);
  // Ends the open orders of all agents.
  void End(Ending ending);

  // Sets the window and returns true if it changed. An open window admits all records. With any other window the
  // session sends nothing, not even states, until EvaluateAgain is called.
  bool SetWindow(Window window);
  // In a window of kStatesOnly, lets the session send again if the order's filter includes a state type.
  void EvaluateAgain();
  // Call when all states were sent. The order's other records then wait until the window opens.
  void HoldBackTheRest() { is_waiting_ = true; }
  bool is_waiting() const { return is_waiting_; }  // True while nothing may be sent.
  bool is_waiting_for_states() const { return is_waiting_ && window_ == Window::kStatesOnly; }

  // Call when the session starts over. Sets the scope to the records that the window admits now.
  void StartOver();
  // Fills in the origins and types whose have-set the Hello requests.
  void FillRequest(proto::Hello& hello);
  // Origins whose have-set the last Hello requested; empty: all origins.
  const std::set<AgentId>& asked_origins() const { return asked_origins_; }
  // True if the session must start over to send all ordered records, because the last Hello did not request the
  // have-set of all their streams, or because the window now admits more records.
  bool NeedsNewStart() const;
  bool is_periodic() const { return is_periodic_; }
  // True if the session sends only states. Sending all states does not complete an order.
  bool is_for_states() const { return scope_ != Scope::kAll; }
  // Meant() and mark() return the filter and the mark for the next MissingRequest. Storage remembers under the mark
  // which records existed at the time of the order (MissingRequest.mark). Each order has a new mark. Mark 0: records
  // without an order.
  proto::RecordFilter Meant() const;
  std::uint64_t mark() const { return is_periodic() ? 0 : mark_; }

  // Returns the number of the newest order that `destination` itself gave, if it is open, else 0. The OrderEnd to the
  // destination contains this number.
  std::uint64_t NumberFor(AgentId destination) const;

  void SpendBytes(std::size_t coded_bytes);
  const std::optional<std::uint64_t>& bytes_left() const { return bytes_left_; }  // Nullopt: no limit.
  bool is_used_up() const { return bytes_left_ == 0; }

  // Types whose schema differs at the destination, as of its last answer. Their records are not sent.
  void SetOtherSchemaTypes(std::set<DataType> types) { other_schema_types_ = std::move(types); }
  const std::set<DataType>& other_schema_types() const { return other_schema_types_; }

  void AddTo(proto::ShareSession& status) const;

 private:
  enum class Scope { kAll, kStates };

  // The newest order that one agent gave, and how it ended.
  struct KnownOrder {
    proto::SessionOrder order;
    bool is_open = false;  // True from the time that the order was given until the session ends.
    Reached ended = Reached::kUnknown;
  };

  void Note(ShareOrderId id);
  std::set<AgentId> OriginsMeant() const;  // Origins of the ordered records; empty: all origins.
  bool IsAllAsked() const;
  proto::RecordFilter StatesMeant() const;

  std::vector<DataType> state_types_;
  std::uint64_t mark_;
  proto::RecordFilter filter_;
  std::optional<std::uint64_t> bytes_left_;
  std::map<AgentId, KnownOrder> orders_;
  Scope scope_ = Scope::kAll;
  bool is_periodic_ = false;  // The records are sent without an order.
  Window window_ = Window::kOpen;
  bool is_waiting_ = false;
  std::set<AgentId> asked_origins_;
  std::set<DataType> asked_types_;  // Types for which the last Hello requested the have-set of all origins.
  std::set<DataType> other_schema_types_;
};

}  // namespace moondb
