#include "bench/linked_agents.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <utility>

#include "model/check.h"

namespace moondb {
namespace {

constexpr std::chrono::minutes kPatience(1);

// Returns a port on which no program listens at this moment.
int FreePort() {
  const int file = ::socket(AF_INET, SOCK_STREAM, 0);
  Check(file >= 0, "there are sockets");
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  auto* generic = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof address;
  Check(::bind(file, generic, size) == 0 && ::getsockname(file, generic, &size) == 0, "loopback has a free port");
  ::close(file);
  return ntohs(address.sin_port);
}

}  // namespace

LinkedAgents::LinkedAgents(int agent_count, bool is_curve, Tally& tally) : is_curve_(is_curve), tally_(tally) {
  for (int i = 0; i < agent_count; ++i) {
    ActorSystem::Options options;
    options.self = static_cast<AgentId>(i + 1);
    agents_.push_back(std::make_unique<Agent>());
    agents_.back()->system = std::make_unique<ActorSystem>(std::move(options));
  }
}

LinkedAgents::~LinkedAgents() {
  for (const auto& agent : agents_) agent->system->Stop();
  for (const auto& agent : agents_) agent->transport.reset();
}

Result<void> LinkedAgents::Start() {
  if (const Result<void> written = WriteTeamFile(); !written) return written;
  const int agent_count = static_cast<int>(agents_.size());
  for (int i = 0; i < agent_count; ++i) {
    if (const Result<void> started = StartAgent(static_cast<AgentId>(i + 1)); !started) return started;
  }
  std::unique_lock lock(mutex_);
  const bool is_complete =
      changed_.wait_for(lock, kPatience, [&] { return connections_ == agent_count * (agent_count - 1); });
  if (!is_complete) return tl::unexpected(Error{ErrorCode::kUnavailable, "the agents do not reach each other", {}});
  return {};
}

Result<void> LinkedAgents::WriteTeamFile() {
  proto::TeamConfig team;
  team.set_team("bench");
  team.set_insecure(!is_curve_);
  for (std::size_t i = 0; i < agents_.size(); ++i) {
    proto::AgentConfig* agent = team.add_agents();
    agent->set_id(static_cast<AgentId>(i + 1));
    agent->set_name("rover" + std::to_string(i + 1));
    agent->set_address("tcp://127.0.0.1:" + std::to_string(FreePort()));
  }
  const std::filesystem::path path = folder_.path() / "team.yaml";
  if (const Result<void> written = WriteTeam(path, team); !written) return written;
  Result<TeamFile> read = ReadTeamFile(path);
  if (!read) return tl::unexpected(read.error());
  team_ = std::move(*read);
  return {};
}

Result<void> LinkedAgents::StartAgent(AgentId id) {
  Agent& agent = *agents_[id - 1];
  const auto deliver = [this, &agent](OwnedMessage message) {
    agent.is_up.wait();
    if (agent.system->Deliver(std::move(message)) != SendResult::kAccepted) {
      tally_.Fail("a message that had arrived was refused");
    }
  };
  const auto peer_changed = [this, &agent](AgentId peer, bool is_connected) {
    agent.is_up.wait();
    agent.system->OnPeerChanged(peer, is_connected);
    const std::lock_guard lock(mutex_);
    connections_ += is_connected ? 1 : -1;
    changed_.notify_all();
  };
  ZeroMqTransport::Options options;
  options.self = id;
  auto transport = ZeroMqTransport::Create(team_.config, team_.folder, std::move(options), deliver, peer_changed);
  if (!transport) return tl::unexpected(transport.error());
  agent.transport = std::move(*transport);
  agent.system->Start(agent.transport.get());
  agent.is_up.count_down();
  return {};
}

}  // namespace moondb
