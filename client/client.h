// Client: the API through which robot software, a planner or an operator's tool uses its agent.
//
// Calls are synchronous. Not thread-safe: use one Client per thread. After a timeout or a lost connection, the next
// call reconnects. This header only forward-declares messages of proto/control.proto, proto/status.proto and
// proto/share_status.proto; include their headers to access the fields.
//
//    auto client = Client::Connect("ipc:///run/user/1000/moondb/team/rover1", "rover1", {});
//    if (!client) return client.error();
//    auto keys = (*client)->Insert({record});
//
// Every call can fail with the error in the agent's reply, or with:
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
#include "proto/record.pb.h"
#include "proto/registration.pb.h"
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
    // Longest time from sending a request to its reply. If the request has a field wait_s, the limit is wait_s plus
    // `timeout`, and at least wait_s plus 30 s.
    Duration timeout = std::chrono::seconds(10);
    // Replaces `timeout` for slow requests: those for which TakesLong (model/control_request.h) returns true.
    Duration long_timeout = std::chrono::seconds(600);
    // Size limit of a request or a reply. A request over the network may also not exceed kKeyedRequestBytesMax.
    std::size_t message_bytes_max = 32 * 1024 * 1024;
    // The agent that handles the requests; 0 means the connected agent. The connected agent relays requests for another
    // agent over the radio.
    AgentId for_agent = 0;
    std::string by = {};  // User name for the event log: "anna@hill". Empty: this user at this machine.
    // TeamConfig::team_id of the client's team file. An agent of another team refuses the client's requests, and the
    // client refuses replies from another team. Empty: any team is accepted.
    std::string team_id = {};
    // Called after each successful call with the hash of the team file (TeamFile::hash) of the agent that handled the
    // request. If the hash differs from that of the client's team file, the agent uses another version of the file. Not
    // called after a failed call, because the error may come from the relaying agent.
    std::function<void(std::uint64_t config_hash)> on_config_hash = {};
    // CURVE keys in Z85, to connect to an agent's client_address; clients.yaml must list the client's public key. Leave
    // both empty for ipc on the agent's own machine.
    std::string server_key = {};    // The agent's public key.
    std::string secret_key = {};    // The client's secret key.
    CustomTypes custom_types = {};  // Types that the team file declares (TeamConfig::custom_types).
  };

  // Result of Merge. `map` holds the cells; `reply` holds the other fields of the reply, such as counts.
  struct Merged {
    MergedMap map;
    proto::MergeReply reply;
  };

  struct ShareOptions {
    // Longest wait for the order's end; at most 24 h.
    Duration limit = std::chrono::minutes(10);
    // Called when the progress changes, at most every 0.5 s.
    std::function<void(const proto::ShareProgress&)> on_progress = {};
    // While a pair of agents waits for a lease to end, `limit` is extended to the end of the lease plus this margin. 0,
    // or no on_progress: `limit` is never extended.
    Duration lease_margin = {};
    AgentId destination = 0;  // This and the members below are copied to ShareRequest.
    std::vector<AgentId> from = {};
    std::uint64_t bytes_max = 0;
  };

  // Called with one stored record. If it returns an error, ReadAll stops and returns that error.
  using Visit = std::function<Result<void>(const proto::StoredRecord& stored, const proto::Record& record)>;

  // Connects to an agent. `agent_name` is used in error texts. Fails immediately if no process listens at the endpoint,
  // and after connect_timeout if the process does not respond.
  static Result<std::unique_ptr<Client>> Connect(std::string endpoint, std::string agent_name, Options options);
  ~Client();

  // Sends any request and returns the reply. Include proto/control.pb.h to build the request. If ControlReply.error is
  // set, the call fails with that error.
  Result<proto::ControlReply> Call(const proto::ControlRequest& request);
  Result<proto::ControlReply> Call(const proto::ControlRequest& request, Duration timeout);

  Result<proto::AgentStatus> Status();

  // Inserts all records or none. The records are durable when the call returns. Returns one key per record, in order.
  // If `is_local`, the records are not shared, and the keys have seq 0.
  Result<std::vector<RecordKey>> Insert(const std::vector<proto::Record>& records, bool is_local = false);

  // A record of a type that the team file declares. The agent does not interpret the payload.
  struct Custom {
    std::string type;               // Name of the type, as in Options::custom_types.
    std::int64_t timestamp_ns = 0;  // Timestamp: nanoseconds since 1970, UTC.
    std::string payload;            // At most CustomType.bytes_max bytes.
    std::string latest_key;         // Under the policy `latest`, the newest record per key is kept. At most 256 bytes.
    std::string metadata;           // UTF-8, at most 1024 bytes.
  };
  // Inserts one custom record, like Insert. Fails with kInvalid for a type name that is not in Options::custom_types.
  Result<RecordKey> InsertCustom(Custom custom, bool is_local = false);
  // A relative pose between two nodes of any rovers that is not odometry, as PoseGraphEdge (proto/record.proto).
  struct LoopClosure {
    NodeKey from;  // One of the nodes must belong to the connected agent's robot.
    NodeKey to;
    std::int64_t timestamp_ns = 0;
    proto::Pose from_from_to;
    // The standard deviations x y z (m), roll pitch yaw (rad) of independent errors, or the 21 numbers of
    // RelativePose.covariance.
    std::vector<double> covariance;
    std::string source;  // Name of the producer, such as "apriltag".
  };
  // Inserts one loop closure, like Insert.
  Result<RecordKey> InsertLoopClosure(const LoopClosure& closure);

  // An absolute measurement of a node, as PosePrior (proto/record.proto). `prior.covariance` may also hold the standard
  // deviations of independent errors: 3 for a position, 4 for a position and a yaw, 6 for a pose. The node must belong
  // to the connected agent's robot, or the connected agent must be in command_from of the team file.
  Result<RecordKey> InsertPrior(const proto::PosePrior& prior, std::int64_t timestamp_ns);
  // Returns the built-in or declared type of this name, for ReadRequest::data_types. Fails with kInvalid for an unknown
  // name.
  Result<DataType> TypeNamed(const std::string& name) const;

  Result<proto::ReadReply> Read(const proto::ReadRequest& request);
  // Read returns one page of records. ReadAll reads all records after request.after_row_id, page by page, in the order
  // in which the agent stored them. The limits in the request apply to each page. Fails with kCorrupt if a page does
  // not continue after the page before it.
  Result<void> ReadAll(proto::ReadRequest request, const Visit& visit);
  // Returns the record with this key. Fails with kNotFound if the agent does not hold it.
  Result<proto::StoredRecord> ReadOne(const RecordKey& key);

  // Returns one more than the highest index of this robot's nodes in the agent's store; 0 if the store has none. Reads
  // all these nodes. If the agent has lost its disk, call this only after the next sync, which restores the nodes.
  Result<std::uint64_t> NextNodeIndex();

  // Returns the agent's have-set: the records held and dropped, per stream.
  Result<HaveSet> GetHaveSet();
  // Acknowledges the agent's findings (model/event.h) with timestamps up to `until_ns`. Returns how many findings it
  // acknowledged.
  Result<std::uint32_t> Acknowledge(std::int64_t until_ns);
  // Checks one part of the agent's store for damage. A complete check takes several calls (proto/storage.proto,
  // VerifyRequest).
  Result<proto::VerifyReply> Verify(const proto::VerifyRequest& request);
  // Removes records that `order` selects and that need not be kept. If nothing was removed, PruneReply.text gives the
  // reason.
  Result<proto::PruneReply> Prune(const proto::PruneOrder& order);
  Result<proto::FingerprintReply> Fingerprint(const proto::FingerprintRequest& request);

  Result<proto::RoleShowReply> Roles(bool with_history = false);
  Result<proto::RoleShowReply> SetRoles(const proto::RoleSetRequest& request);
  // Change the roles, and wait at most `limit` until the new leader and survivor confirm the change. Fail like
  // ChangeRolesUntilDone (client/orders.h).
  Result<proto::RoleShowReply> SwapRoles(Duration limit);
  Result<proto::RoleShowReply> SetRoles(proto::RoleSetRequest request, Duration limit);
  // Announces that for `duration` from now, this agent's robot drives or sleeps, or its sharing is paused. `duration`
  // is at most 24 h; 0 ends the lease. To extend a lease, call this again before it expires. Returns the leases of all
  // agents.
  Result<proto::LeaseReply> SetLease(proto::LeaseKind kind, Duration duration);
  // Share records, and wait until all records are acknowledged or nothing more can be done (ShareUntilDone in
  // client/orders.h). At the leader, Sync shares in both directions with every other agent, and Replicate sends all of
  // the leader's records to the designated survivor. At another agent, Sync sends that agent's own records to the
  // leader. Both fail with kRefused if this agent loses the lead during the call.
  Result<proto::ShareProgress> Sync(const ShareOptions& options);
  Result<proto::ShareProgress> Replicate(const ShareOptions& options);
  // Share gives an order to share, and returns without waiting for the order's completion. ShareProgress waits until
  // the progress of an order changes.
  Result<proto::ShareReply> Share(const proto::ShareRequest& request);
  Result<proto::ShareProgress> ShareProgress(const proto::ShareProgressRequest& request);
  Result<proto::ShareStatus> ShareStatus();
  Result<proto::OptimizeReply> Optimize(const proto::OptimizeRequest& request = {});
  Result<proto::GraphStatsReply> GraphStats();
  // Returns the state of the matching of local maps. `wait`: if positive, waits at most this long, and at most 600 s,
  // until no pair of maps is left to match. Fails with kRefused if the agent does not lead.
  Result<proto::RegistrationReply> Registration(std::chrono::milliseconds wait = {});
  // Returns the latest actions of the agent's actors, and the messages that they failed to handle.
  Result<proto::TraceReply> Trace(const proto::TraceRequest& request);
  Result<Merged> Merge(const proto::MergeRequest& request);
  // Returns the value of the cell at a position in the frame `map` in each local map, in the maps' order of precedence.
  Result<proto::MapWhyReply> MapWhy(double x_m, double y_m);
  // `with_cleared`: also finds maps that make many hazard cells of the other agents free, which takes longer.
  Result<proto::MapStatsReply> MapStats(bool with_cleared = false);
  // Returns the tiles of the merged map that changed since the last call with this `request`, and stores the map's
  // version in `request`. The first call, and the first call after the agent's MergeActor restarted, return all tiles
  // with known cells. If request.wait_s is set, the call waits for a change, and returns no tiles if nothing changed.
  // To limit the tiles to a region, set request.region before the first call. Fails with kUnavailable if MergeActor
  // restarts between two parts of a reply, and with kCorrupt if the tiles have more than kAllTilesCellsMax cells.
  Result<MergedTiles> NextMapTiles(proto::MapTilesRequest& request);
  // Makes the next bundle for the ground station or acknowledges a bundle, as set in `request`. If no field is set,
  // lists the unacknowledged bundles.
  Result<proto::DownlinkReply> Downlink(const proto::DownlinkRequest& request);
  // Returns the complete file of a bundle. Calls `fetched` after each part with the bytes received and the bundle's
  // size. Fails with kNotFound if the bundle does not exist or is acknowledged, and with kCorrupt if the bytes received
  // do not match the announced size.
  Result<std::string> FetchBundle(std::uint32_t number, const std::function<void(double bytes, double all)>& fetched);
  // Sends a question to one of the user's actors on the agent and returns the actor's answer. Fails with kNotFound if
  // no user's actor has that name.
  Result<google::protobuf::Any> RequestActor(const std::string& actor, const google::protobuf::Any& question);
  // Asks the agent's process to stop. Returns when the agent has replied; the process ends shortly after.
  Result<void> Stop();

 private:
  class Connection;
  Result<RecordKey> InsertOne(const proto::Record& record, bool is_local);
  Result<proto::ShareProgress> ShareFromHere(proto::SharingKind kind, const ShareOptions& options);
  Result<void> CheckTeam(const proto::ControlReply& reply) const;
  Client(std::unique_ptr<Connection> connection, std::string agent_name, Options options);

  std::unique_ptr<Connection> connection_;
  std::string agent_name_;  // Name of the connected agent, for error texts.
  Options options_;
  std::uint64_t next_request_id_ = 1;
};

}  // namespace moondb
