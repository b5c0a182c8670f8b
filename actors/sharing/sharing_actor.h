// SharingActor: base class of SyncActor and ReplicaActor. Sends records to peers and receives records from peers.
//
// The actor exchanges messages with the peers' actors of the same name. The protocol is implemented by state machines
// that the actor owns (SharingSession, SharingReceiver, PeerOrders, RadioShare); the actor sends their messages and
// supplies timers and roles. There is one outgoing session per destination.
//
// A restart loses the actor's orders, but no acknowledged records. A session waits while a lease of this agent or of
// the destination (driving, sleeping, paused) shuts the window between them. If neither agent sleeps, the session may
// still send state records (StateTypesOf). Sent and received bytes together stay within radio.budget_kbps of the team
// file.
//
// Accepts timers, roles and storage's answers from this agent only, and sharing messages from agents of the team only.
// Ignores all other messages.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actors/sharing/flow_schedule.h"
#include "actors/sharing/order_watch.h"
#include "actors/sharing/peer_orders.h"
#include "actors/sharing/radio_share.h"
#include "actors/sharing/sharing_receiver.h"
#include "actors/sharing/sharing_session.h"
#include "model/have_page.h"
#include "model/leases.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"
#include "runtime/team/team_config.h"

namespace moondb::proto {
class ShareStatus;
}  // namespace moondb::proto

