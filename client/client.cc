#include "client/client.h"

#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "client/connection.h"
#include "client/merged_map.h"
#include "model/control_request.h"
#include "model/team_id.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

constexpr std::chrono::milliseconds kTimeoutBeyondWait(30'000);

// Returns the name "user@machine", for example "anna@hill".
std::string UserAtMachine() {
  char machine[256] = "";
  if (gethostname(machine, sizeof(machine) - 1) != 0) machine[0] = '\0';
  passwd entry{};
  passwd* user = nullptr;
  char buffer[4096];
  (void)getpwuid_r(geteuid(), &entry, buffer, sizeof(buffer), &user);
  return (user != nullptr ? user->pw_name : std::to_string(geteuid())) + std::string("@") + machine;
}

// Writes the upper triangle of a covariance. `numbers` is this triangle, or `size` standard deviations. The agent
// refuses other lengths.
void SetCovariance(const std::vector<double>& numbers, std::size_t size,
                   google::protobuf::RepeatedField<double>& triangle) {
  if (numbers.size() != size) {
    triangle = {numbers.begin(), numbers.end()};
    return;
  }
  triangle.Clear();
  for (std::size_t row = 0; row < size; ++row) {
    for (std::size_t column = row; column < size; ++column) {
      triangle.Add(row == column ? numbers[row] * numbers[row] : 0);
    }
  }
}

// A smaller tile counts as this many cells. Otherwise many tiny tiles could take much memory within the limit.
constexpr std::uint64_t kSmallTileCells = 64 * 64;

// Returns the number of cells of the tiles, for the limit kAllTilesCellsMax.
std::uint64_t CountedCells(const proto::MapTilesReply& part) {
  const std::uint64_t cells = std::uint64_t{part.tile_cells()} * part.tile_cells();
  return std::max(cells, kSmallTileCells) * static_cast<std::uint64_t>(part.tiles_size());
}

// Returns true if all rows of the page lie above request.after_row_id and the last one is the highest. Then each page
// is a step to the end.
bool Advances(const proto::ReadReply& page, const proto::ReadRequest& request) {
  if (request.is_newest_first()) return true;
  return std::all_of(page.row_ids().begin(), page.row_ids().end(), [&](std::uint64_t row) {
    return row > request.after_row_id() && row <= *page.row_ids().rbegin();
  });
}

}  // namespace

Client::Client(std::unique_ptr<Connection> connection, std::string agent_name, Options options)
    : connection_(std::move(connection)), agent_name_(std::move(agent_name)), options_(std::move(options)) {}

Client::~Client() = default;

Result<std::unique_ptr<Client>> Client::Connect(std::string endpoint, std::string agent_name, Options options) {
  auto connection = std::make_unique<Connection>(std::move(endpoint), agent_name, options);
  if (auto opened = connection->Open(options.connect_timeout); !opened) {
    return tl::unexpected(opened.error());
  }
  if (options.by.empty()) options.by = UserAtMachine();
  return std::unique_ptr<Client>(new Client(std::move(connection), std::move(agent_name), std::move(options)));
}

Result<proto::ControlReply> Client::Call(const proto::ControlRequest& request) {
  const Duration waits = WaitOf(request);
  if (waits > Duration(0)) return Call(request, waits + std::max(options_.timeout, kTimeoutBeyondWait));
  return Call(request, TakesLong(request) ? options_.long_timeout : options_.timeout);
}

Result<proto::ControlReply> Client::Call(const proto::ControlRequest& request, Duration timeout) {
  const std::uint64_t id = next_request_id_++;
  proto::ClientMessage message;
  message.set_request_id(id);
  *message.mutable_control_request() = request;
  message.mutable_control_request()->set_for_agent(options_.for_agent);
  message.mutable_control_request()->set_by(options_.by);
  message.mutable_control_request()->set_team_id(TeamIdBytes(options_.team_id));
  const std::size_t bytes_max = connection_->is_keyed() ? std::min(options_.message_bytes_max, kKeyedRequestBytesMax)
                                                        : options_.message_bytes_max;
  if (message.ByteSizeLong() > bytes_max) {
    return Fail(ErrorCode::kInvalid, "the request is larger than the " + std::to_string(bytes_max) +
                                         " bytes that a message may have" +
                                         (connection_->is_keyed() ? " over the network" : ""));
  }
  if (auto opened = connection_->Open(options_.connect_timeout); !opened) return tl::unexpected(opened.error());
  if (auto sent = connection_->Send(message.SerializeAsString()); !sent) return tl::unexpected(sent.error());

  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    auto frame = connection_->Receive(deadline);
    if (!frame) return tl::unexpected(frame.error());
    proto::ClientMessage answer;
    if (!answer.ParseFromString(*frame) || !answer.has_control_reply()) {
      return Fail(ErrorCode::kCorrupt, "the agent's answer does not decode");
    }
    if (answer.request_id() != id) continue;  // A late reply to an earlier call that timed out.
    if (auto same = CheckTeam(answer.control_reply()); !same) return tl::unexpected(same.error());
    if (IsError(answer.control_reply().error())) return tl::unexpected(FromProto(answer.control_reply().error()));
    if (options_.on_config_hash) options_.on_config_hash(answer.control_reply().config_hash());
    return std::move(*answer.mutable_control_reply());
  }
}

