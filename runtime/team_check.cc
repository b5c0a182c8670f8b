#include "runtime/team_check.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdio>
#include <functional>
#include <optional>
#include <vector>

#include "model/custom_types.h"
#include "model/ids.h"
#include "model/keep_rule.h"
#include "model/record_check.h"
#include "model/team_id.h"
#include "runtime/did_you_mean.h"

namespace moondb {
namespace {

constexpr std::size_t kNameLengthMax = 32;
constexpr std::size_t kKeyFileLengthMax = 255;
constexpr std::size_t kSocketPathLengthMax = 107;  // sockaddr_un, less its final 0.
constexpr double kCoordinateMax_m = 1e6;
constexpr double kHistoryMegabytes = 64;
constexpr double kAngleMax_rad = 6.283185307179586;  // A whole turn either way.

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.12g", value);
  return text;
}

// Of a custom type: it stands beside the built-in ones' names in commands and JSON.
bool IsTypeName(const std::string& name) {
  return IsPlainName(name) && std::islower(static_cast<unsigned char>(name[0])) && name.find('-') == std::string::npos;
}

bool IsHost(const std::string& host) {
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    return host.find_first_not_of("0123456789abcdefABCDEF:.", 1) == host.size() - 1;
  }
  const auto is_host_character = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.';
  };
  return !host.empty() && host.size() <= 253 && host.front() != '-' &&
         std::all_of(host.begin(), host.end(), is_host_character);
}

// Empty if `address` can be listened on and connected to; `who` does the latter.
std::string WhyNoAddress(const std::string& address, const std::string& who) {
  if (address.rfind("ipc://", 0) == 0) {
    const std::string path = address.substr(6);
    if (path.empty() || path.front() != '/') return "expected an absolute path after ipc://";
    if (path.size() > kSocketPathLengthMax) return "the path is longer than a socket's may be (107 characters)";
    return "";
  }
  const std::size_t colon = address.rfind(':');
  if (address.rfind("tcp://", 0) != 0 || colon < 6) {
    return "expected tcp://HOST:PORT or ipc:///PATH, got " + Quoted(address);
  }
  const std::string host = address.substr(6, colon - 6);
  if (host == "0.0.0.0" || host == "[::]" || host == "*") {
    return who + " connect to this address, so it cannot be " + Quoted(host);
  }
  if (!IsHost(host)) return "expected a host's name or number, got " + Quoted(host);
  int port = 0;
  const char* end = address.data() + address.size();
  const auto [stop, error] = std::from_chars(address.data() + colon + 1, end, port);
  if (error != std::errc() || stop != end || port < 1 || port > 65535) {
    return "expected a port from 1 to 65535, got " + Quoted(address.substr(colon + 1));
  }
  return "";
}

class Checker {
 public:
  Checker(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors)
      : team_(team), places_(places), errors_(*errors) {}

  void Check() {
    if (Require("team") && !IsPlainName(team_.team())) Add("team", kPlainNameRule + Quoted(team_.team()));
    CheckTeamId();
    CheckAgentCount();
    for (int i = 0; i < team_.agents_size(); ++i) CheckAgent(i);
    CheckDuplicates();
    CheckRoles();
    CheckRange("radio.budget_kbps", team_.radio().budget_kbps(), 1, 1e6);
    const double states_period_s = team_.radio().states_period_s();
    if (IsGiven("radio.states_period_s") && states_period_s != 0 &&
        !(states_period_s >= 1 && states_period_s <= 86400)) {
      Add("radio.states_period_s", "expected 0, for never, or 1 to 86400, got " + Number(states_period_s));
    }
    CheckQuarantinePolicy("share", team_.share());
    CheckQuarantinePolicy("ground", team_.ground());
    CheckRange("roles.leader_timeout_s", team_.roles().leader_timeout_s(), 1, 86400);
    CheckRange("site.lat_deg", team_.site().lat_deg(), -90, 90);
    CheckRange("site.lon_deg", team_.site().lon_deg(), -180, 360);
    CheckRange("site.north_yaw_rad", team_.site().north_yaw_rad(), -kAngleMax_rad, kAngleMax_rad);
    CheckRange("map.resolution_m", team_.map().resolution_m(), 0.001, 10);
    CheckRange("retention.keep_days", team_.retention().keep_days(), 0, 36500);
    CheckRange("retention.keep_event_days", team_.retention().keep_event_days(), 0, 36500);
    CheckRange("retention.map_part_max", team_.retention().map_part_max(), 0, 1);
    CheckRange("retention.disk_free_mb_min", team_.retention().disk_free_mb_min(), 0, 1e9);
    CheckRange("retention.history_mb_max", team_.retention().history_mb_max(), 0, 1e6);
    CheckStoreBudget();
    CheckKeepPolicies();
    CheckCustomTypes();
    CheckNumbers("map.footprint_m", team_.map().footprint_m(), "2 numbers (length and width)", 2, 0.01, 10);
  }

