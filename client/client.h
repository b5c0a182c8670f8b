// Client: what a robot's software, a planner or an operator's tool asks of its agent.
//
// Speaks proto/control.proto over a ZeroMQ DEALER to the agent's own endpoint (runtime/team/team_config.h,
// ClientEndpoint); knows nothing of actors. What holds every status (proto/control.proto, proto/status.proto,
// proto/share_status.proto) is only named here, and included by those who look into it. Calls are synchronous, one at a
// time. Not thread-safe: one Client a thread. A call that timed out or lost its agent leaves the Client usable: the
// next call connects again, and an answer that comes too late is dropped.
//
//   auto client = Client::Connect("ipc:///run/user/1000/moondb/team/rover1", "rover1", {});
//   if (!client) return client.error();
//   auto keys = (*client)->Insert({record});
//
// Errors of every call: kUnavailable (the agent is not running, or it went away during the call), kTimedOut, kRefused
// (the agent does not know the client's key, or the key does not allow this),
// kInvalid (the request is larger than message_bytes_max), kCorrupt (an answer that does not decode), or what the
// agent answered.
#pragma once

#include <google/protobuf/any.pb.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/merged_map.h"
#include "model/custom_types.h"
#include "model/error.h"
#include "model/grid.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "proto/downlink.pb.h"
#include "proto/graph.pb.h"
#include "proto/lease.pb.h"
#include "proto/retention.pb.h"
#include "proto/role.pb.h"
#include "proto/sharing.pb.h"
#include "proto/storage.pb.h"
#include "proto/trace.pb.h"

namespace moondb::proto {
class AgentStatus;
class ControlReply;
class ControlRequest;
class ShareStatus;
}  // namespace moondb::proto

namespace moondb {

class Client {
 public:
  using Duration = std::chrono::milliseconds;

  struct Options {
    Duration connect_timeout = std::chrono::seconds(1);
    // Of a call, once connected. Of one that lets the agent wait, 30 s beyond that at least.
    Duration timeout = std::chrono::seconds(10);
    Duration long_timeout = std::chrono::seconds(600);  // Of what TakesLong (model/control_request.h).
    // A request and an answer have so many at most; a request over the network has kKeyedRequestBytesMax at most.
    std::size_t message_bytes_max = 32 * 1024 * 1024;
    // The agent that is meant, asked over the radio by the one that is connected to; 0: that one.
    AgentId for_agent = 0;
    std::string by = {};  // Who asks, for the event log: "anna@hill". Empty: this user at this machine.
    // TeamConfig::team_id of the client's team file. An agent of another team refuses, and its answers are refused;
    // empty: any team's are taken.
    std::string team_id = {};
    // Sees TeamFile::hash of the agent that did what it was asked, which may be for_agent: another one than the
    // client's comes from another team file. An error may be of the agent in between, and is left out.
    std::function<void(std::uint64_t config_hash)> on_config_hash = {};
    // Both in Z85 for an agent's client_address, whose clients.yaml lists the key; empty for its own machine's ipc.
    std::string server_key = {};    // The agent's, public.
    std::string secret_key = {};    // The client's.
    CustomTypes custom_types = {};  // The team file's (TeamConfig::custom_types): for their names.
  };

  // What Merge gives back: the map and how it came about. The cells are in `map`, no longer in `reply`.
  struct Merged {
    MergedMap map;
    proto::MergeReply reply;
  };

  struct ShareOptions {
    Duration limit = std::chrono::minutes(10);                          // At most 24 h.
    std::function<void(const proto::ShareProgress&)> on_progress = {};  // Sees each change, every 0.5 s at most.
    // Not 0, and with on_progress: the limit moves to so long after the end of each lease that a pair waits for.
    Duration lease_margin = {};
    AgentId destination = 0;  // As of ShareRequest, like the rest.
    std::vector<AgentId> from = {};
    std::uint64_t bytes_max = 0;
  };

  // Sees one stored record; an error ends the reading and is returned by ReadAll.
  using Visit = std::function<Result<void>(const proto::StoredRecord& stored, const proto::Record& record)>;

  // `agent_name` stands in errors. An endpoint where nobody listens fails at once, one that is silent after
  // connect_timeout.
  static Result<std::unique_ptr<Client>> Connect(std::string endpoint, std::string agent_name, Options options);
  ~Client();

  // Any request, for those without a function of their own: include proto/control.pb.h. ControlReply.error becomes this
  // call's error.
  Result<proto::ControlReply> Call(const proto::ControlRequest& request);
  Result<proto::ControlReply> Call(const proto::ControlRequest& request, Duration timeout);

  // Include proto/status.pb.h to look into it.
  Result<proto::AgentStatus> Status();

  // All or none; stored durably when this returns. One key each, in order.
  Result<std::vector<RecordKey>> Insert(const std::vector<proto::Record>& records, bool is_local = false);