Result<void> Client::CheckTeam(const proto::ControlReply& reply) const {
  const std::string own = TeamIdBytes(options_.team_id);
  if (own.empty() || reply.team_id() == own) return {};
  return Fail(ErrorCode::kRefused, "the process at the address of agent " + agent_name_ +
                                       " belongs to another team: its team id is " + TeamIdStart(reply.team_id()) +
                                       ", that of this team " + TeamIdStart(own));
}

Result<proto::AgentStatus> Client::Status() {
  proto::ControlRequest request;
  request.mutable_status();
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_status()); });
}

Result<std::vector<RecordKey>> Client::Insert(const std::vector<proto::Record>& records, bool is_local) {
  proto::ControlRequest request;
  request.mutable_insert()->set_is_local(is_local);
  *request.mutable_insert()->mutable_records() = {records.begin(), records.end()};
  return Call(request).map([](const proto::ControlReply& reply) {
    std::vector<RecordKey> keys;
    keys.reserve(static_cast<std::size_t>(reply.insert().keys_size()));
    for (const proto::RecordKey& key : reply.insert().keys()) keys.push_back(FromProto(key));
    return keys;
  });
}

Result<RecordKey> Client::InsertCustom(Custom custom, bool is_local) {
  const Result<DataType> type = TypeNamed(custom.type);
  if (!type) return tl::unexpected(type.error());
  if (!IsCustom(*type)) return Fail(ErrorCode::kInvalid, custom.type + " is not a custom type", "type");
  proto::Record record;
  record.set_timestamp_ns(custom.timestamp_ns);
  proto::CustomRecord& body = *record.mutable_custom();
  body.set_data_type(*type);
  body.set_latest_key(std::move(custom.latest_key));
  body.set_payload(std::move(custom.payload));
  body.set_metadata(std::move(custom.metadata));
  return InsertOne(record, is_local);
}

Result<RecordKey> Client::InsertOne(const proto::Record& record, bool is_local) {
  const Result<std::vector<RecordKey>> keys = Insert({record}, is_local);
  if (!keys) return tl::unexpected(keys.error());
  if (keys->size() != 1) return Fail(ErrorCode::kCorrupt, "the agent's answer does not have one key for each record");
  return keys->front();
}

Result<RecordKey> Client::InsertLoopClosure(const LoopClosure& closure) {
  proto::Record record;
  record.set_timestamp_ns(closure.timestamp_ns);
  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  *edge.mutable_from() = ToProto(closure.from);
  *edge.mutable_to() = ToProto(closure.to);
  *edge.mutable_relative_pose()->mutable_from_from_to() = closure.from_from_to;
  edge.set_source(closure.source);
  if (closure.source.empty()) return Fail(ErrorCode::kInvalid, "is missing", "source");
  SetCovariance(closure.covariance, 6, *edge.mutable_relative_pose()->mutable_covariance());
  return InsertOne(record, /*is_local=*/false);
}

Result<RecordKey> Client::InsertPrior(const proto::PosePrior& prior, std::int64_t timestamp_ns) {
  proto::Record record;
  record.set_timestamp_ns(timestamp_ns);
  proto::PosePrior& body = *record.mutable_pose_prior();
  body = prior;
  const std::size_t size = prior.has_pose() ? 6 : prior.has_position_yaw() ? 4 : 3;
  SetCovariance({prior.covariance().begin(), prior.covariance().end()}, size, *body.mutable_covariance());
  return InsertOne(record, /*is_local=*/false);
}

Result<DataType> Client::TypeNamed(const std::string& name) const {
  if (const auto type = DataTypeFromName(name, options_.custom_types)) return *type;
  return Fail(ErrorCode::kInvalid, "no data type \"" + name + "\"", "type");
}

Result<proto::ReadReply> Client::Read(const proto::ReadRequest& read) {
  proto::ControlRequest request;
  *request.mutable_read() = read;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_read()); });
}

