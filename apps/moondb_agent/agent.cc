#include "apps/moondb_agent/agent.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include "actors/clock/clock_actor.h"
#include "actors/event/event_actor.h"
#include "actors/gateway/gateway_actor.h"
#include "actors/lease/lease_actor.h"
#include "actors/merge/gather_pool.h"
#include "actors/merge/merge_actor.h"
#include "actors/pgo/pgo_actor.h"
#include "actors/retention/retention_actor.h"
#include "actors/role/failover_actor.h"
#include "actors/role/role_actor.h"
#include "actors/sharing/downlink_actor.h"
#include "actors/sharing/replica_actor.h"
#include "actors/sharing/sync_actor.h"
#include "actors/storage/paper_sql.h"
#include "actors/storage/storage_actor.h"
#include "apps/common/data_folder.h"
#include "apps/common/team_clients.h"
#include "apps/common/utc.h"
#include "model/check.h"
#include "runtime/actor_system.h"
#include "runtime/client_list.h"
#include "runtime/zeromq_transport.h"

namespace moondb {
namespace {

// Longer than what lies between two batches of a sync.
constexpr Duration kSolveWhenQuiet = std::chrono::seconds(3);
constexpr std::array kStandardActors = {
    actor_name::kStorage, actor_name::kRole,     actor_name::kLease,    actor_name::kFailover, actor_name::kSync,
    actor_name::kReplica, actor_name::kPgo,      actor_name::kMerge,    actor_name::kGateway,  actor_name::kClock,
    actor_name::kEvent,   actor_name::kDownlink, actor_name::kRetention};
constexpr std::size_t kActorNameMax = 32;
constexpr char kActorNameLetters[] = "abcdefghijklmnopqrstuvwxyz0123456789-_";

// What the operator should hear now and not from an actor's third restart. What is news of the time before is written
// down at once, since this start may still come to nothing. The file that was set aside; empty: none was.
Result<std::string> CheckStore(const StorageActor::Options& options) {
  RecordStore::Options store_options = StorageActor::StoreOptions(options);
  std::random_device entropy;
  store_options.seed = std::uint64_t{entropy()} << 32 | entropy();
  auto store = RecordStore::Open(std::move(store_options));
  if (!store) return tl::unexpected(store.error());
  const Result<void> written = (*store)->WriteDownLastLife(UtcNowNs());
  if (!written) spdlog::warn("how the process before ended is not written down: {}", ToString(written.error()));
  return (*store)->set_aside();
}

Result<void> CheckOwnActors(const std::vector<OwnActor>& actors) {
  if (actors.size() > kOwnActorsMax) return Fail(ErrorCode::kInvalid, "too many own actors", "own_actors");
  std::set<std::string> names(kStandardActors.begin(), kStandardActors.end());
  for (const OwnActor& actor : actors) {
    Check(actor.factory != nullptr, "an own actor has a factory");
    if (actor.name.empty() || actor.name.size() > kActorNameMax ||
        actor.name.find_first_not_of(kActorNameLetters) != std::string::npos) {
      return Fail(ErrorCode::kInvalid, "\"" + actor.name + "\" is no actor's name", "own_actors");
    }
    if (!names.insert(actor.name).second) {
      return Fail(ErrorCode::kInvalid, "an actor " + actor.name + " runs already", "own_actors");
    }
  }
  return {};
}

template <typename ActorType, typename Options>
void SpawnActor(ActorSystem& system, const char* name, Placement placement, Options options) {
  SpawnOptions spawn;
  spawn.placement = placement;
  // Solving and merging take as long as the mission is large.
  if (placement == Placement::kOwnThread) spawn.handler_limit = std::chrono::minutes(1);
  system.Spawn(name, spawn, [options = std::move(options)] { return std::make_unique<ActorType>(options); });
}

}  // namespace

class Agent::Impl {
 public:
  Impl(const TeamFile& team, AgentOptions options, DataFolderLock lock)
      : team_(team), options_(std::move(options)), lock_(std::move(lock)) {}

  ~Impl() {
    if (dumps_on_crash_) DumpTraceOnCrash(nullptr, "");
    if (!has_failed_) stopped_at_ns_ = UtcNowNs();
    // Actors end while the transport still stands (they may send to it); then nothing calls the system any more.
    if (system_ != nullptr) system_->Stop();
    transport_.reset();
  }

