#include "apps/common/team_clients.h"

#include "apps/common/local_endpoint.h"
#include "model/did_you_mean.h"
#include "model/team_member.h"
#include "runtime/team/curve_keys.h"

namespace moondb {
namespace {

constexpr std::size_t kSentRecordsMax = 512;
constexpr std::size_t kSentBytesMax = 2'000'000;

// Returns the agent's endpoint for clients with keys, and stores the agent's public key in `options`, so that the
// client can authenticate the agent.
Result<std::string> KeyedEndpoint(const TeamFile& team, const proto::AgentConfig& agent, Client::Options* options) {
  if (agent.client_address().empty()) {
    return Fail(ErrorCode::kUnavailable, agent.name() +
                                             " has no client_address in the team file and accepts no client keys; give "
                                             "--via an agent with a client_address, or omit the key");
  }
  const Result<std::string> key = ReadPublicKey(team.folder / agent.key());
  if (!key) return tl::unexpected(key.error());
  options->server_key = *key;
  return agent.client_address();
}

Result<std::string> LocalEndpointOf(const TeamFile& team, const proto::AgentConfig& agent) {
  const Result<LocalEndpoint> found = FindLocalEndpoint(team, agent);
  if (!found) return tl::unexpected(found.error());
  if (found->endpoint.empty()) return Fail(ErrorCode::kUnavailable, found->why);
  return found->endpoint;
}

}  // namespace

Result<const proto::AgentConfig*> AgentNamed(const proto::TeamConfig& team, const std::string& name) {
  if (const proto::AgentConfig* agent = FindAgent(team, name)) return agent;
  std::vector<std::string> names;
  for (const proto::AgentConfig& agent : team.agents()) names.push_back(agent.name());
  return Fail(ErrorCode::kInvalid, "team " + team.team() + " has no agent \"" + name + "\"" + DidYouMean(name, names));
}

Result<const proto::AgentConfig*> MemberNamed(const proto::TeamConfig& team, const std::string& name) {
  auto named = AgentNamed(team, name);
  if (named && (*named)->left()) {
    return Fail(ErrorCode::kRefused, name + " has left team " + team.team() + " (left: true in the team file)");
  }
  return named;
}

Result<std::unique_ptr<Client>> ConnectTo(const TeamFile& team, const proto::AgentConfig& agent,
                                          Client::Options options, const proto::AgentConfig* via) {
  const proto::AgentConfig& asked = via != nullptr ? *via : agent;
  auto endpoint = options.secret_key.empty() ? LocalEndpointOf(team, asked) : KeyedEndpoint(team, asked, &options);
  if (!endpoint) return tl::unexpected(endpoint.error());
  options.custom_types = team.config.custom_types();
  options.team_id = team.config.team_id();
  options.for_agent = via != nullptr ? static_cast<AgentId>(agent.id()) : 0;
  return Client::Connect(*endpoint, asked.name(), std::move(options));
}

Result<void> InsertInBatches(Client& client, const std::vector<proto::Record>& records,
                             const std::function<void(std::size_t, const std::vector<RecordKey>&)>& inserted) {
  std::vector<proto::Record> batch;
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    bytes += records[i].ByteSizeLong();
    batch.push_back(records[i]);
    const bool is_full = batch.size() >= kSentRecordsMax || bytes >= kSentBytesMax;
    if (!is_full && i + 1 < records.size()) continue;
    const auto keys = client.Insert(batch);
    if (!keys) return tl::unexpected(keys.error());
    inserted(i + 1, *keys);
    batch.clear();
    bytes = 0;
  }
  return {};
}

}  // namespace moondb