  // A record of a type that the team file declares: bytes that only the team's own programs understand.
  struct Custom {
    std::string type;               // Its name, as in Options::custom_types.
    std::int64_t timestamp_ns = 0;  // UTC.
    std::string payload;            // At most the type's bytes_max.
    std::string latest_key;         // Under the policy `latest` the newest of each key is kept; at most 256 bytes.
    std::string metadata;           // UTF-8, at most 1024 bytes.
  };
  // As Insert. kInvalid for a name that the options do not have.
  Result<RecordKey> InsertCustom(Custom custom, bool is_local = false);
  // A built-in or declared type, for ReadRequest::data_types; kInvalid for no such name.
  Result<DataType> TypeNamed(const std::string& name) const;

  // One page.
  Result<proto::ReadReply> Read(const proto::ReadRequest& request);
  // All pages from request.after_row_id on, in the order of storing; each page bounded by the request's limits.
  Result<void> ReadAll(proto::ReadRequest request, const Visit& visit);

  // One above the highest index of a node of the agent's own robot in its store; 0 if there is none. Reads all these
  // nodes. After a lost disk they come back with the next sync: ask after it.
  Result<std::uint64_t> NextNodeIndex();

  // What the agent holds and dropped of each stream.
  Result<HaveSet> Have();
  // Of what the agent's status shows as findings, those up to that stamp are none any more; how many these were.
  Result<std::uint32_t> Acknowledge(std::int64_t until_ns);
  // One part of the agent's store, as proto/storage.proto says: some records at a time.
  Result<proto::VerifyReply> Verify(const proto::VerifyRequest& request);
  // Lets the agent remove what need not be kept. PruneReply.text: nothing could go, and why.
  Result<proto::PruneReply> Prune(const proto::PruneOrder& order);
  Result<proto::FingerprintReply> Fingerprint(const proto::FingerprintRequest& request);

  Result<proto::RoleShowReply> Roles(bool with_history = false);
  Result<proto::RoleShowReply> SetRoles(const proto::RoleSetRequest& request);
  // As ChangeRolesUntilDone (client/orders.h) of the roles that this agent acts on.
  Result<proto::RoleShowReply> SwapRoles(Duration limit);
  Result<proto::RoleShowReply> SetRoles(proto::RoleSetRequest request, Duration limit);
  // This agent's robot drives or sleeps, or its sharing is paused, for so long from now on (at most 24 h); 0: no
  // longer. Say it again before it lapses. Who of the team drives, sleeps or is paused then.
  Result<proto::LeaseReply> SetLease(proto::LeaseKind kind, Duration duration);
  // Shares now, and waits until all is acknowledged or nothing more can be done, as ShareUntilDone (client/orders.h):
  // at the leader from each agent and to each, else this agent's own records to the leader; Replicate at the leader all
  // that it holds to the designated survivor. kRefused where this agent led and leads no longer.
  Result<proto::ShareProgress> Sync(const ShareOptions& options);
  Result<proto::ShareProgress> Replicate(const ShareOptions& options);
  // The order alone, and news of it.
  Result<proto::ShareReply> Share(const proto::ShareRequest& request);
  Result<proto::ShareProgress> ShareProgress(const proto::ShareProgressRequest& request);
  // Include proto/share_status.pb.h to look into it.
  Result<proto::ShareStatus> ShareStatus();
  Result<proto::OptimizeReply> Optimize(const proto::OptimizeRequest& request = {});
  Result<proto::GraphStatsReply> GraphStats();
  // What the agent's actors did last, and what they failed at.
  Result<proto::TraceReply> Trace(const proto::TraceRequest& request);
  Result<Merged> Merge(const proto::MergeRequest& request);
  // What the maps say of the cell at a place in the frame `map`, who wins it and why.
  Result<proto::MapWhyReply> MapWhy(double x_m, double y_m);
  Result<proto::MapStatsReply> MapStats();
  // The merged map's tiles that changed since the last call with this `request`, which keeps count; at first, and where
  // the agent's merging began anew, all in which anything is known. With wait_s it waits for a change; none in that
  // time: no tiles. A region is set before the first call. kUnavailable where it begins anew between two parts of an
  // answer.
  Result<MergedTiles> NextMapTiles(proto::MapTilesRequest& request);
  // Makes the next bundle for the ground, says that one has arrived there, or shows what waits (nothing set).
  Result<proto::DownlinkReply> Downlink(const proto::DownlinkRequest& request);
  // A bundle's file, whole; `fetched` is called with how many bytes are here, and of how many. kNotFound: no such
  // bundle, or acknowledged; kCorrupt: its size is not what the agent says.
  Result<std::string> FetchBundle(std::uint32_t number, const std::function<void(double bytes, double all)>& fetched);
  // Asks an actor of the user's own on the agent; its answer. kNotFound: the agent has none of that name.
  Result<google::protobuf::Any> Ask(const std::string& actor, const google::protobuf::Any& question);
  // The agent has agreed to stop; it ends shortly after.
  Result<void> Stop();

 private:
  class Connection;
  Result<proto::ShareProgress> ShareFromHere(proto::SharingKind kind, const ShareOptions& options);
  Result<void> CheckTeam(const proto::ControlReply& reply) const;
  Client(std::unique_ptr<Connection> connection, std::string agent_name, Options options);

  std::unique_ptr<Connection> connection_;
  std::string agent_name_;  // It is connected to this one.
  Options options_;
  std::uint64_t next_request_id_ = 1;
};

}  // namespace moondb