 private:
  bool IsGiven(const std::string& field) const { return places_.count(field) > 0; }

  void Add(const std::string& field, const std::string& text) { errors_.Add(PlaceOf(places_, field), field, text); }

  // True if the field is there and was read well.
  bool Require(const std::string& field) {
    if (!IsGiven(field)) Add(field, "missing");
    return IsGiven(field) && !errors_.Has(field);
  }

  void CheckRange(const std::string& field, double value, double low, double high) {
    if (!IsGiven(field) || (value >= low && value <= high)) return;
    Add(field, "expected " + Number(low) + " to " + Number(high) + ", got " + Number(value));
  }

  // One quarantine does not take another one's place.
  void CheckQuarantinePolicy(const std::string& section, const proto::SharePolicies& policies) {
    if (policies.map_quarantine() != proto::POLICY_LATEST) return;
    Add(section + ".map_quarantine", "expected none or all, got \"latest\"");
  }

  void CheckNumbers(const std::string& field, const google::protobuf::RepeatedField<double>& numbers,
                    const std::string& what, int count, double low, double high) {
    if (!IsGiven(field)) return;
    if (numbers.size() != count && !errors_.Has(field)) {
      return Add(field, "expected " + what + ", got " + std::to_string(numbers.size()));
    }
    for (int i = 0; i < numbers.size(); ++i) {
      CheckRange(field + "[" + std::to_string(i) + "]", numbers.Get(i), low, high);
    }
  }

  void CheckTeamId() {
    if (!IsGiven("team_id")) return Add("team_id", "missing: `moonctl config check --fix` gives the file one");
    if (errors_.Has("team_id") || IsTeamId(team_.team_id())) return;
    Add("team_id", "expected 32 digits of 0 to 9 and a to f, got " + Quoted(team_.team_id()));
  }

  void CheckAgentCount() {
    (void)Require("agents");
    const auto& agents = team_.agents();
    if (agents.size() > kAgentCountMax) {
      Add("agents", "at most " + std::to_string(kAgentCountMax) + " are allowed, got " + std::to_string(agents.size()));
    }
    const auto is_base = [](const proto::AgentConfig& agent) { return agent.kind() == proto::AGENT_KIND_BASE_STATION; };
    if (std::all_of(agents.begin(), agents.end(), is_base)) Add("agents", "expected at least one rover");
    const auto first_base = std::find_if(agents.begin(), agents.end(), is_base);
    for (int i = 0; i < agents.size(); ++i) {
      if (is_base(agents[i]) && i != first_base - agents.begin()) {
        Add(AgentPath(i) + ".kind", "the team has a base station already: " + AgentPath(first_base - agents.begin()));
      }
    }
  }

  static std::string ElementPath(const std::string& list, std::ptrdiff_t index) {
    return list + "[" + std::to_string(index) + "]";
  }
  static std::string AgentPath(std::ptrdiff_t index) { return ElementPath("agents", index); }