  Result<void> Start() {
    self_ = FindAgent(team_.config, options_.name)->id();
    auto endpoint = ClientEndpoint(team_, options_.name);
    if (!endpoint) return tl::unexpected(endpoint.error());
    endpoint_ = *endpoint;
    const Result<std::string> set_aside = CheckStore(StorageOptions());
    if (!set_aside) return tl::unexpected(set_aside.error());
    set_aside_ = *set_aside;
    if (options_.merge_backend == MergeBackend::kGl) {
      if (auto gl = CreateGatherBackend(MergeBackend::kGl); !gl) return tl::unexpected(gl.error());
    }
    MakeSystem();
    if (auto running = Run(); !running) return running;
    // For clients whose environment is another one; a full disk keeps nobody from starting.
    if (auto told = WriteEndpoint(options_.data_folder, endpoint_); !told) spdlog::warn("{}", ToString(told.error()));
    return {};
  }

  const std::string& endpoint() const { return endpoint_; }
  SendResult Post(const std::string& actor, proto::Message message) { return system_->Post(actor, std::move(message)); }

  void WriteTrace() const { system_->trace_book().WriteFile(TracePath().c_str()); }
  void WriteTraceOnCrash() {
    dumps_on_crash_ = true;
    DumpTraceOnCrash(&system_->trace_book(), TracePath());
  }

 private:
  std::string TracePath() const { return options_.data_folder / "trace.txt"; }

  StorageActor::Options StorageOptions() const {
    StorageActor::Options storage;
    storage.path = options_.data_folder / kDatabaseFile;
    storage.self = self_;
    storage.team = team_.config;
    return storage;
  }

  void MakeSystem() {
    ActorSystem::Options system;
    system.self = self_;
    system.base_station = BaseStationOf(team_.config);
    system.on_fatal = [this](const Error& error) {
      has_failed_ = true;
      if (!options_.on_fatal) std::abort();
      options_.on_fatal(error);
    };
    system.on_stop_requested = options_.on_stop_requested;
    system_ = std::make_unique<ActorSystem>(std::move(system));

    const proto::TeamConfig& team = team_.config;
    StorageActor::Options storage = StorageOptions();
    storage.is_checked = true;  // By CheckStore.
    storage.set_aside = set_aside_;
    storage.stopped_at_ns = [this]() -> std::optional<std::int64_t> {
      const std::int64_t stopped_at_ns = stopped_at_ns_;
      return stopped_at_ns == 0 ? std::nullopt : std::optional(stopped_at_ns);
    };
    SpawnActor<StorageActor>(*system_, actor_name::kStorage, Placement::kOwnThread, std::move(storage));

    ClockActor::Options clock;
    clock.self = self_;
    clock.team = team;
    SpawnActor<ClockActor>(*system_, actor_name::kClock, Placement::kPool, std::move(clock));

    RoleActor::Options role;
    role.self = self_;
    role.team = team;
    SpawnActor<RoleActor>(*system_, actor_name::kRole, Placement::kPool, std::move(role));

    LeaseActor::Options lease;
    lease.self = self_;
    lease.team = team;
    SpawnActor<LeaseActor>(*system_, actor_name::kLease, Placement::kPool, std::move(lease));

    FailoverActor::Options failover;
    failover.self = self_;
    failover.team = team;
    SpawnActor<FailoverActor>(*system_, actor_name::kFailover, Placement::kPool, std::move(failover));

    SharingActor::Options sharing;
    sharing.self = self_;
    sharing.team = team;
    sharing.config_hash = team_.hash;
    sharing.session.paper_sql = {SqlOf, RecordOf};
    SpawnActor<SyncActor>(*system_, actor_name::kSync, Placement::kPool, sharing);
    SpawnActor<ReplicaActor>(*system_, actor_name::kReplica, Placement::kPool, std::move(sharing));

    RetentionActor::Options retention;
    retention.self = self_;
    retention.team = team;
    SpawnActor<RetentionActor>(*system_, actor_name::kRetention, Placement::kPool, std::move(retention));

    EventActor::Options event;
    event.self = self_;
    event.team = team;
    event.version = options_.version;
    SpawnActor<EventActor>(*system_, actor_name::kEvent, Placement::kPool, std::move(event));

    DownlinkActor::Options downlink;
    downlink.self = self_;
    downlink.team = team;
    SpawnActor<DownlinkActor>(*system_, actor_name::kDownlink, Placement::kPool, std::move(downlink));

    PgoActor::Options pgo;
    pgo.self = self_;
    pgo.team = team;
    if (team.pose_graph().solve_by_itself()) pgo.solve_when_quiet = kSolveWhenQuiet;
    SpawnActor<PgoActor>(*system_, actor_name::kPgo, Placement::kOwnThread, std::move(pgo));

    merge_backend_ = ResolveMergeBackend(options_.merge_backend);
    MergeActor::Options merge;
    merge.self = self_;
    merge.team = team;
    merge.backend = options_.merge_backend;
    merge.merge_threads = HardwareThreads();
    merge.on_backend = [this](const std::string& backend) { merge_backend_ = *ParseMergeBackend(backend); };
    SpawnActor<MergeActor>(*system_, actor_name::kMerge, Placement::kOwnThread, std::move(merge));

    GatewayActor::Options gateway;
    gateway.self = self_;
    gateway.team = team;
    gateway.config_hash = team_.hash;
    gateway.version = options_.version;
    gateway.pid = static_cast<std::uint32_t>(::getpid());
    gateway.merge_backend = [this] { return ToString(merge_backend_); };
    gateway.refused_handshakes = [this] { return transport_->refused_clients(); };  // It stands while actors run.
    for (const OwnActor& actor : options_.own_actors) gateway.own_actors.insert(actor.name);
    SpawnActor<GatewayActor>(*system_, actor_name::kGateway, Placement::kPool, std::move(gateway));

    for (const OwnActor& actor : options_.own_actors) system_->Spawn(actor.name, actor.spawn, actor.factory);
  }

