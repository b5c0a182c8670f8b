#include "runtime/team/team_init.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "model/custom_types.h"
#include "model/file_writing.h"
#include "model/team_id.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/field_rules.h"
#include "runtime/team/new_files.h"
#include "runtime/team/signing_key.h"
#include "runtime/team/team_check.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {
namespace {

constexpr char kHead[] =
    "# The team's configuration: the same file on every agent. `moonctl config check` checks it.\n"
    "# Lengths are metres, angles radians. Missing settings have their defaults.\n";

constexpr char kKeyNote[] =
    "# key: file of the agent's public key, which every agent needs. Its secrets, NAME.sec and NAME.sign, stay on its "
    "agent.\n"
    "# signing_key: the public half of NAME.sign, with which others verify its changes of roles.\n"
    "# client_address: \"tcp://HOST:PORT\", address for clients on other machines (`moonctl clients`); none by "
    "default.\n";

// Stands in place of a rover's start. An invented start would be worse than none: the solver would trust it.
constexpr char kStartToFillIn[] =
    "    # start: {x: 0, y: 0, z: 0, yaw: 0, sigma_m: 0.05, sigma_rad: 0.01}   # Measure it and fill it in.\n";

constexpr char kTwoAgents[] = "\n# Failover is manual: of two agents that lose each other both would lead.\n";

constexpr char kTail[] =
    R"(
# Initial leader and survivor (term 0); later role changes replace them. failover: manual or automatic (the survivor
# takes over from a leader that is silent for leader_timeout_s).
roles: {leader: %s, %sfailover: %s, leader_timeout_s: %s}

# Agents that may relay commands to others and change roles as an operator: names, or all.
command_from: [%s]

# Total rate that one agent may send and receive. states_period_s: how often agents send the leader their states without
# a request. sync_period_s: new records go on by themselves, at most once a period. Both in s, 0: never. Codec of
# records: compact, or for comparison zstd, plain or paper_sql.
radio: {budget_kbps: %s, quiet_while_driving: %s, states_period_s: %s, sync_period_s: %s, codec: %s}

# Sharing policies by data type: none, latest or all. `share` holds from rovers to the leader and on to the designated
# survivor, `ground` for the base station. Under `latest` only the newest record of a type is shared.
share:
%s
ground:
%s
# Records of all agents that the leader sends each rover. For the team's map on every rover (docs/MAPS.md):
# rovers: {pose_graph_node: all, optimized_pose: latest, local_traversability_map: all}
%s
# History: how long each robot's own disk keeps its own records that newer ones superseded under `latest`: all, latest
# (removed at once), or a time such as 7d or 12h. Beyond retention.history_mb_max (64) the oldest are removed first. No
# other agent has this history: it is lost with the disk.
keep:
%s
# Whether the leader solves the pose graph by itself when no more records arrive, or only on `moonctl graph optimize`.
pose_graph: {solve_by_itself: %s}

# Limits on what an agent keeps once leader and designated survivor have it (docs/SPACE.md):
# retention: {keep_days: 90, keep_event_days: 30, store_mb_max: 4000, map_part_max: 0.7, disk_free_mb_min: 512,
#   history_mb_max: 64}

map: {resolution_m: %s, footprint_m: [%s, %s]}   # The merged map's cells; a rover's length and width.
)";

// Returns the shortest text that parses to the same number.
std::string ShortestNumber(double value) {
  char text[32];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::stod(text) == value) break;
  }
  return text;
}

std::string List(const google::protobuf::RepeatedField<double>& numbers) {
  std::string text = "[";
  for (int i = 0; i < numbers.size(); ++i) text += (i > 0 ? ", " : "") + ShortestNumber(numbers.Get(i));
  return text + "]";
}

std::string StartText(const proto::StartPose& start) {
  return "{x: " + ShortestNumber(start.x()) + ", y: " + ShortestNumber(start.y()) +
         ", z: " + ShortestNumber(start.z()) + ", yaw: " + ShortestNumber(start.yaw()) +
         ", sigma_m: " + ShortestNumber(start.sigma_m()) + ", sigma_rad: " + ShortestNumber(start.sigma_rad()) + "}";
}