  void CheckAgent(int index) {
    const proto::AgentConfig& agent = team_.agents(index);
    const std::string path = AgentPath(index);
    if (Require(path + ".id")) CheckRange(path + ".id", agent.id(), 1, kAgentIdMax);
    if (Require(path + ".name") && !IsPlainName(agent.name()))
      Add(path + ".name", kPlainNameRule + Quoted(agent.name()));
    if (Require(path + ".address")) {
      if (const std::string why = WhyNoAddress(agent.address(), "other agents"); !why.empty())
        Add(path + ".address", why);
    }
    CheckClientAddress(agent, path + ".client_address");
    if (!team_.insecure() && !IsGiven(path + ".key")) {
      Add(path + ".key", "missing: the file of the agent's public key (or `insecure: true` for the team)");
    }
    if (agent.key().size() > kKeyFileLengthMax) Add(path + ".key", "the file's name is too long");
    if (agent.key().ends_with(".sec")) Add(path + ".key", "expected the public key's file, not the secret's");
    CheckNumbers(path + ".antenna_m", agent.antenna_m(), "3 numbers (x, y, z)", 3, -100, 100);
    CheckPlace(agent, path);
  }

  void CheckClientAddress(const proto::AgentConfig& agent, const std::string& field) {
    if (!IsGiven(field) || errors_.Has(field)) return;
    if (!agent.client_address().starts_with("tcp://")) {
      return Add(field, "expected tcp://HOST:PORT, got " + Quoted(agent.client_address()));
    }
    if (const std::string why = WhyNoAddress(agent.client_address(), "clients"); !why.empty()) return Add(field, why);
    if (team_.insecure()) Add(field, "needs keys, which `insecure: true` does without");
  }

  // Rovers start somewhere, base stations are somewhere.
  void CheckPlace(const proto::AgentConfig& agent, const std::string& path) {
    CheckNumbers(path + ".position_m", agent.position_m(), "3 numbers (x, y, z)", 3, -kCoordinateMax_m,
                 kCoordinateMax_m);
    CheckRange(path + ".start.x", agent.start().x(), -kCoordinateMax_m, kCoordinateMax_m);
    CheckRange(path + ".start.y", agent.start().y(), -kCoordinateMax_m, kCoordinateMax_m);
    CheckRange(path + ".start.z", agent.start().z(), -kCoordinateMax_m, kCoordinateMax_m);
    CheckRange(path + ".start.yaw", agent.start().yaw(), -kAngleMax_rad, kAngleMax_rad);
    CheckRange(path + ".start.sigma_m", agent.start().sigma_m(), 1e-6, 1e3);
    CheckRange(path + ".start.sigma_rad", agent.start().sigma_rad(), 1e-6, 10);
    if (errors_.Has(path + ".kind")) return;
    if (agent.kind() == proto::AGENT_KIND_BASE_STATION) {
      (void)Require(path + ".position_m");
      if (IsGiven(path + ".start")) Add(path + ".start", "a base station has position_m instead");
    } else if (IsGiven(path + ".position_m")) {
      Add(path + ".position_m", "a rover has start instead; position_m is for base stations");
    }
  }

  void CheckDuplicates() {
    const auto check = [this](const char* field, const std::function<std::string(const proto::AgentConfig&)>& value) {
      CheckUnique("agents", team_.agents_size(), field, [&](int i) { return value(team_.agents(i)); });
    };
    check("id", [](const proto::AgentConfig& agent) { return std::to_string(agent.id()); });
    check("name", [](const proto::AgentConfig& agent) { return agent.name(); });
    check("address", [](const proto::AgentConfig& agent) { return agent.address(); });
    check("key", [](const proto::AgentConfig& agent) { return agent.key(); });
    check("client_address", [](const proto::AgentConfig& agent) { return agent.client_address(); });
    CheckClientAddressesAreOthers();
  }

  // Than the addresses at which agents hear each other.
  void CheckClientAddressesAreOthers() {
    for (int i = 0; i < team_.agents_size(); ++i) {
      const std::string field = AgentPath(i) + ".client_address";
      if (!IsGiven(field) || errors_.Has(field)) continue;
      for (int j = 0; j < team_.agents_size(); ++j) {
        if (team_.agents(i).client_address() != team_.agents(j).address()) continue;
        Add(field, team_.agents(i).client_address() + " is already that of " + AgentPath(j));
      }
    }
  }