  // The transport must exist before the system starts, and may deliver only from then on: until then its messages are
  // lost, which its contract allows.
  Result<void> Run() {
    ZeroMqTransport::Options options;
    options.self = self_;
    options.client_endpoint = endpoint_;
    options.secret_key_file = options_.secret_key_file;
    options.clients_file = options_.clients_file.empty() ? team_.folder / kClientsFile : options_.clients_file;
    auto transport = ZeroMqTransport::Create(
        team_.config, team_.folder.string(), std::move(options),
        [this](OwnedMessage message) {
          if (is_running_) (void)system_->Deliver(std::move(message));
        },
        [this](AgentId peer, bool is_connected) { system_->OnPeerChanged(peer, is_connected); });
    if (!transport) return tl::unexpected(transport.error());
    transport_ = std::move(*transport);
    is_running_ = true;
    system_->Start(transport_.get());
    return {};
  }

  const TeamFile team_;
  const AgentOptions options_;
  DataFolderLock lock_;  // Freed last: the database is closed before.
  AgentId self_ = 0;
  std::string endpoint_;
  std::string set_aside_;  // At this start.
  bool dumps_on_crash_ = false;
  std::atomic<bool> has_failed_ = false;         // An actor is beyond help: this is no end that was asked for.
  std::atomic<std::int64_t> stopped_at_ns_ = 0;  // 0: it runs, or failed.
  std::atomic<bool> is_running_ = false;
  std::atomic<MergeBackend> merge_backend_ = MergeBackend::kCpu;  // That merges now.
  std::unique_ptr<ActorSystem> system_;
  std::unique_ptr<ZeroMqTransport> transport_;
};

Agent::Agent(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Agent::~Agent() = default;

const std::string& Agent::client_endpoint() const { return impl_->endpoint(); }
SendResult Agent::Post(const std::string& actor, proto::Message message) {
  return impl_->Post(actor, std::move(message));
}
void Agent::WriteTrace() const { impl_->WriteTrace(); }
void Agent::WriteTraceOnCrash() const { impl_->WriteTraceOnCrash(); }

Result<std::unique_ptr<Agent>> Agent::Start(const TeamFile& team, AgentOptions options) {
  if (auto named = AgentNamed(team.config, options.name); !named) return tl::unexpected(named.error());
  if (auto checked = CheckOwnActors(options.own_actors); !checked) return tl::unexpected(checked.error());
  auto lock = DataFolderLock::Take(options.data_folder);
  if (!lock) return tl::unexpected(lock.error());
  const DataOwner owner = DataOwnerOf(team.config, *FindAgent(team.config, options.name));
  if (auto marked = MarkDataFolder(options.data_folder, owner); !marked) {
    if (marked.error().code == ErrorCode::kRefused) return tl::unexpected(marked.error());
    spdlog::warn("{}", ToString(marked.error()));  // On a full disk; the store itself says whose it is.
  }
  auto impl = std::make_unique<Impl>(team, std::move(options), std::move(*lock));
  if (auto started = impl->Start(); !started) return tl::unexpected(started.error());
  return std::unique_ptr<Agent>(new Agent(std::move(impl)));
}

}  // namespace moondb