std::string AgentText(const proto::AgentConfig& agent) {
  const bool is_base = agent.kind() == proto::AGENT_KIND_BASE_STATION;
  std::string text = "  - id: " + std::to_string(agent.id()) + "\n";
  const auto add = [&](const char* key, const std::string& value) {
    text += std::string("    ") + key + ": " + value + "\n";
  };
  add("name", agent.name());
  add("address", "\"" + agent.address() + "\"");
  if (!agent.listen().empty()) add("listen", "\"" + agent.listen() + "\"");
  if (is_base) add("kind", "base_station");
  if (!agent.key().empty()) add("key", "\"" + agent.key() + "\"");
  if (!agent.signing_key().empty()) add("signing_key", "\"" + agent.signing_key() + "\"");
  if (agent.left()) add("left", "true");
  if (!agent.client_address().empty()) add("client_address", "\"" + agent.client_address() + "\"");
  if (is_base) add("position_m", List(agent.position_m()));
  if (agent.has_start()) add("start", StartText(agent.start()));
  if (!agent.antenna_m().empty()) add("antenna_m", List(agent.antenna_m()));
  return text;
}

std::string PolicyName(proto::Policy policy) {
  return YamlName(*proto::Policy_descriptor()->FindValueByNumber(policy));
}

std::string CustomTypesText(const CustomTypes& types) {
  if (types.empty()) return "";
  std::string text = "\n# Data types of the team's own.\ncustom_types:\n";
  for (const proto::CustomType& type : types) {
    text += "  - {id: " + std::to_string(type.id()) + ", name: " + type.name() +
            ", share: " + PolicyName(type.share()) + ", ground: " + PolicyName(type.ground()) +
            (type.rovers() == proto::POLICY_NONE ? "" : ", rovers: " + PolicyName(type.rovers())) +
            ", priority: " + std::to_string(type.priority()) + ", bytes_max: " + std::to_string(type.bytes_max()) +
            ", keep: " + type.keep() + "}\n";
  }
  return text;
}

std::string KeepText(const proto::TeamConfig& team) {
  std::string text;
  for (const DataType type : BuiltInDataTypes()) {
    const auto keep = team.keep().find(DataTypeName(type));
    if (keep != team.keep().end()) text += "  " + keep->first + ": " + keep->second + "\n";
  }
  return text;
}

using PolicyOf = proto::Policy (*)(const proto::TeamConfig& team, DataType type);

std::string PoliciesText(const proto::TeamConfig& team, PolicyOf policy_of) {
  std::string text;
  for (const DataType type : BuiltInDataTypes()) {
    text += "  " + DataTypeName(type) + ": " + PolicyName(policy_of(team, type)) + "\n";
  }
  return text;
}

std::string RoversText(const proto::TeamConfig& team) {
  std::string text;
  for (const DataType type : BuiltInDataTypes()) {
    const proto::Policy policy = RoversPolicyOf(team, type);
    if (policy != proto::POLICY_NONE) text += "  " + DataTypeName(type) + ": " + PolicyName(policy) + "\n";
  }
  return text.empty() ? "" : "rovers:\n" + text;
}

std::string Format(const char* format, const std::vector<std::string>& values) {
  std::string text;
  auto value = values.begin();
  for (const char* c = format; *c != '\0'; ++c) {
    if (*c == '%' && *(c + 1) == 's') {
      text += *value++;
      ++c;
    } else {
      text += *c;
    }
  }
  return text;
}

std::string TeamIdText(const std::string& team_id) {
  // Quoted, because some ids would otherwise parse as numbers.
  return "team_id: \"" + team_id + "\"   # Unique id of the team; never change it.";
}

