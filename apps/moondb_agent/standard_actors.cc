#include "apps/moondb_agent/standard_actors.h"

#include <chrono>
#include <memory>
#include <utility>

#include "actors/storage/paper_sql.h"

namespace moondb {
namespace {

// The leader starts a solve when no node or edge has been stored for this time. Longer than the pause between two
// batches of a sync.
constexpr Duration kSolveWhenQuiet = std::chrono::seconds(3);

template <typename ActorType, typename Options>
ActorFactory Make(const proto::TeamConfig& team, AgentId self, Options options) {
  options.self = self;
  options.team = team;
  return [options = std::move(options)] { return std::make_unique<ActorType>(options); };
}

}  // namespace

std::vector<StandardActor> StandardActors(const proto::TeamConfig& team, AgentId self, std::uint64_t config_hash,
                                          StandardActorOptions options) {
  options.sharing.config_hash = config_hash;
  options.sharing.session.paper_sql = {SqlOf, RecordOf};
  options.gateway.config_hash = config_hash;
  if (team.pose_graph().solve_by_itself()) options.pgo.solve_when_quiet = kSolveWhenQuiet;
  constexpr Placement kPool = Placement::kPool;
  constexpr Placement kOwnThread = Placement::kOwnThread;
  return {
      {actor_name::kStorage, kOwnThread, Make<StorageActor>(team, self, std::move(options.storage))},
      {actor_name::kClock, kPool, Make<ClockActor>(team, self, std::move(options.clock))},
      {actor_name::kRole, kPool, Make<RoleActor>(team, self, std::move(options.role))},
      {actor_name::kLease, kPool, Make<LeaseActor>(team, self, std::move(options.lease))},
      {actor_name::kFailover, kPool, Make<FailoverActor>(team, self, std::move(options.failover))},
      {actor_name::kRetention, kPool, Make<RetentionActor>(team, self, std::move(options.retention))},
      {actor_name::kSync, kPool, Make<SyncActor>(team, self, options.sharing)},
      {actor_name::kReplica, kPool, Make<ReplicaActor>(team, self, std::move(options.sharing))},
      {actor_name::kEvent, kPool, Make<EventActor>(team, self, std::move(options.event))},
      {actor_name::kDownlink, kPool, Make<DownlinkActor>(team, self, std::move(options.downlink))},
      {actor_name::kPgo, kOwnThread, Make<PgoActor>(team, self, std::move(options.pgo))},
      {actor_name::kRegister, Placement::kBackground, Make<RegisterActor>(team, self, std::move(options.registration))},
      {actor_name::kMerge, kOwnThread, Make<MergeActor>(team, self, std::move(options.merge))},
      {actor_name::kGateway, kPool, Make<GatewayActor>(team, self, std::move(options.gateway))},
  };
}

}  // namespace moondb