Result<void> Client::ReadAll(proto::ReadRequest request, const Visit& visit) {
  while (true) {
    auto page = Read(request);
    if (!page) return tl::unexpected(page.error());
    if (page->row_ids_size() != page->records_size()) {
      return Fail(ErrorCode::kCorrupt, "the agent's page does not have one row id for each record");
    }
    if (!Advances(*page, request)) {
      return Fail(ErrorCode::kCorrupt, "the agent sends rows out of order, so reading might not end");
    }
    for (const proto::StoredRecord& stored : page->records()) {
      proto::Record record;
      if (!record.ParseFromString(stored.content())) {
        return Fail(ErrorCode::kCorrupt, "record " + ToString(FromProto(stored.key())) + " does not decode");
      }
      if (auto visited = visit(stored, record); !visited) return visited;
    }
    if (page->is_complete() || page->row_ids().empty()) return {};
    request.set_after_row_id(*page->row_ids().rbegin());
  }
}

Result<proto::StoredRecord> Client::ReadOne(const RecordKey& key) {
  proto::ReadRequest request;
  *request.add_keys() = ToProto(key);
  Result<proto::ReadReply> page = Read(request);
  if (!page) return tl::unexpected(page.error());
  // An agent that does not know the field `keys` sends other records.
  for (proto::StoredRecord& stored : *page->mutable_records()) {
    if (FromProto(stored.key()) == key) return std::move(stored);
  }
  return Fail(ErrorCode::kNotFound, agent_name_ + " does not hold " + ToString(key));
}

Result<std::uint64_t> Client::NextNodeIndex() {
  const Result<proto::AgentStatus> status = Status();
  if (!status) return tl::unexpected(status.error());
  proto::ReadRequest request;
  request.add_data_types(proto::POSE_GRAPH_NODE);
  request.add_origin_agents(status->agent_id());
  std::uint64_t next = 0;
  const Result<void> read =
      ReadAll(request, [&next](const proto::StoredRecord&, const proto::Record& record) -> Result<void> {
        next = std::max(next, record.pose_graph_node().node().index() + 1);
        return {};
      });
  if (!read) return tl::unexpected(read.error());
  return next;
}

Result<HaveSet> Client::GetHaveSet() {
  proto::ControlRequest request;
  request.mutable_have();
  const auto reply = Call(request);
  if (!reply) return tl::unexpected(reply.error());
  return FromProto(reply->have().have());
}

Result<proto::VerifyReply> Client::Verify(const proto::VerifyRequest& verify) {
  proto::ControlRequest request;
  *request.mutable_verify() = verify;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_verify()); });
}

Result<proto::FingerprintReply> Client::Fingerprint(const proto::FingerprintRequest& fingerprint) {
  proto::ControlRequest request;
  *request.mutable_fingerprint() = fingerprint;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_fingerprint()); });
}

Result<proto::RoleShowReply> Client::Roles(bool with_history) {
  proto::ControlRequest request;
  request.mutable_role_show()->set_with_history(with_history);
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_roles()); });
}

Result<proto::RoleShowReply> Client::SetRoles(const proto::RoleSetRequest& set) {
  proto::ControlRequest request;
  *request.mutable_role_set() = set;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_roles()); });
}

Result<proto::PruneReply> Client::Prune(const proto::PruneOrder& order) {
  proto::ControlRequest request;
  *request.mutable_prune() = order;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_prune()); });
}

Result<std::uint32_t> Client::Acknowledge(std::int64_t until_ns) {
  proto::ControlRequest request;
  request.mutable_acknowledge()->set_until_ns(until_ns);
  return Call(request).map([](const proto::ControlReply& reply) { return reply.acknowledge().count(); });
}

Result<proto::LeaseReply> Client::SetLease(proto::LeaseKind kind, Duration duration) {
  proto::ControlRequest request;
  request.mutable_lease()->set_kind(kind);
  request.mutable_lease()->set_seconds(std::chrono::duration<double>(duration).count());
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_lease()); });
}

Result<proto::ShareReply> Client::Share(const proto::ShareRequest& share) {
  proto::ControlRequest request;
  *request.mutable_share() = share;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_share()); });
}

Result<proto::ShareProgress> Client::ShareProgress(const proto::ShareProgressRequest& progress) {
  proto::ControlRequest request;
  *request.mutable_share_progress() = progress;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_share_progress()); });
}

Result<proto::ShareStatus> Client::ShareStatus() {
  proto::ControlRequest request;
  request.mutable_share_status();
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_share_status()); });
}

Result<proto::OptimizeReply> Client::Optimize(const proto::OptimizeRequest& optimize) {
  proto::ControlRequest request;
  *request.mutable_optimize() = optimize;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_optimize()); });
}

Result<proto::GraphStatsReply> Client::GraphStats() {
  proto::ControlRequest request;
  request.mutable_graph_stats();
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_graph_stats()); });
}