std::string CommandFromText(const proto::TeamConfig& team) {
  std::string text;
  for (const std::string& name : team.command_from()) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// Returns the text of a new team file. Requires: `team` has all its defaults.
std::string TeamText(const proto::TeamConfig& team) {
  std::string text = kHead;
  text += "team: " + team.team() + "\n";
  text += TeamIdText(team.team_id()) + "\n";
  if (team.insecure()) text += "insecure: true   # Anybody who reaches the ports can speak as any agent.\n";
  text += "\n";
  if (!team.insecure()) text += kKeyNote;
  text += "agents:\n";
  for (const proto::AgentConfig& agent : team.agents()) {
    text += AgentText(agent);
    if (agent.kind() == proto::AGENT_KIND_ROVER && !agent.has_start()) text += kStartToFillIn;
  }
  const proto::RolesConfig& roles = team.roles();
  const std::string survivor = roles.survivor().empty() ? "" : "survivor: " + roles.survivor() + ", ";
  const std::string failover = roles.failover() == proto::FAILOVER_AUTOMATIC ? "automatic" : "manual";
  if (failover == "manual" && team.agents_size() == 2) text += kTwoAgents;
  text += Format(
      kTail, {roles.leader(), survivor, failover, ShortestNumber(roles.leader_timeout_s()), CommandFromText(team),
              ShortestNumber(team.radio().budget_kbps()), team.radio().quiet_while_driving() ? "true" : "false",
              ShortestNumber(team.radio().states_period_s()), ShortestNumber(team.radio().sync_period_s()),
              YamlName(*proto::Codec_descriptor()->FindValueByNumber(team.radio().codec())),
              PoliciesText(team, SharePolicyOf), PoliciesText(team, GroundPolicyOf), RoversText(team), KeepText(team),
              team.pose_graph().solve_by_itself() ? "true" : "false", ShortestNumber(team.map().resolution_m()),
              ShortestNumber(team.map().footprint_m(0)), ShortestNumber(team.map().footprint_m(1))});
  if (team.has_site()) {
    text += "\n# Where the frame `map` lies on the Moon.\nsite: {lat_deg: " + ShortestNumber(team.site().lat_deg()) +
            ", lon_deg: " + ShortestNumber(team.site().lon_deg()) +
            ", north_yaw_rad: " + ShortestNumber(team.site().north_yaw_rad()) + "}\n";
  }
  return text + CustomTypesText(team.custom_types());
}

// Reads the text into `team`. Ignores errors, which are reported when the file is checked.
Places ReadLeniently(const std::string& yaml, proto::TeamConfig* team) {
  Places places;
  PlacedErrors errors("");
  ReadYaml(yaml, team, &places, &errors);
  return places;
}

// Returns the offset of a line, counted from 1. Requires: the text has this line.
std::size_t BeginOfLine(const std::string& yaml, int line) {
  std::size_t at = 0;
  for (int i = 1; i < line && at != std::string::npos; ++i) at = yaml.find('\n', at) + 1;
  return at;
}

// Returns the text with `added` as a new line below the line of `place`, indented by `indent` spaces.
std::string WithLineBelow(const std::string& yaml, Place place, std::size_t indent, const std::string& added) {
  const std::size_t end = yaml.find('\n', BeginOfLine(yaml, place.line));
  const bool has_end = end != std::string::npos;
  const std::string line_end = has_end && end > 0 && yaml[end - 1] == '\r' ? "\r\n" : "\n";
  std::string longer = yaml;
  const std::string line = std::string(indent, ' ') + added + line_end;
  return longer.insert(has_end ? end + 1 : yaml.size(), (has_end ? "" : line_end) + line);
}

// Returns two candidates: `yaml` with `field` ("name: value") on a new line below the field `before` at `place`, and
// `yaml` with `field` in front of that field, for fields inside braces. Returns none if `before` is not found.
std::vector<std::string> WithField(const std::string& yaml, const std::string& before, Place place,
                                   const std::string& field) {
  const std::size_t line = BeginOfLine(yaml, place.line);
  const std::size_t key = yaml.rfind(before + ":", line + static_cast<std::size_t>(place.column) - 1);
  if (key == std::string::npos || key < line) return {};
  std::string in_braces = yaml;
  in_braces.insert(key, field + ", ");
  return {WithLineBelow(yaml, place, key - line, field), in_braces};
}

}  // namespace

Result<void> WriteTeam(const std::filesystem::path& path, const proto::TeamConfig& given) {
  proto::TeamConfig team = given;
  if (team.team_id().empty()) {
    const Result<std::string> id = MakeTeamId();
    if (!id) return tl::unexpected(id.error());
    team.set_team_id(*id);
  }
  std::vector<SigningKey> signing_keys;
  if (!team.insecure()) {
    for (proto::AgentConfig& agent : *team.mutable_agents()) {
      if (agent.key().empty()) agent.set_key(agent.name() + ".pub");
      agent.set_signing_key(signing_keys.emplace_back(SigningKey::Make()).public_key());
    }
  }
  FillDefaults(PlacesOf(team), &team);
  const std::string yaml = TeamText(team);
  // Validate the caller's team by parsing the text.
  const Result<TeamFile> read = ParseTeamFile(yaml, path.string());
  if (!read) return tl::unexpected(read.error());
  if (SerializeInOrder(read->config) != SerializeInOrder(team)) {
    return Fail(ErrorCode::kInvalid, path.string() + ": a text of the team cannot be written as YAML");
  }

  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  if (const std::error_code error = MakeFolders(folder, 0755)) {
    return Fail(ErrorCode::kInternal, folder.string() + ": " + error.message());
  }
  NewFiles files;
  if (!team.insecure()) {
    for (int i = 0; i < team.agents_size(); ++i) {
      const auto added = AddAgentKeys(folder / team.agents(i).key(), signing_keys[static_cast<std::size_t>(i)], &files);
      if (!added) return added;
    }
  }
  // Add the team file last: it must never exist without its keys.
  if (const Result<void> added = files.Add(path, yaml, 0644); !added) return added;
  return files.Publish();
}