  // No two elements of `list` may have the same value of `field`.
  void CheckUnique(const std::string& list, int count, const std::string& field,
                   const std::function<std::string(int)>& value_of) {
    std::map<std::string, int> owners;
    for (int i = 0; i < count; ++i) {
      const std::string path = ElementPath(list, i) + "." + field;
      if (!IsGiven(path) || errors_.Has(path)) continue;
      const std::string value = value_of(i);
      const auto [owner, is_new] = owners.emplace(value, i);
      if (!is_new) Add(path, value + " is already that of " + ElementPath(list, owner->second));
    }
  }

  // A small one would be used up by the log and the tables themselves.
  void CheckStoreBudget() {
    const double megabytes = team_.retention().store_mb_max();
    if (!IsGiven("retention.store_mb_max") || megabytes == 0 || (megabytes >= 1 && megabytes <= 1e9)) return;
    Add("retention.store_mb_max", "expected 0, for no budget, or 1 to 1e+09, got " + Number(megabytes));
  }

  void CheckKeepPolicies() {
    const auto* descriptor = proto::KeepPolicies::descriptor();
    for (int i = 0; i < descriptor->field_count(); ++i) {
      const auto* field = descriptor->field(i);
      // The same type has the same name in both.
      const auto* shared = proto::SharePolicies::descriptor()->FindFieldByName(field->name());
      const int given = team_.share().GetReflection()->GetEnumValue(team_.share(), shared);
      const proto::Policy share =
          given == proto::POLICY_UNSPECIFIED ? proto::POLICY_LATEST : static_cast<proto::Policy>(given);
      CheckKeep("keep." + field->name(), team_.keep().GetReflection()->GetString(team_.keep(), field), share,
                "share." + field->name());
    }
  }

  // `share`, which stands at `share_field`, is the type's policy.
  void CheckKeep(const std::string& field, const std::string& text, proto::Policy share,
                 const std::string& share_field) {
    if (!IsGiven(field) || errors_.Has(field) || errors_.Has(share_field)) return;
    const std::optional<KeepRule> rule = ParseKeepRule(text);
    if (!rule) {
      return Add(field, "expected all, latest or a duration such as 7d or 12h, got " + Quoted(text) +
                            DidYouMean(text, {"all", "latest"}));
    }
    if (share == proto::POLICY_LATEST || rule->IsOfAnyAge()) return;
    const std::string policy = YamlName(*proto::Policy_descriptor()->FindValueByNumber(share));
    Add(field, "nothing of it is superseded, since " + share_field + " is " + policy + ": expected all, got " +
                   Quoted(text) + " (retention.keep_days lets old records go)");
  }

  void CheckCustomTypes() {
    const int count = team_.custom_types_size();
    if (count > kCustomTypeCountMax) {
      Add("custom_types",
          "at most " + std::to_string(kCustomTypeCountMax) + " are allowed, got " + std::to_string(count));
    }
    for (int i = 0; i < count; ++i) CheckCustomType(team_.custom_types(i), ElementPath("custom_types", i));
    CheckUnique("custom_types", count, "id", [this](int i) { return std::to_string(team_.custom_types(i).id()); });
    CheckUnique("custom_types", count, "name", [this](int i) { return team_.custom_types(i).name(); });
  }

  void CheckCustomType(const proto::CustomType& type, const std::string& path) {
    if (Require(path + ".id")) CheckRange(path + ".id", type.id(), kCustomDataTypeMin, kCustomDataTypeMax);
    if (Require(path + ".name")) {
      if (!IsTypeName(type.name())) {
        Add(path + ".name",
            "expected at most 32 lower-case letters, digits and _, from a letter on, got " + Quoted(type.name()));
      } else if (DataTypeFromName(type.name(), {})) {
        Add(path + ".name", type.name() + " is a name of moondb's own");
      }
    }
    CheckRange(path + ".priority", type.priority(), 1, 9);
    CheckRange(path + ".bytes_max", type.bytes_max(), 1, kCustomPayloadBytesMax);
    CheckKeep(path + ".keep", type.keep(), type.share() == proto::POLICY_UNSPECIFIED ? proto::POLICY_ALL : type.share(),
              path + ".share");
  }