Result<proto::RegistrationReply> Client::Registration(std::chrono::milliseconds wait) {
  proto::ControlRequest request;
  request.mutable_registration()->set_wait_s(std::chrono::duration<double>(wait).count());
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_registration()); });
}

Result<proto::TraceReply> Client::Trace(const proto::TraceRequest& trace) {
  proto::ControlRequest request;
  *request.mutable_trace() = trace;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_trace()); });
}

Result<proto::MapWhyReply> Client::MapWhy(double x_m, double y_m) {
  proto::ControlRequest request;
  request.mutable_map_why()->set_x_m(x_m);
  request.mutable_map_why()->set_y_m(y_m);
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_map_why()); });
}

Result<proto::MapStatsReply> Client::MapStats(bool with_cleared) {
  proto::ControlRequest request;
  request.mutable_map_stats()->set_with_cleared(with_cleared);
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_map_stats()); });
}

Result<MergedTiles> Client::NextMapTiles(proto::MapTilesRequest& request) {
  proto::ControlRequest control;
  proto::MapTilesRequest& asked = *control.mutable_map_tiles();
  asked = request;
  asked.clear_after();
  MergedTiles all;
  std::uint64_t all_cells = 0;
  std::optional<proto::MapTilesReply> first;
  while (true) {
    auto reply = Call(control);
    if (!reply) return tl::unexpected(reply.error());
    const proto::MapTilesReply& part = reply->map_tiles();
    auto tiles = DecodeMapTiles(part);
    if (!tiles) return tl::unexpected(tiles.error());
    if (first && part.merger_id() != first->merger_id()) {
      request.clear_merger_id();
      return Fail(ErrorCode::kUnavailable, "the agent restarted its merging; ask again");
    }
    all_cells += CountedCells(part);
    if (all_cells > kAllTilesCellsMax) {
      return Fail(ErrorCode::kCorrupt, "the agent sends more tiles of the merged map than a map may have");
    }
    all.tiles.insert(all.tiles.end(), std::make_move_iterator(tiles->begin()), std::make_move_iterator(tiles->end()));
    if (!first) first = part;
    if (part.is_complete() || part.tiles().empty()) break;
    asked.clear_wait_s();  // Wait for a change only before the first part.
    *asked.mutable_after() = *part.tiles().rbegin();
    asked.mutable_after()->clear_zstd_cells();
  }
  all.is_everything = request.merger_id() != first->merger_id();
  all.frame_of = first->frame_of();
  request.set_merger_id(first->merger_id());
  request.set_since_version(first->version());
  return all;
}

Result<Client::Merged> Client::Merge(const proto::MergeRequest& merge) {
  proto::ControlRequest request;
  *request.mutable_merge() = merge;
  auto reply = Call(request);
  if (!reply) return tl::unexpected(reply.error());
  auto map = DecodeMergedMap(reply->merge());
  if (!map) return tl::unexpected(map.error());
  reply->mutable_merge()->clear_zstd_cells();
  return Merged{std::move(*map), std::move(*reply->mutable_merge())};
}

Result<proto::DownlinkReply> Client::Downlink(const proto::DownlinkRequest& downlink) {
  proto::ControlRequest request;
  *request.mutable_downlink() = downlink;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_downlink()); });
}

Result<std::string> Client::FetchBundle(std::uint32_t number,
                                        const std::function<void(double bytes, double all)>& fetched) {
  proto::ControlRequest request;
  request.mutable_read_bundle()->set_number(number);
  std::string file;
  while (true) {
    request.mutable_read_bundle()->set_first_byte(file.size());
    const auto reply = Call(request);
    if (!reply) return tl::unexpected(reply.error());
    const proto::ReadBundleReply& part = reply->read_bundle();
    const auto bytes = static_cast<double>(file.size() + part.part().size());
    if (bytes > part.bundle().bytes() || (part.part().empty() && bytes < part.bundle().bytes())) {
      return Fail(ErrorCode::kCorrupt, "the agent's bundle has another size than it says");
    }
    file += part.part();
    fetched(bytes, part.bundle().bytes());
    if (bytes == part.bundle().bytes()) return file;
  }
}

Result<google::protobuf::Any> Client::RequestActor(const std::string& actor, const google::protobuf::Any& question) {
  proto::ControlRequest request;
  request.mutable_custom()->set_actor(actor);
  *request.mutable_custom()->mutable_body() = question;
  return Call(request).map([](proto::ControlReply&& reply) { return std::move(*reply.mutable_custom()); });
}

Result<void> Client::Stop() {
  proto::ControlRequest request;
  request.mutable_stop();
  return Call(request).map([](const proto::ControlReply&) {});
}

}  // namespace moondb
