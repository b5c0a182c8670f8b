// SharingActor: what SyncActor and ReplicaActor have in common: sessions out, sessions in, and the way to storage.
//
// The conversation with peers goes to the actor of the same name there. Sessions, receiver, orders to peers and the
// share of the radio are plain classes (SharingSession, SharingReceiver, PeerOrders, RadioShare); this actor only
// carries their messages, timers and roles. One outgoing session per destination, several at a time; after a restart of
// this actor orders are forgotten (whoever wants the records asks again) but nothing that was acknowledged is. A client
// may wait until its order is done (order_watch.h). Where an end of a session drives or sleeps (LeasesChanged) the
// session waits until neither does; past one that drives states may go. What the agent sends and receives keeps to the
// team file's radio.budget_kbps: its sessions in both directions and of both kinds have equal parts of it.
//
// Bodies that belong to this agent (timers, roles, storage's answers) are taken from this agent only, sharing's own
// from agents of the team only; everything else is ignored.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

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
    proto::TeamConfig team;         // Complete and checked.
    std::uint64_t config_hash = 0;  // TeamFile::hash.
    SharingSession::Options session;
    std::size_t have_page_bytes_max = kHavePageBytesMax;
  };

  void OnStart(Context& context) final;
  void OnMessage(Context& context, const proto::Message& message) final;

 protected:
  SharingActor(Options options, proto::SharingKind kind);

  // How many sessions were started, asked for or already open because of this. kRefused where the roles do not allow
  // it, kInvalid for a request that cannot be meant for this agent. Kind, destination and from_agents are checked.
  // `is_leaders`: from the agent that leads, perhaps in a term that this agent will only hear of.
  virtual Result<int> Share(Context& context, const proto::ShareRequest& request, bool is_leaders) = 0;
  // roles() are new. At first, and until RoleActor speaks, they are those of the team file.
  virtual void OnNewRoles(Context& context, const proto::RoleAssignment& previous) = 0;
  virtual void OnPeerEvent(Context&, AgentId) {}
  // Any agent may have begun or ended to be quiet (IsWindowOpen).
  virtual void OnWindowsChanged(Context&) {}
  // A batch came; `is_all`: all that its sender had for this agent, when it was ordered to share, is stored here.
  virtual void OnReceived(Context&, AgentId, bool /*is_all*/) {}
  // An order was answered with an error.
  virtual void OnOrderRefused(Context&, AgentId) {}
  // Once, at the actor's start.
  virtual void OnStarted(Context&) {}
  // From whom the leader has yet to gather in this term; none: it is not known yet.
  virtual std::optional<std::vector<AgentId>> YetToGather() const = 0;
  // Adds what only this kind of sharing knows.
  virtual void AddStatus(const Context&, proto::ShareStatus&) const {}
  virtual void OnGathering(Context&, const proto::Gathering&) {}
  // A timer that StartStepTimer started.
  virtual void OnStepTimer(Context&, std::uint64_t /*step*/) {}

  // Orders a session; `is_by_role` ones end when CloseByRole is called. Within Share the session hears of the request's
  // number. `bytes_max`: as of SharingSession::Order.
  void Open(Context& context, AgentId destination, proto::RecordFilter filter, bool is_by_role,
            std::uint64_t bytes_max = 0);
  // This agent's latest states, at least (SharingSession::BringPeriodic).
  void BringPeriodicStates(Context& context, AgentId destination);
  // Those to the leader of now stay. Where another one that was ordered was open: how many bytes it had left (0: no
  // limit).
  std::optional<std::uint64_t> CloseByRole(Context& context);
  // As Open, for the order that a client gave before: it is not done before this session is.
  void OpenAgain(Context& context, std::uint64_t order, AgentId destination, proto::RecordFilter filter);
  // The order of a client that Share carries out now.
  std::uint64_t order_in_hand() const { return in_hand_.agent == options_.self ? in_hand_.number : 0; }
  // "Share with me", to that agent, again and again until it answers. Returns the order's number.
  std::uint64_t OrderFrom(Context& context, AgentId peer, std::uint64_t bytes_max = 0);
  // How the last order of this actor to that agent ended, as far as what it brought is stored.
  std::optional<proto::OrderEnd> OrderEndBy(AgentId peer) const;
  void CancelOrder(Context& context, AgentId peer);
  void CancelOrders(Context& context);
  void StartStepTimer(Context& context, Duration delay, std::uint64_t step);
  // Neither this agent nor that one drives or sleeps.
  bool IsWindowOpen(const Context& context, AgentId peer) const;
  // "rover2 drives for 40 s more"; empty where it is open.
  std::string WhyWindowIsShut(const Context& context, AgentId peer) const;

  const proto::TeamConfig& team() const { return options_.team; }
  const SharingSession::Options& session_options() const { return options_.session; }
  const proto::RoleAssignment& roles() const { return roles_; }
  AgentId self() const { return options_.self; }
  bool is_leading() const { return roles_.leader() == options_.self; }
  bool is_connected(AgentId peer) const { return connected_.contains(peer); }
  bool is_from_here(const Context& context) const { return context.sender().agent == options_.self; }
  std::string NameOf(AgentId agent) const;
  std::string TermText(const proto::Term& term) const;  // "4 by rover2".

 private:
  // A timer of the runtime that stands for a deadline which moves.
  struct DeadlineTimer {
    TimerId timer = 0;
    std::optional<MonotonicTime> armed;
  };

  struct Outgoing {
    SharingSession session;
    bool is_by_role = false;
    DeadlineTimer timer;
  };

  void OnLocal(Context& context, const proto::Message& message);
  void OnPeer(Context& context, const proto::Message& message);
  void OnHello(Context& context, const proto::Hello& hello);
  void OnBatch(Context& context, const proto::Message& message);
  void OnStoreReply(Context& context, const proto::Message& message);
  void OnPeerHaveRequest(Context& context, const proto::Message& message);
  void OnShareRequest(Context& context, const proto::Message& message);
  void OnShareReply(Context& context, const proto::Message& message);
  void OnProgressRequest(Context& context, const proto::Message& message);
  // Watches the order in hand.
  void WatchOrder(const Context& context, const proto::ShareRequest& request);
  void AnswerWhoWaits(Context& context);
  OrderWatch::Rows RowsOf(const Context& context, OrderWatch::Order& order);
  proto::PairProgress OutgoingRow(const Context& context, std::uint64_t order, const OrderWatch::Pair& pair);
  proto::PairProgress IncomingRow(const Context& context, std::uint64_t order, const OrderWatch::Pair& pair) const;
  // Why nothing passes between this agent and that one now: stopped where it is out of reach, else it waits.
  void AddObstacle(const Context& context, AgentId peer, proto::PairProgress& row) const;
  bool IsOutOfReach(const Context& context, AgentId peer) const;
  void OnControlRequest(Context& context, const proto::Message& message);
  void OnLink(Context& context, const proto::PeerEvent& event);
  void OnLeasesChanged(Context& context, const proto::LeasesChanged& changed);
  void OnTimer(Context& context, const proto::Timer& timer);
  void SetRoles(Context& context, const proto::RoleAssignment& roles);
  // Of a sharing order: whether the agent that gives it, in this term, may.
  Result<void> CheckOrderer(const Context& context, const proto::Term& term) const;
  bool IsBeingCarriedOut(ShareOrderId id);
  Result<void> CheckShareRequest(const proto::ShareRequest& request) const;
  // kRefused where a client of this agent relies on the roles of another term.
  Result<void> CheckExpectedTerm(const Context& context, const proto::ShareRequest& request) const;

  SharingSession::Window WindowTo(const Context& context, AgentId peer) const;
  // As far as both ends' leases say.
  double SecondsUntilWindowOpens(const Context& context, AgentId peer) const;
  Outgoing* FindOutgoing(AgentId destination);
  Outgoing& FindOrMakeOutgoing(Context& context, AgentId destination);
  void Perform(Context& context, Outgoing& outgoing, SharingActions actions);
  void Perform(Context& context, SharingActions actions);  // The receiver's: whoever misses one sends again.
  void PerformOrders(Context& context, SharingActions actions);
  static void Arm(Context& context, DeadlineTimer& timer, std::optional<MonotonicTime> deadline, std::uint32_t kind,
                  AgentId peer);
  void ArmSessionTimer(Context& context, Outgoing& outgoing);
  void ArmOrdersTimer(Context& context);
  // Divides the radio's budget among the sessions of this agent that are moving, the other sharing actor's too.
  void DivideBudget(Context& context);
  void NotifyOfLoad(Context& context, std::size_t moving);

  const Options options_;
  const proto::SharingKind kind_;
  proto::RoleAssignment roles_;
  std::set<AgentId> connected_;
  std::map<AgentId, MonotonicTime> lost_at_;  // Who is not connected; since this actor's start who never was.
  Leases leases_;
  std::map<AgentId, Outgoing> outgoing_;  // By destination.
  PeerOrders orders_;
  DeadlineTimer orders_timer_;
  std::uint64_t last_order_ = 0;  // The last one that this life of the actor gave or took of a client.
  ShareOrderId in_hand_;          // The request that Share carries out now.
  std::vector<OrderWatch::Pair> pairs_in_hand_;
  std::map<AgentId, std::string> order_refusals_;  // Why the peer does not share; until it is ordered again.
  OrderWatch watch_;
  DeadlineTimer watch_timer_;
  std::optional<SharingReceiver> receiver_;
  RadioShare radio_share_;
  bool is_budget_timer_armed_ = false;
  RateLimitedLog refused_log_;
};

}  // namespace moondb