std::string PlainNameOf(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const char small = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    const bool is_plain = IsPlainName(std::string(1, small));
    if (is_plain || (!name.empty() && name.back() != '-')) name += is_plain ? small : '-';
  }
  while (!name.empty() && (!IsPlainName(name) || name.ends_with('-'))) name.pop_back();  // Cut names that are too long.
  return name.empty() ? "team" : name;
}

Result<std::string> WithTeamId(const std::string& yaml, const std::string& team_id) {
  proto::TeamConfig wanted;
  const Places places = ReadLeniently(yaml, &wanted);
  wanted.set_team_id(team_id);
  if (const auto name = places.find("team"); name != places.end()) {
    const std::size_t line = BeginOfLine(yaml, name->second.line);
    const std::string fixed =
        WithLineBelow(yaml, name->second, yaml.find_first_not_of(' ', line) - line, TeamIdText(team_id));
    // Accept the text only if it parses to the same team with the new id.
    proto::TeamConfig found;
    (void)ReadLeniently(fixed, &found);
    if (SerializeInOrder(found) == SerializeInOrder(wanted)) return fixed;
  }
  return Fail(ErrorCode::kInvalid, "cannot insert the team id; add  team_id: \"" + team_id + "\"  by hand");
}

Result<std::string> WithSigningKeys(const std::string& yaml, const std::map<std::string, std::string>& keys) {
  std::string fixed = yaml;
  for (const auto& [name, key] : keys) {
    proto::TeamConfig wanted;
    const Places places = ReadLeniently(fixed, &wanted);
    const std::string field = "signing_key: \"" + key + "\"";
    std::vector<std::string> candidates;
    for (int i = 0; i < wanted.agents_size(); ++i) {
      if (wanted.agents(i).name() != name) continue;
      wanted.mutable_agents(i)->set_signing_key(key);
      const auto place = places.find("agents[" + std::to_string(i) + "].key");
      if (place != places.end()) candidates = WithField(fixed, "key", place->second, field);
    }
    // Accept a candidate only if it parses to the same team with the new key.
    const auto is_right = [&wanted](const std::string& candidate) {
      proto::TeamConfig found;
      (void)ReadLeniently(candidate, &found);
      return SerializeInOrder(found) == SerializeInOrder(wanted);
    };
    const auto right = std::find_if(candidates.begin(), candidates.end(), is_right);
    if (right == candidates.end()) {
      return Fail(ErrorCode::kInvalid,
                  "cannot insert the signing_key of " + Quoted(name) + ": move its `key` to a line of its own");
    }
    fixed = *right;
  }
  return fixed;
}

Result<SigningKeysAdded> AddSigningKeys(const std::string& yaml, const std::filesystem::path& file, NewFiles* files) {
  proto::TeamConfig team;
  (void)ReadLeniently(yaml, &team);
  if (team.insecure())
    return Fail(ErrorCode::kInvalid, file.string() + ": a team that is `insecure: true` has no keys");
  SigningKeysAdded added;
  std::map<std::string, std::string> keys;
  for (const proto::AgentConfig& agent : team.agents()) {
    if (!agent.signing_key().empty() || agent.key().empty()) continue;
    const SigningKey key = SigningKey::Make();
    keys[agent.name()] = key.public_key();
    added.agents.push_back(agent.name());
    if (const auto kept = AddSigningSecret(file.parent_path() / agent.key(), key, files); !kept) {
      return tl::unexpected(kept.error());
    }
  }
  Result<std::string> fixed = WithSigningKeys(yaml, keys);
  if (!fixed) return Fail(fixed.error().code, file.string() + ": " + fixed.error().text);
  if (const auto read = ParseTeamFile(*fixed, file.string()); !read) return tl::unexpected(read.error());
  added.yaml = *std::move(fixed);
  return added;
}

