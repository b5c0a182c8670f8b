#include "apps/moondb_agent/agent.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include "actors/merge/gather_pool.h"
#include "apps/common/data_folder.h"
#include "apps/common/team_clients.h"
#include "apps/common/utc.h"
#include "apps/moondb_agent/standard_actors.h"
#include "model/check.h"
#include "model/team_member.h"
#include "runtime/actor_system.h"
#include "runtime/team/client_list.h"
#include "runtime/team/record_signature.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_keys.h"
#include "runtime/transport/zeromq_transport.h"

namespace moondb {
namespace {

constexpr std::size_t kActorNameMax = 32;
constexpr char kActorNameLetters[] = "abcdefghijklmnopqrstuvwxyz0123456789-_";

// Opens and closes the store before any actor runs, so that Start returns an error if the store is unusable. Logs how
// the last process ended, even if this start fails later. Returns the path of the damaged file that RecordStore::Open
// set aside, or "" if there was none.
Result<std::string> CheckStore(const StorageActor::Options& options) {
  RecordStore::Options store_options = StorageActor::StoreOptions(options);
  std::random_device entropy;
  store_options.seed = std::uint64_t{entropy()} << 32 | entropy();
  auto store = RecordStore::Open(std::move(store_options));
  if (!store) return tl::unexpected(store.error());
  const Result<void> written = (*store)->LogLastRun(UtcNowNs());
  if (!written) spdlog::warn("cannot store the event of how the previous process ended: {}", ToString(written.error()));
  return (*store)->set_aside();
}

Result<void> CheckOwnActors(const TeamFile& team, const std::vector<OwnActor>& actors) {
  if (actors.size() > kOwnActorsMax) return Fail(ErrorCode::kInvalid, "too many own actors", "own_actors");
  std::set<std::string> names;
  for (const StandardActor& actor : StandardActors(team.config, 0, team.hash, {})) names.insert(actor.name);
  for (const OwnActor& actor : actors) {
    Check(actor.factory != nullptr, "an own actor has a factory");
    if (actor.name.empty() || actor.name.size() > kActorNameMax ||
        actor.name.find_first_not_of(kActorNameLetters) != std::string::npos) {
      return Fail(ErrorCode::kInvalid, "\"" + actor.name + "\" is not a valid name of an actor", "own_actors");
    }
    if (!names.insert(actor.name).second) {
      return Fail(ErrorCode::kInvalid, "an actor " + actor.name + " is already spawned", "own_actors");
    }
  }
  return {};
}

SpawnOptions SpawnOptionsOf(const StandardActor& actor) {
  SpawnOptions spawn;
  spawn.placement = actor.placement;
  // Actors with their own thread may take long, for example to solve a large pose graph.
  if (actor.placement != Placement::kPool) spawn.handler_limit = std::chrono::minutes(1);
  return spawn;
}

}  // namespace

class Agent::Impl {
 public:
  Impl(const TeamFile& team, AgentOptions options, DataFolderLock lock)
      : team_(team), options_(std::move(options)), lock_(std::move(lock)) {}

  ~Impl() {
    if (dumps_on_crash_) DumpTraceOnCrash(nullptr, "");
    if (!has_failed_) stopped_at_ns_ = UtcNowNs();
    // Stop the actors before destroying the transport, because running actors send through it.
    if (system_ != nullptr) system_->Stop();
    transport_.reset();
  }

  Result<void> Start() {
    self_ = FindAgent(team_.config, options_.name)->id();
    auto endpoint = ClientEndpoint(team_, options_.name);
    if (!endpoint) return tl::unexpected(endpoint.error());
    endpoint_ = *endpoint;
    auto signing_key = ReadSigningKey(team_.config, team_.folder, self_, options_.secret_key_file);
    if (!signing_key) return tl::unexpected(signing_key.error());
    signing_key_ = *std::move(signing_key);
    const Result<std::string> set_aside = CheckStore(StorageOptions());
    if (!set_aside) return tl::unexpected(set_aside.error());
    set_aside_ = *set_aside;
    if (options_.merge_backend == MergeBackend::kGl) {
      if (auto gl = CreateGatherBackend(MergeBackend::kGl); !gl) return tl::unexpected(gl.error());
    }
    MakeSystem();
    if (auto running = Run(); !running) return running;
    // Write the endpoint to a file, for clients whose environment variables yield another endpoint. A full disk must
    // not prevent the start.
    if (auto reported = WriteEndpoint(options_.data_folder, endpoint_); !reported)
      spdlog::warn("{}", ToString(reported.error()));
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
    system.on_healthy = options_.on_healthy;
    system.on_stop_requested = options_.on_stop_requested;
    system_ = std::make_unique<ActorSystem>(std::move(system));

    for (StandardActor& actor : StandardActors(team_.config, self_, team_.hash, ActorOptions())) {
      system_->Spawn(actor.name, SpawnOptionsOf(actor), std::move(actor.factory));
    }
    for (const OwnActor& actor : options_.own_actors) system_->Spawn(actor.name, actor.spawn, actor.factory);
  }