  void CheckRoles() {
    const proto::AgentConfig* leader = FindRover("roles.leader", team_.roles().leader());
    const proto::AgentConfig* survivor = FindRover("roles.survivor", team_.roles().survivor());
    if (leader != nullptr && leader == survivor) {
      Add("roles.survivor", leader->name() + " is the leader; the designated survivor must be another rover");
    }
  }

  const proto::AgentConfig* FindRover(const std::string& field, const std::string& name) {
    if (!IsGiven(field) || errors_.Has(field)) return nullptr;
    std::vector<std::string> names;
    for (int i = 0; i < team_.agents_size(); ++i) {
      const proto::AgentConfig& agent = team_.agents(i);
      names.push_back(agent.name());
      if (agent.name() != name) continue;
      if (agent.kind() == proto::AGENT_KIND_ROVER) return &agent;
      Add(field, name + " is a base station; only a rover can hold this role");
      return nullptr;
    }
    // An agent whose name could not be read may be the one.
    for (int i = 0; i < team_.agents_size(); ++i) {
      if (errors_.Has(AgentPath(i) + ".name")) return nullptr;
    }
    Add(field, "no agent is named " + Quoted(name) + DidYouMean(name, names));
    return nullptr;
  }

  const proto::TeamConfig& team_;
  const Places& places_;
  PlacedErrors& errors_;
};

void FillPolicies(const proto::SharePolicies& defaults, proto::SharePolicies* policies) {
  const auto* descriptor = proto::SharePolicies::descriptor();
  const auto* reflection = policies->GetReflection();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    if (reflection->GetEnumValue(*policies, field) != proto::POLICY_UNSPECIFIED) continue;
    const int policy = reflection->GetEnumValue(defaults, field);
    reflection->SetEnumValue(policies, field, policy == proto::POLICY_UNSPECIFIED ? proto::POLICY_NONE : policy);
  }
}

proto::SharePolicies StatesLatest() {
  proto::SharePolicies policies;
  policies.set_temperature(proto::POLICY_LATEST);
  policies.set_power(proto::POLICY_LATEST);
  policies.set_awake_status(proto::POLICY_LATEST);
  policies.set_mode(proto::POLICY_LATEST);
  policies.set_health(proto::POLICY_LATEST);
  policies.set_exploration(proto::POLICY_LATEST);
  policies.set_distributed_measurements(proto::POLICY_LATEST);
  policies.set_pose_graph_node(proto::POLICY_ALL);
  policies.set_optimized_pose(proto::POLICY_LATEST);
  policies.set_map_quarantine(proto::POLICY_ALL);
  policies.set_agent_event(proto::POLICY_ALL);
  return policies;
}

// One that means the same is the same text, so that equal files have equal hashes.
std::string KeepText(const std::string& given, const std::string& by_default) {
  const std::optional<KeepRule> rule = ParseKeepRule(given);
  return rule ? ToString(*rule) : by_default;
}

// `share` is complete. What only solving writes, and rewrites with each run, keeps nothing.
void FillKeep(proto::TeamConfig* team) {
  proto::KeepPolicies& keep = *team->mutable_keep();
  const auto* descriptor = proto::KeepPolicies::descriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    const auto* shared = proto::SharePolicies::descriptor()->FindFieldByName(field->name());
    const bool is_latest = team->share().GetReflection()->GetEnumValue(team->share(), shared) == proto::POLICY_LATEST;
    const bool is_derived = field->number() == proto::OPTIMIZED_POSE || field->number() == proto::EDGE_VERDICT;
    const auto* reflection = keep.GetReflection();
    reflection->SetString(&keep, field,
                          KeepText(reflection->GetString(keep, field), is_latest && is_derived ? "latest" : "all"));
  }
}