namespace moondb {

class SharingActor : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;         // The validated team configuration.
    std::uint64_t config_hash = 0;  // Hash of the team file (TeamFile::hash).
    SharingSession::Options session;
    std::size_t have_page_bytes_max = kHavePageBytesMax;
  };

  void OnStart(Context& context) final;
  void OnMessage(Context& context, const proto::Message& message) final;

 protected:
  SharingActor(Options options, proto::SharingKind kind);

  // Carries out a request to share. Returns the number of sessions that serve the request: sessions started now,
  // sessions already open, and sessions that peers were ordered to start. Fails with kRefused if the roles do not allow
  // the request, and with kInvalid if a field is not valid for this agent or this kind of sharing. `is_leaders`:
  // the request came from another agent, which is the current leader or names a newer term than roles().term().
  // Requires: CheckShareRequest accepted the request.
  virtual Result<int> Share(Context& context, const proto::ShareRequest& request, bool is_leaders) = 0;
  // Called after roles() changed from `previous`. At the actor's start, roles() are the roles of the team file.
  virtual void OnNewRoles(Context& context, const proto::RoleAssignment& previous) = 0;
  virtual void OnPeerEvent(Context&, AgentId) {}
  // Called after the leases of any agent changed, so IsWindowOpen may return other results.
  virtual void OnWindowsChanged(Context&) {}
  struct Received {
    std::set<DataType> types;  // Types of a stored batch with new records.
    bool is_all = false;       // True: storage has stored all records that the sender has to send.
  };
  // Called when a batch of the sender was accepted, and again when storage has stored it.
  virtual void OnReceived(Context&, AgentId, const Received&) {}
  // Returns true if OpenAgain will be called for the order, so it is not complete yet.
  virtual bool IsToOpenAgain(std::uint64_t /*order*/) const { return false; }
  // Called if a peer answered an order of this actor with an error other than kUnavailable.
  virtual void OnOrderRefused(Context&, AgentId) {}
  virtual void OnStarted(Context&) {}
  // Returns the agents whose records this agent, as leader, still has to gather in this term; nullopt while unknown.
  virtual std::optional<std::vector<AgentId>> YetToGather() const = 0;
  // Adds the status fields that only one kind of sharing has.
  virtual void AddStatus(const Context&, proto::ShareStatus&) const {}
  virtual void OnGathering(Context&, const proto::Gathering&) {}
  // Called after storage stored records, if flow().is_on().
  virtual void OnStored(const proto::RecordsStored&) {}
  // Returns the records that flow() sends a destination.
  virtual proto::RecordFilter FlowRecordsFor(AgentId destination) const = 0;
  // Called when a timer of StartStepTimer expires. `step` is the number that was passed to StartStepTimer.
  virtual void OnStepTimer(Context&, std::uint64_t /*step*/) {}

  // Starts a session to the destination, or gives the open session a further order. If called during OnShareRequest or
  // OpenAgain, the session serves the order in_hand_; otherwise, no agent or client waits for the order's completion.
  // If `is_by_role` is true, CloseByRole may close the session. `bytes_max`: see SharingSession::Order.
  void Open(Context& context, AgentId destination, proto::RecordFilter filter, bool is_by_role,
            std::uint64_t bytes_max = 0);
  // Sends this agent's latest states without an order (SharingSession::SharePeriodic).
  void SharePeriodicStates(Context& context, AgentId destination);
  // Destinations that get new records without an order (radio.sync_period_s).
  FlowSchedule& flow() { return flow_.schedule; }
  // Closes each session that was opened with `is_by_role`, except a session to the current leader. Returns the largest
  // number of bytes that an order of the closed sessions could still send; 0 if one of these orders had no limit;
  // nullopt if no closed session had an order.
  std::optional<std::uint64_t> CloseByRole(Context& context);
  // Like Open with `is_by_role`, but for `order`, which a client gave earlier. The order is then complete only when
  // this session is complete too.
  void OpenAgain(Context& context, std::uint64_t order, AgentId destination, proto::RecordFilter filter);
  // Returns the number of the client's order that is being carried out now; 0 if there is none, or if a peer gave the
  // order.
  std::uint64_t order_in_hand() const { return in_hand_.agent == options_.self ? in_hand_.number : 0; }
  // Orders the peer to share its records with this agent, and repeats the order until the peer answers. Returns the
  // order's number.
  std::uint64_t OrderFrom(Context& context, AgentId peer, std::uint64_t bytes_max = 0);
  // Returns the newest OrderEnd that the peer reported for an order of this actor. Nullopt if there is none, or if
  // storage has not stored the batch that contains the OrderEnd yet.
  std::optional<proto::OrderEnd> OrderEndBy(AgentId peer) const;
  // Returns true if a peer has not reported the end of its order, or has not answered it.
  bool is_any_order_open() const { return !orders_.is_empty(); }
  void CancelOrder(Context& context, AgentId peer);
  void CancelOrders(Context& context);
  void StartStepTimer(Context& context, Duration delay, std::uint64_t step);
  // Returns true if the window to the peer is open: no lease of this agent or the peer (driving, sleeping, paused)
  // restricts sharing between them.
  bool IsWindowOpen(const Context& context, AgentId peer) const;
  // Returns a text such as "rover2 drives for 40 s more", or an empty text if the window is open.
  std::string WhyWindowIsShut(const Context& context, AgentId peer) const;

  const proto::TeamConfig& team() const { return options_.team; }
  const SharingSession::Options& session_options() const { return options_.session; }
  const proto::RoleAssignment& roles() const { return roles_; }
  AgentId self() const { return options_.self; }
  // False until RoleActor has published the roles: the leader of the team file may have been replaced.
  bool is_leading() const { return roles_.has_term() && roles_.leader() == options_.self; }
  bool is_connected(AgentId peer) const { return connected_.contains(peer); }
  bool is_from_here(const Context& context) const { return context.sender().agent == options_.self; }
  std::string NameOf(AgentId agent) const;
  std::string TermText(const proto::Term& term) const;  // Text such as "4 by rover2".

 private:
  // A runtime timer for a deadline that changes. `armed` is the time to which the timer is set.
  struct DeadlineTimer {
    TimerId timer = 0;
    std::optional<MonotonicTime> armed;
  };

  struct Flow {
    FlowSchedule schedule;
    DeadlineTimer timer;
  };

  struct Outgoing {
    SharingSession session;
    bool is_by_role = false;
    DeadlineTimer timer;
  };

  void SharePeriodic(Context& context, AgentId destination, const proto::RecordFilter& filter, bool is_for_states);
  void ShareDue(Context& context);
  FlowSchedule::State FlowStateOf(const Context& context, AgentId destination);
  void OnLocal(Context& context, const proto::Message& message);
  void OnPeer(Context& context, const proto::Message& message);
  void OnHello(Context& context, const proto::Hello& hello);
  void OnBatch(Context& context, const proto::Message& message);
  void OnStoreReply(Context& context, const proto::Message& message);
  void OnPeerHaveRequest(Context& context, const proto::Message& message);
  void OnShareRequest(Context& context, const proto::Message& message);
  void OnShareReply(Context& context, const proto::Message& message);
  void OnProgressRequest(Context& context, const proto::Message& message);
  // Adds the order that Share just carried out to watch_.
  void WatchOrder(const Context& context, const proto::ShareRequest& request);
  void AnswerWhoWaits(Context& context);
  OrderWatch::Rows RowsOf(const Context& context, OrderWatch::Order& order);
  proto::PairProgress OutgoingRow(const Context& context, std::uint64_t order, const OrderWatch::Pair& pair);
  proto::PairProgress IncomingRow(const Context& context, std::uint64_t order, const OrderWatch::Pair& pair) const;
  // If no records can pass between this agent and the peer now, adds the reason to `row`. The row counts as stopped if
  // the peer is out of reach, and as waiting if the window is shut.
  void AddObstacle(const Context& context, AgentId peer, proto::PairProgress& row) const;
  bool IsOutOfReach(const Context& context, AgentId peer) const;
  void OnControlRequest(Context& context, const proto::Message& message);
  void OnLink(Context& context, const proto::PeerEvent& event);
  void OnLeasesChanged(Context& context, const proto::LeasesChanged& changed);
  void OnTimer(Context& context, const proto::Timer& timer);
  void SetRoles(Context& context, const proto::RoleAssignment& roles);
  // Checks that the sender of the current message may order this agent to share. `term` is the message's term. Fails
  // with kUnavailable if the sender may be the leader of `term`, because `term` is newer than this agent's term. Fails
  // with kRefused if the sender may not give orders.
  Result<void> CheckOrderer(const Context& context, const proto::Term& term) const;
  bool IsBeingCarriedOut(ShareOrderId id);
  Result<void> CheckShareRequest(const proto::ShareRequest& request) const;
  // Returns kRefused if a client of this agent sent the request and expects another term than the current one.
  Result<void> CheckExpectedTerm(const Context& context, const proto::ShareRequest& request) const;

  SharingSession::Window WindowTo(const Context& context, AgentId peer) const;
  // Returns the seconds until no lease of this agent or the peer restricts sharing between them; 0 if none does now.
  double SecondsUntilWindowOpens(const Context& context, AgentId peer) const;
  Outgoing* FindOutgoing(AgentId destination);
  Outgoing& FindOrMakeOutgoing(Context& context, AgentId destination);
  void Perform(Context& context, Outgoing& outgoing, SharingActions actions);
  // Sends the message of each action. Ignores send errors, since a peer that gets no answer repeats its message.
  void Perform(Context& context, SharingActions actions);
  void PerformOrders(Context& context, SharingActions actions);
  static void Arm(Context& context, DeadlineTimer& timer, std::optional<MonotonicTime> deadline, std::uint32_t kind,
                  AgentId peer);
  void ArmSessionTimer(Context& context, Outgoing& outgoing);
  void ArmOrdersTimer(Context& context);
  // Divides the agent's radio budget equally among all sessions that use the radio now, including those of the agent's
  // other sharing actor. Sets the rates of this actor's sessions accordingly.
  void DivideBudget(Context& context);
  void NotifyOfLoad(Context& context, std::size_t moving);

  const Options options_;
  const proto::SharingKind kind_;
  proto::RoleAssignment roles_;  // The roles of the team file, without a term, until RoleActor publishes others.
  std::set<AgentId> connected_;
  // Time at which the connection to each unconnected agent was lost. For an agent that was never connected: the time at
  // which this actor started.
  std::map<AgentId, MonotonicTime> lost_at_;
  Leases leases_;
  std::map<AgentId, Outgoing> outgoing_;  // Outgoing sessions by destination.
  PeerOrders orders_;
  DeadlineTimer orders_timer_;
  // Number of the last order that this actor gave to a peer or accepted from a client since its restart.
  std::uint64_t last_order_ = 0;
  ShareOrderId in_hand_;  // The order that Share carries out now.
  std::vector<OrderWatch::Pair> pairs_in_hand_;
  // The error text of each peer that refused its last order. Erased when the peer gets a new order.
  std::map<AgentId, std::string> order_refusals_;
  OrderWatch watch_;
  DeadlineTimer watch_timer_;
  std::optional<SharingReceiver> receiver_;
  RadioShare radio_share_;
  bool is_budget_timer_armed_ = false;
  Flow flow_;
  RateLimitedLog refused_log_;
};

}  // namespace moondb
