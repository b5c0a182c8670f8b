// StandingOrder: what one session was ordered to bring, who ordered it, and which part of it is meant now.
//
// An order stands until the session ends it. Its filter says which records; its limit, if it has one, how many coded
// bytes. The window to the destination says what may pass: all of it, the states alone, or nothing. What one Hello asks
// for is settled as the session starts over (StartOver, Ask): the whole order, its states where only these pass, or
// states that nobody ordered. Plain value.
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

// Who gave an order, and what it is called there (model/order_number.h). 0: an order that nobody waits for.
struct ShareOrderId {
  AgentId agent = 0;
  std::uint64_t number = 0;
};

class StandingOrder {
 public:
  enum class Window { kOpen, kStatesOnly, kShut };

  // `state_types` may pass a window of kStatesOnly.
  // `first_mark` is random: no mark of an earlier process is met again.
  StandingOrder(std::vector<DataType> state_types, std::uint64_t first_mark)
      : state_types_(std::move(state_types)), mark_(first_mark) {}

  // `is_added`: an order is open, which this one takes the place of; one without a limit stays without. `bytes_max` 0:
  // not limited.
  void Give(proto::RecordFilter filter, std::uint64_t bytes_max, ShareOrderId id, bool is_added);
  // How far this order is, or a later one of the same agent that took its place. kUnknown: it never came here.
  enum class Reached { kUnknown, kOpen, kCompleted, kClosed, kLimited };
  Reached StateOf(ShareOrderId id) const;
  void AddPeriodic(const proto::RecordFilter& states);
  // Each agent's open order has come so far.
  void End(Ending ending);

  // True where it changed. A window that opens lets everything pass; one that closes holds back the states, too, until
  // LookAgain.
  bool SetWindow(Window window);
  // In a window for states: is there a state among what is ordered?
  void LookAgain();
  // The states that may pass have passed; the rest waits for the window.
  void HoldBackTheRest() { is_waiting_ = true; }
  bool is_waiting() const { return is_waiting_; }  // Nothing may be sent.
  bool is_waiting_for_states() const { return is_waiting_ && window_ == Window::kStatesOnly; }

  // The session starts over; from now on it is for what passes now.
  void StartOver();
  // Whose streams the destination is asked about.
  void Ask(proto::Hello& hello);
  // The agents whose streams the last Hello asked about; empty: all.
  const std::set<AgentId>& asked_origins() const { return asked_origins_; }
  // The session has to start over to bring all that is ordered: the destination was not asked about some of it, or more
  // may pass now.
  bool NeedsNewStart() const;
  bool is_periodic() const { return scope_ == Scope::kPeriodicStates; }
  // The session brings states alone, which are not the end of an order.
  bool is_for_states() const { return scope_ != Scope::kAll; }
  // What storage is asked for, and the number under which it notes what is there now (MissingRequest.mark): another one
  // for each order. 0: states that nobody ordered.
  proto::RecordFilter Meant() const;
  std::uint64_t mark() const { return is_periodic() ? 0 : mark_; }

  // The number of the newest order of `destination`, to be told to it with the end. 0: it has no open order.
  std::uint64_t NumberFor(AgentId destination) const;

  void SpendBytes(std::size_t coded_bytes);
  const std::optional<std::uint64_t>& bytes_left() const { return bytes_left_; }  // None: it is not limited.
  bool is_used_up() const { return bytes_left_ == 0; }

  // What the destination understands differently, as it said last; not sent.
  void SetOtherSchemaTypes(std::set<DataType> types) { other_schema_types_ = std::move(types); }
  const std::set<DataType>& other_schema_types() const { return other_schema_types_; }

  void AddTo(proto::ShareSession& status) const;

 private:
  enum class Scope { kAll, kStates, kPeriodicStates };

  // The newest order of one agent.
  struct KnownOrder {
    proto::SessionOrder order;
    bool is_open = false;  // The session has not ended since.
    Reached ended = Reached::kUnknown;
  };

  void Note(ShareOrderId id);
  std::set<AgentId> OriginsMeant() const;  // Empty: everybody's streams.
  bool IsAllAsked() const;
  proto::RecordFilter StatesMeant() const;

  std::vector<DataType> state_types_;
  std::uint64_t mark_;
  proto::RecordFilter filter_;
  std::optional<std::uint64_t> bytes_left_;
  std::map<AgentId, KnownOrder> orders_;
  Scope scope_ = Scope::kAll;
  Window window_ = Window::kOpen;
  bool is_waiting_ = false;
  std::set<AgentId> asked_origins_;
  std::set<DataType> asked_types_;  // Whatever the origin.
  std::set<DataType> other_schema_types_;
};

}  // namespace moondb
