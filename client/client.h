// Client: the API through which robot software, a planner or an operator's tool uses its agent.
//
// Speaks proto/control.proto over a ZeroMQ DEALER to the agent's own endpoint (runtime/team/team_config.h,
// ClientEndpoint). This header only forward-declares messages of the large files proto/control.proto,
// proto/status.proto and proto/share_status.proto; include their headers to access the fields. Calls are synchronous,
// one at a time. Not thread-safe: use one Client per thread. After a timeout or a lost connection the Client stays
// usable: the next call reconnects, and a late reply is dropped.
//
//   auto client = Client::Connect("ipc:///run/user/1000/moondb/team/rover1", "rover1", {});
//   if (!client) return client.error();
//   auto keys = (*client)->Insert({record});
//
// Every call can fail with these errors, or with the error in the agent's reply:
//   - kUnavailable: The agent is not running, or the connection broke during the call.
//   - kTimedOut: The agent did not reply in time.
//   - kRefused: The agent does not know the client's key, or the key lacks the rights.
//   - kInvalid: The request is larger than message_bytes_max.
//   - kCorrupt: The reply does not decode.
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
    // Timeout of a call, once connected. If the request lets the agent wait, the call times out after that wait plus
    // this timeout, but at least 30 s.
    Duration timeout = std::chrono::seconds(10);
    Duration long_timeout = std::chrono::seconds(600);  // Timeout of requests that TakesLong (model/control_request.h).
    // Size limit of requests and replies. A request over the network also obeys kKeyedRequestBytesMax.
    std::size_t message_bytes_max = 32 * 1024 * 1024;
    // The agent that is to handle the requests; the connected agent relays them over the radio. 0: the connected agent.
    AgentId for_agent = 0;
    std::string by = {};  // User name for the event log: "anna@hill". Empty: this user at this machine.
    // TeamConfig::team_id of the client's team file. An agent of another team refuses requests, and replies of another
    // team are refused. Empty: any team is accepted.
    std::string team_id = {};
    // Called after each successful call with TeamFile::hash of the agent that handled the request (possibly for_agent).
    // A hash that differs from the client's comes from another version of the team file. Not called on errors, because
    // an error may come from the relaying agent.
    std::function<void(std::uint64_t config_hash)> on_config_hash = {};
    // CURVE keys in Z85, to connect to an agent's client_address; clients.yaml must list the client's public key. Leave
    // both empty for ipc on the agent's own machine.
    std::string server_key = {};    // The agent's public key.
    std::string secret_key = {};    // The client's secret key.
    CustomTypes custom_types = {};  // Types declared in the team file (TeamConfig::custom_types), for their names.
  };

  // Result of Merge. The cells are in `map`; `reply` holds the other fields, such as counts.
  struct Merged {
    MergedMap map;
    proto::MergeReply reply;
  };

  struct ShareOptions {
    Duration limit = std::chrono::minutes(10);                          // Longest wait; at most 24 h.
    std::function<void(const proto::ShareProgress&)> on_progress = {};  // Called on changes, at most every 0.5 s.
    // If not 0, and on_progress is set: while a pair waits for a lease, the limit is extended to the end of that lease
    // plus this margin.
    Duration lease_margin = {};
    AgentId destination = 0;  // This and the following members are those of ShareRequest.
    std::vector<AgentId> from = {};
    std::uint64_t bytes_max = 0;
  };

  // Called with one stored record. An error stops ReadAll, which returns it.
  using Visit = std::function<Result<void>(const proto::StoredRecord& stored, const proto::Record& record)>;

  // Connects to an agent. `agent_name` is used in error texts. Fails at once if no process listens at the endpoint, and
  // after connect_timeout if the endpoint does not respond.
  static Result<std::unique_ptr<Client>> Connect(std::string endpoint, std::string agent_name, Options options);
  ~Client();

  // Sends any request; include proto/control.pb.h to build it. ControlReply.error becomes the error of this call.
  Result<proto::ControlReply> Call(const proto::ControlRequest& request);
  Result<proto::ControlReply> Call(const proto::ControlRequest& request, Duration timeout);

  // Include proto/status.pb.h to access the fields.
  Result<proto::AgentStatus> Status();

  // Inserts all records or none. They are durable when the call returns. Returns one key per record, in order.
  Result<std::vector<RecordKey>> Insert(const std::vector<proto::Record>& records, bool is_local = false);

  // A record of a type that the team file declares: bytes that only the team's own programs understand.
  struct Custom {
    std::string type;               // Name of the type, as in Options::custom_types.
    std::int64_t timestamp_ns = 0;  // Timestamp: nanoseconds since 1970, UTC.
    std::string payload;            // At most bytes_max of the type.
    std::string latest_key;         // Under the policy `latest`, the newest record per key is kept. At most 256 bytes.
    std::string metadata;           // UTF-8, at most 1024 bytes.
  };
  // Inserts one custom record, like Insert. Fails with kInvalid for a type name that is not in Options::custom_types.
  Result<RecordKey> InsertCustom(Custom custom, bool is_local = false);
  // Returns a built-in or declared type, for ReadRequest::data_types. Fails with kInvalid for an unknown name.
  Result<DataType> TypeNamed(const std::string& name) const;

  // Reads one page of records.
  Result<proto::ReadReply> Read(const proto::ReadRequest& request);
  // Reads all pages after request.after_row_id, in the order in which the agent stored the records. The request's
  // limits bound each page.
  Result<void> ReadAll(proto::ReadRequest request, const Visit& visit);

  // Returns the highest index of the own robot's nodes in the agent's store, plus 1; 0 if the store has none. Reads all
  // these nodes. After a disk was lost, the next sync restores the nodes: call this after it.
  Result<std::uint64_t> NextNodeIndex();

  // Returns the agent's have-set: the records held and dropped, per stream.
  Result<HaveSet> Have();
  // Acknowledges the agent's findings up to a timestamp. Returns how many these were.
  Result<std::uint32_t> Acknowledge(std::int64_t until_ns);
  // Checks a part of the agent's store, some records per call (proto/storage.proto, VerifyRequest).
  Result<proto::VerifyReply> Verify(const proto::VerifyRequest& request);
  // Removes records that need not be kept. PruneReply.text says why nothing could be removed.
  Result<proto::PruneReply> Prune(const proto::PruneOrder& order);
  Result<proto::FingerprintReply> Fingerprint(const proto::FingerprintRequest& request);

  Result<proto::RoleShowReply> Roles(bool with_history = false);
  Result<proto::RoleShowReply> SetRoles(const proto::RoleSetRequest& request);
  // Change the roles that this agent acts on, and wait, like ChangeRolesUntilDone (client/orders.h).
  Result<proto::RoleShowReply> SwapRoles(Duration limit);
  Result<proto::RoleShowReply> SetRoles(proto::RoleSetRequest request, Duration limit);
  // Sets a lease of this agent: its robot drives or sleeps, or its sharing is paused, for `duration` from now on (at
  // most
  // 24 h). 0 ends the lease. Renew the lease before it expires. Returns the leases of all agents.
  Result<proto::LeaseReply> SetLease(proto::LeaseKind kind, Duration duration);
  // Share now, and wait until all records are acknowledged or nothing more can be done, like ShareUntilDone
  // (client/orders.h). Sync at the leader runs from and to every other agent; at another agent, it sends that agent's
  // own records to the leader. Replicate at the leader sends all records held to the designated survivor. Both fail
  // with kRefused if this agent loses the lead during the call.
  Result<proto::ShareProgress> Sync(const ShareOptions& options);
  Result<proto::ShareProgress> Replicate(const ShareOptions& options);
  // Share gives an order without waiting. ShareProgress waits for the next change of an order's progress.
  Result<proto::ShareReply> Share(const proto::ShareRequest& request);
  Result<proto::ShareProgress> ShareProgress(const proto::ShareProgressRequest& request);
  // Include proto/share_status.pb.h to access the fields.
  Result<proto::ShareStatus> ShareStatus();
  Result<proto::OptimizeReply> Optimize(const proto::OptimizeRequest& request = {});
  Result<proto::GraphStatsReply> GraphStats();
  // Returns the latest actions of the agent's actors, and the messages that they failed to handle.
  Result<proto::TraceReply> Trace(const proto::TraceRequest& request);
  Result<Merged> Merge(const proto::MergeRequest& request);
  // Returns what each map says about the cell at a position in the frame `map`, in order of precedence.
  Result<proto::MapWhyReply> MapWhy(double x_m, double y_m);
  Result<proto::MapStatsReply> MapStats();
  // Returns the tiles of the merged map that changed since the last call with this `request`, which stores the version.
  // The first call, and the first one after a restart of the agent's merging, return all tiles with known cells. With
  // wait_s, the call waits for a change and returns no tiles if there was none. Set a region before the first call.
  // Fails with kUnavailable if merging restarts between two parts of a reply.
  Result<MergedTiles> NextMapTiles(proto::MapTilesRequest& request);
  // Makes the next bundle for the ground station, acknowledges one, or (no field set) lists the unacknowledged ones.
  Result<proto::DownlinkReply> Downlink(const proto::DownlinkRequest& request);
  // Returns the complete file of a bundle. Calls `fetched` after each part with the bytes received and the total. Fails
  // with kNotFound if there is no such bundle or it is acknowledged, and with kCorrupt if its size is not as announced.
  Result<std::string> FetchBundle(std::uint32_t number, const std::function<void(double bytes, double all)>& fetched);
  // Sends a question to a user's own actor on the agent and returns its answer. Fails with kNotFound if the agent has
  // no own actor of that name.
  Result<google::protobuf::Any> Ask(const std::string& actor, const google::protobuf::Any& question);
  // Asks the agent's process to stop. Returns when the agent has agreed; the process ends shortly after.
  Result<void> Stop();

 private:
  class Connection;
  Result<proto::ShareProgress> ShareFromHere(proto::SharingKind kind, const ShareOptions& options);
  Result<void> CheckTeam(const proto::ControlReply& reply) const;
  Client(std::unique_ptr<Connection> connection, std::string agent_name, Options options);

  std::unique_ptr<Connection> connection_;
  std::string agent_name_;  // Name of the connected agent, for error texts.
  Options options_;
  std::uint64_t next_request_id_ = 1;
};

}  // namespace moondb