void FillRoles(proto::TeamConfig* team) {
  proto::RolesConfig* roles = team->mutable_roles();
  const auto first_rover_except = [&](const std::string& other) -> std::string {
    for (const proto::AgentConfig& agent : team->agents()) {
      if (agent.kind() == proto::AGENT_KIND_ROVER && agent.name() != other) return agent.name();
    }
    return "";
  };
  if (roles->leader().empty()) roles->set_leader(first_rover_except(roles->survivor()));
  if (roles->survivor().empty()) roles->set_survivor(first_rover_except(roles->leader()));
}

void FillCustomTypes(proto::TeamConfig* team) {
  auto& types = *team->mutable_custom_types();
  for (proto::CustomType& type : types) {
    if (type.share() == proto::POLICY_UNSPECIFIED) type.set_share(proto::POLICY_ALL);
    if (type.ground() == proto::POLICY_UNSPECIFIED) type.set_ground(proto::POLICY_NONE);
    if (type.priority() == 0) type.set_priority(5);
    if (type.bytes_max() == 0) type.set_bytes_max(4096);
    type.set_keep(KeepText(type.keep(), "all"));
  }
  std::sort(types.begin(), types.end(),
            [](const proto::CustomType& a, const proto::CustomType& b) { return a.id() < b.id(); });
}

void FillZeros(google::protobuf::RepeatedField<double>* numbers) {
  if (numbers->empty()) numbers->Resize(3, 0.0);
}

}  // namespace

bool IsPlainName(const std::string& name) {
  return !name.empty() && name.size() <= kNameLengthMax && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
}

void CheckTeam(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors) {
  Checker(team, places, errors).Check();
}

void FillDefaults(const Places& places, proto::TeamConfig* team) {
  const auto is_given = [&](const std::string& field) { return places.count(field) > 0; };
  for (int i = 0; i < team->agents_size(); ++i) {
    proto::AgentConfig* agent = team->mutable_agents(i);
    FillZeros(agent->mutable_antenna_m());
    if (agent->kind() == proto::AGENT_KIND_BASE_STATION || !agent->has_start()) continue;
    const std::string start = "agents[" + std::to_string(i) + "].start.";
    if (!is_given(start + "sigma_m")) agent->mutable_start()->set_sigma_m(0.05);
    if (!is_given(start + "sigma_rad")) agent->mutable_start()->set_sigma_rad(0.01);
  }
  FillRoles(team);
  if (!is_given("roles.leader_timeout_s")) team->mutable_roles()->set_leader_timeout_s(120);
  if (!is_given("radio.budget_kbps")) team->mutable_radio()->set_budget_kbps(1000);
  if (!is_given("radio.codec")) team->mutable_radio()->set_codec(proto::CODEC_COMPACT);
  if (!is_given("radio.quiet_while_driving")) team->mutable_radio()->set_quiet_while_driving(true);
  if (!is_given("pose_graph.solve_by_itself")) team->mutable_pose_graph()->set_solve_by_itself(true);
  if (!is_given("retention.map_part_max")) team->mutable_retention()->set_map_part_max(0.7);
  if (!is_given("retention.disk_free_mb_min")) team->mutable_retention()->set_disk_free_mb_min(512);
  if (!is_given("retention.history_mb_max")) team->mutable_retention()->set_history_mb_max(kHistoryMegabytes);
  if (!is_given("map.resolution_m")) team->mutable_map()->set_resolution_m(0.05);
  if (!is_given("map.footprint_m")) {
    team->mutable_map()->add_footprint_m(0.75);
    team->mutable_map()->add_footprint_m(0.5);
  }
  FillPolicies(StatesLatest(), team->mutable_ground());
  proto::SharePolicies share = StatesLatest();
  share.set_pose_graph_edge(proto::POLICY_ALL);
  share.set_edge_verdict(proto::POLICY_LATEST);
  share.set_local_traversability_map(proto::POLICY_ALL);
  FillPolicies(share, team->mutable_share());
  FillKeep(team);
  FillCustomTypes(team);
}

}  // namespace moondb