Result<std::string> AddAgent(const std::string& yaml, const std::filesystem::path& file, proto::AgentConfig& agent,
                             NewFiles* files) {
  if (const auto read = ParseTeamFile(yaml, file.string()); !read) return tl::unexpected(read.error());
  proto::TeamConfig wanted;
  const Places places = ReadLeniently(yaml, &wanted);
  std::uint32_t highest = 0;
  for (const proto::AgentConfig& other : wanted.agents()) highest = std::max(highest, other.id());
  if (agent.id() == 0) agent.set_id(highest + 1);
  const SigningKey signing = SigningKey::Make();
  if (!wanted.insecure()) {
    agent.set_key(agent.name() + ".pub");
    agent.set_signing_key(signing.public_key());
  }
  // The new agent follows the last line that holds a value of the last agent, at the indentation of that agent.
  const std::string last = "agents[" + std::to_string(wanted.agents_size() - 1) + "]";
  Place end;
  std::size_t indent = 0;
  for (const auto& [field, place] : places) {
    if (!field.starts_with(last)) continue;
    if (place.line > end.line) end = place;
    const std::size_t line = BeginOfLine(yaml, place.line);
    const std::size_t text = yaml.find_first_not_of(' ', line);
    if (text != std::string::npos && yaml[text] == '-') indent = text - line;
  }
  *wanted.add_agents() = agent;
  std::string added = AgentText(agent).substr(2);
  added.pop_back();
  for (std::size_t at = added.find('\n'); at != std::string::npos; at = added.find('\n', at + 1)) {
    added.replace(at + 1, 2, std::string(indent, ' '));
  }
  const std::string longer = WithLineBelow(yaml, end, indent, added);
  proto::TeamConfig found;
  (void)ReadLeniently(longer, &found);
  if (SerializeInOrder(found) != SerializeInOrder(wanted)) {
    return Fail(ErrorCode::kInvalid, file.string() + ": cannot insert another agent; add it by hand");
  }
  if (const auto read = ParseTeamFile(longer, file.string()); !read) return tl::unexpected(read.error());
  if (!wanted.insecure()) {
    const auto kept = AddAgentKeys(file.parent_path() / agent.key(), signing, files);
    if (!kept) return tl::unexpected(kept.error());
  }
  return longer;
}

Result<void> AddAgentKeys(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files) {
  const Result<CurveKeys> keys = MakeCurveKeys();
  if (!keys) return tl::unexpected(keys.error());
  if (const auto added = files->Add(SecretKeyPath(public_path), keys->secret_key + "\n", 0600); !added) return added;
  if (const auto added = AddSigningSecret(public_path, signing, files); !added) return added;
  return files->Add(public_path, keys->public_key + "\n", 0644);
}

Result<void> AddSigningSecret(const std::filesystem::path& public_path, const SigningKey& signing, NewFiles* files) {
  return files->Add(SigningSecretPath(SecretKeyPath(public_path)), signing.SecretText() + "\n", 0600);
}

std::string DefaultTeamName(const std::filesystem::path& file) {
  return PlainNameOf(std::filesystem::absolute(file).parent_path().filename().string());
}

Result<void> WriteInitialTeam(const std::filesystem::path& path, int agent_count, int first_port,
                              const std::string& name) {
  if (agent_count < 1 || agent_count > kAgentCountMax) {
    return Fail(ErrorCode::kInvalid,
                "expected 1 to " + std::to_string(kAgentCountMax) + " agents, got " + std::to_string(agent_count),
                "agent_count");
  }
  if (first_port < 1 || first_port + agent_count - 1 > 65535) {
    return Fail(ErrorCode::kInvalid,
                "the ports " + std::to_string(first_port) + " to " + std::to_string(first_port + agent_count - 1) +
                    " must lie from 1 to 65535",
                "first_port");
  }
  proto::TeamConfig team;
  team.set_team(name.empty() ? DefaultTeamName(path) : name);
  for (int i = 0; i < agent_count; ++i) {
    proto::AgentConfig* agent = team.add_agents();
    const bool is_base = i > 0 && i + 1 == agent_count;
    agent->set_id(static_cast<std::uint32_t>(i + 1));
    agent->set_name(is_base ? "base" : "rover" + std::to_string(i + 1));
    agent->set_address("tcp://127.0.0.1:" + std::to_string(first_port + i));
    for (const double coordinate : {0.0, 0.0, is_base ? 1.5 : 0.3}) agent->add_antenna_m(coordinate);
    if (is_base) {
      agent->set_kind(proto::AGENT_KIND_BASE_STATION);
      for (const double coordinate : {-2.0, 0.0, 0.0}) agent->add_position_m(coordinate);
    }
  }
  return WriteTeam(path, team);
}

Result<void> WriteInitialTeam(const std::filesystem::path& path, int agent_count, int first_port) {
  return WriteInitialTeam(path, agent_count, first_port, "");
}

}  // namespace moondb