  StandardActorOptions ActorOptions() {
    StandardActorOptions options;
    options.storage = StorageOptions();
    options.storage.is_checked = true;  // CheckStore has checked the store.
    options.storage.set_aside = set_aside_;
    options.storage.stopped_at_ns = [this]() -> std::optional<std::int64_t> {
      const std::int64_t stopped_at_ns = stopped_at_ns_;
      return stopped_at_ns == 0 ? std::nullopt : std::optional(stopped_at_ns);
    };
    if (signing_key_) {
      options.role.sign = [this](const proto::RoleAssignment& roles) {
        return signing_key_->Sign(SignedBytes(team_.config, roles));
      };
      options.storage.sign = [this](const RecordKey& key, const proto::Record& record) {
        return signing_key_->Sign(SignedBytes(team_.config, key, record));
      };
    }
    options.event.version = options_.version;
    merge_backend_ = ResolveMergeBackend(options_.merge_backend);
    options.merge.backend = options_.merge_backend;
    options.merge.merge_threads = HardwareThreads();
    options.merge.on_backend = [this](const std::string& backend) { merge_backend_ = *ParseMergeBackend(backend); };
    options.gateway.version = options_.version;
    options.gateway.pid = static_cast<std::uint32_t>(::getpid());
    options.gateway.merge_backend = [this] { return ToString(merge_backend_); };
    options.gateway.unread_bytes = [this](const std::string& connection) {
      return transport_->UnreadReplyBytes(connection);
    };
    options.gateway.listener = [this] { return transport_->Listener(); };  // The transport outlives the actors.
    for (const OwnActor& actor : options_.own_actors) options.gateway.own_actors.insert(actor.name);
    return options;
  }

  // Creates the transport, then starts the system. Messages that arrive between these steps are dropped, which
  // Transport's contract permits.
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
  DataFolderLock lock_;  // Destroyed last, after the database is closed.
  AgentId self_ = 0;
  std::string endpoint_;
  std::optional<SigningKey> signing_key_;  // Set if the team has keys.
  std::string set_aside_;                  // The store file that this start set aside; empty: none.
  bool dumps_on_crash_ = false;
  // True if an actor failed permanently.
  std::atomic<bool> has_failed_ = false;
  std::atomic<std::int64_t> stopped_at_ns_ = 0;  // UTC of the stop on request. 0: the agent runs or has failed.
  std::atomic<bool> is_running_ = false;
  std::atomic<MergeBackend> merge_backend_ = MergeBackend::kCpu;  // The backend that the merge actor uses.
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
  if (auto named = MemberNamed(team.config, options.name); !named) return tl::unexpected(named.error());
  if (auto checked = CheckOwnActors(team, options.own_actors); !checked) return tl::unexpected(checked.error());
  auto lock = DataFolderLock::Take(options.data_folder);
  if (!lock) return tl::unexpected(lock.error());
  const DataOwner owner = DataOwnerOf(team.config, *FindAgent(team.config, options.name));
  if (auto marked = MarkDataFolder(options.data_folder, owner); !marked) {
    if (marked.error().code == ErrorCode::kRefused) return tl::unexpected(marked.error());
    spdlog::warn("{}", ToString(marked.error()));  // Continue: the disk may be full, and the store names its owner too.
  }
  auto impl = std::make_unique<Impl>(team, std::move(options), std::move(*lock));
  if (auto started = impl->Start(); !started) return tl::unexpected(started.error());
  return std::unique_ptr<Agent>(new Agent(std::move(impl)));
}

}  // namespace moondb
