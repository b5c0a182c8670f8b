#include "apps/moondb_ros/agent_link.h"

#include <chrono>
#include <utility>

#include "client/record_feed.h"
#include "model/file_writing.h"
#include "model/text.h"
#include "proto/map.pb.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr auto kRetryAfter = std::chrono::seconds(1);
constexpr double kMapWait_s = 3;  // The end of the link may take this long.
constexpr std::size_t kStateBytesMax = 64 * 1024;
constexpr auto kPosesWait = std::chrono::seconds(3);

}  // namespace

Result<std::optional<RobotMapper::Stored>> ReadNewestNode(Client& client, AgentId agent) {
  proto::ReadRequest request;
  request.add_data_types(proto::POSE_GRAPH_NODE);
  request.add_origin_agents(agent);
  std::optional<RobotMapper::Stored> newest;
  const Result<void> read = client.ReadAll(request, [&](const proto::StoredRecord&, const proto::Record& record) {
    const proto::PoseGraphNode& node = record.pose_graph_node();
    const Result<Pose> pose = FromProto(node.map_from_node());
    if (pose && (!newest || node.node().index() > newest->index)) {
      newest = RobotMapper::Stored{node.node().index(), record.timestamp_ns(), *pose, {}};
    }
    return Result<void>();
  });
  if (!read) return tl::unexpected(read.error());
  return newest;
}

proto::RosState ReadRosState(const std::filesystem::path& file) {
  const Result<std::string> content = ReadTextFile(file, kStateBytesMax);
  proto::RosState state;
  return content && state.ParseFromString(*content) ? state : proto::RosState();
}

AgentLink::AgentLink(AgentId agent, bool is_start_known, std::filesystem::path state_file, Connect connect,
                     std::function<void(const std::string&)> print)
    : agent_(agent),
      state_file_(std::move(state_file)),
      connect_(std::move(connect)),
      print_(std::move(print)),
      inserter_(print_),
      frame_(agent, is_start_known) {
  threads_.emplace_back([this] { Repeat("inserting", [this](Client& client) { return InsertNext(client); }); });
  threads_.emplace_back([this] { Repeat("the merged map", [this](Client& client) { return FollowMap(client); }); });
  threads_.emplace_back([this] { Repeat("poses", [this](Client& client) { return FollowPoses(client); }); });
}

AgentLink::~AgentLink() {
  {
    const std::lock_guard lock(mutex_);
    is_ended_ = true;
  }
  ended_.notify_all();
  outbox_.Close();
  for (std::thread& thread : threads_) thread.join();
}

bool AgentLink::WaitASecond() {
  std::unique_lock lock(mutex_);
  return !ended_.wait_for(lock, kRetryAfter, [this] { return is_ended_; });
}

void AgentLink::Repeat(const std::string& what, const std::function<Result<void>(Client&)>& work) {
  std::string printed;
  do {
    Result<std::unique_ptr<Client>> client = connect_();
    Result<void> done = client ? work(**client) : tl::unexpected(client.error());
    if (done) return;  // The link ends.
    if (std::exchange(printed, done.error().text) != done.error().text) {
      print_(what + ": " + done.error().text + "; retrying each second");
    }
  } while (WaitASecond());
}

void AgentLink::Insert(RobotMapper::Made made, const Pose& track_from_node) {
  {
    const std::lock_guard lock(mutex_);
    frame_.AddTrack(IndexOf(made), track_from_node);
  }
  const std::size_t dropped = outbox_.Add(std::move(made));
  if (dropped > 0 && !std::exchange(has_dropped_maps_, true)) {
    print_("the agent accepts no records: the oldest waiting maps are dropped");
  }
}

Result<void> AgentLink::InsertNext(Client& client) {
  while (const std::optional<RobotMapper::Made> made = outbox_.Next()) {
    const Result<void> inserted =
        inserter_.Insert(*made, {[&client](const std::vector<proto::Record>& records) -> Result<void> {
                                   const auto keys = client.Insert(records);
                                   return keys ? Result<void>() : tl::unexpected(keys.error());
                                 },
                                 [&client, this] { return ReadNewestNode(client, agent_); }});
    if (!inserted && inserted.error().code == ErrorCode::kInvalid) {
      const std::lock_guard lock(mutex_);
      refusal_ = inserted.error();
      return {};
    }
    if (!inserted) return inserted;
    SaveState(made->state);
    outbox_.Remove();
  }
  return {};
}

std::optional<Error> AgentLink::Refusal() const {
  const std::lock_guard lock(mutex_);
  return refusal_;
}

void AgentLink::SaveState(const proto::RosState& state) {
  const WriteOptions options{0600, {}, false};
  if (const auto saved = WriteWholeFile(state_file_, state.SerializeAsString(), options); !saved) {
    print_(ToString(saved.error()) + ": after a restart, the odometry to the next node will get a large covariance");
  }
}

Result<void> AgentLink::FollowMap(Client& client) {
  proto::MapTilesRequest request;
  while (true) {
    request.set_wait_s(kMapWait_s);
    const Result<MergedTiles> tiles = client.NextMapTiles(request);
    if (!tiles) return tl::unexpected(tiles.error());
    const std::lock_guard lock(mutex_);
    if (is_ended_) return {};
    is_map_new_ = image_.Add(*tiles) || is_map_new_;
    frame_of_ = tiles->frame_of;
  }
}

Result<void> AgentLink::FollowPoses(Client& client) {
  proto::ReadRequest filter;
  filter.add_data_types(proto::POSE_GRAPH_NODE);
  filter.add_data_types(proto::OPTIMIZED_POSE);
  RecordFeed feed(client, filter);
  while (true) {
    const Result<proto::ReadReply> page = feed.Next(kPosesWait);
    if (!page) return tl::unexpected(page.error());
    const std::lock_guard lock(mutex_);
    if (is_ended_) return {};
    for (const proto::StoredRecord& stored : page->records()) {
      proto::Record record;
      if (record.ParseFromString(stored.content())) frame_.Add(stored, record);
    }
  }
}

std::optional<Pose> AgentLink::TeamFromTrack() {
  const std::lock_guard lock(mutex_);
  if (!frame_of_ || *frame_of_ != 0) return std::nullopt;
  return frame_.TeamFromTrack();
}

std::optional<TeamMapImage::Picture> AgentLink::TakeNewMap(const Eigen::Vector2d& robot_m) {
  const std::lock_guard lock(mutex_);
  if (!std::exchange(is_map_new_, false)) return std::nullopt;
  return image_.ToGrid(robot_m);
}

}  // namespace moondb
