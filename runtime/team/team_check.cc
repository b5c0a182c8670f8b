#include "runtime/team/team_check.h"

#include <arpa/inet.h>
#include <net/if.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <functional>
#include <optional>
#include <vector>

#include "model/command_from.h"
#include "model/custom_types.h"
#include "model/data_types.h"
#include "model/did_you_mean.h"
#include "model/ids.h"
#include "model/keep_rule.h"
#include "model/local_socket.h"
#include "model/team_id.h"
#include "model/team_member.h"
#include "runtime/team/field_rules.h"
#include "runtime/team/signing_key.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

constexpr std::size_t kNameLengthMax = 32;
constexpr std::size_t kKeyFileLengthMax = 255;

// Returns true if `name` can name a custom type: a plain name (IsPlainName) that begins with a letter and has no
// hyphen.
bool IsTypeName(const std::string& name) {
  return IsPlainName(name) && std::islower(static_cast<unsigned char>(name[0])) && name.find('-') == std::string::npos;
}

bool IsHostCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.' || c == '_';
}

// Returns why the text between the brackets of [ADDRESS] or [ADDRESS%INTERFACE] is no IPv6 address, or "" if it is one.
// A link-local address (fe80::/10) needs an interface: without one, the kernel does not know which link is meant.
std::string WhyNoNumber6(const std::string& text) {
  const std::size_t percent = text.find('%');
  const std::string number = text.substr(0, percent);
  in6_addr parsed{};
  if (inet_pton(AF_INET6, number.c_str(), &parsed) != 1) return "expected an IPv6 address, got " + Quoted(number);
  if (percent == std::string::npos) {
    if (!IN6_IS_ADDR_LINKLOCAL(&parsed)) return "";
    return "a link-local address needs its interface, such as [" + number + "%wlan0]";
  }
  const std::string interface = text.substr(percent + 1);
  const bool is_interface = !interface.empty() && interface.size() < IF_NAMESIZE &&
                            std::all_of(interface.begin(), interface.end(), IsHostCharacter);
  return is_interface ? "" : "expected a network interface after %, got " + Quoted(interface);
}

// Returns why `host` is neither a name nor an address, or "" if it is one.
std::string WhyNoHost(const std::string& host) {
  if (host.size() > 2 && host.front() == '[' && host.back() == ']')
    return WhyNoNumber6(host.substr(1, host.size() - 2));
  const bool is_host = !host.empty() && host.size() <= 253 && host.front() != '-' &&
                       std::all_of(host.begin(), host.end(), IsHostCharacter);
  return is_host ? "" : "expected a host name or an IP address, got " + Quoted(host);
}

// Returns why `address` is invalid for listening and connecting, or "" if `address` is valid. The text calls the
// connecting side `who`. If `who` is empty, nobody connects, so `address` may stand for all addresses of the computer.
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
  const bool is_any = host == "0.0.0.0" || host == "[::]" || host == "*";
  if (is_any && !who.empty()) {
    return who + " connect to this address, so it cannot be " + Quoted(host);
  }
  if (const std::string why = is_any ? "" : WhyNoHost(host); !why.empty()) return why;
  int port = 0;
  const char* end = address.data() + address.size();
  const auto [stop, error] = std::from_chars(address.data() + colon + 1, end, port);
  if (error != std::errc() || stop != end || port < 1 || port > 65535) {
    return "expected a port from 1 to 65535, got " + Quoted(address.substr(colon + 1));
  }
  return "";
}

using Policies = google::protobuf::Map<std::string, proto::Policy>;

// Returns null if no built-in type has this name.
const DataTypeRow* RowNamed(const std::string& name) { return FindDataType(DataTypeFromName(name).value_or(0)); }

class TeamChecker {
 public:
  TeamChecker(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors)
      : team_(team), places_(places), errors_(*errors) {}

  void Check() {
    CheckFields(team_, places_, &errors_);
    if (IsRead("team") && !IsPlainName(team_.team())) Add("team", kPlainNameRule + Quoted(team_.team()));
    CheckTeamId();
    CheckKinds();
    for (int i = 0; i < team_.agents_size(); ++i) CheckAgent(i);
    CheckDuplicates();
    CheckSigningKeys();
    CheckRoles();
    CheckCommandFrom();
    CheckPolicies("share", team_.share());
    CheckPolicies("ground", team_.ground());
    for (const auto& [name, policy] : team_.rovers()) CheckRoversPolicy(name, policy);
    CheckKeepPolicies();
    CheckCustomTypes();
  }

 private:
  bool IsGiven(const std::string& field) const { return places_.count(field) > 0; }

  void Add(const std::string& field, const std::string& text) { errors_.Add(PlaceOf(places_, field), field, text); }

  // Returns true if the field is present and has no error so far.
  bool IsRead(const std::string& field) const { return IsGiven(field) && !errors_.Has(field); }

  void CheckPolicies(const std::string& section, const Policies& policies) {
    for (const auto& [name, policy] : policies) {
      const DataTypeRow* row = RowNamed(name);
      if (row != nullptr && row->rank == ShareRank::kRoles && policy != proto::POLICY_ALL) {
        Add(section + "." + name,
            "expected all: every agent needs all role assignments to decide which records it accepts");
        continue;
      }
      if (policy != proto::POLICY_LATEST || row == nullptr || row->may_be_latest) continue;
      Add(section + "." + name, "expected none or all, got \"latest\"");
    }
  }

  void CheckRoversPolicy(const std::string& name, proto::Policy policy) {
    const DataTypeRow* row = RowNamed(name);
    if (row == nullptr || policy == proto::POLICY_NONE) return;
    const std::string field = "rovers." + name;
    if (row->leader_sends == LeaderSends::kToAllRovers) {
      return Add(field, "the leader sends this type to all rovers anyway; remove it here");
    }
    if (row->type == proto::AGENT_EVENT) return Add(field, "events are not sent to rovers; remove it here");
    const auto given = team_.share().find(name);
    const bool is_given = given != team_.share().end() && given->second != proto::POLICY_UNSPECIFIED;
    CheckNotWider(field, policy, is_given ? given->second : row->share, "share." + name);
  }

  // Checks that `rovers` grants no more than `share`: the leader has no more of it.
  void CheckNotWider(const std::string& field, proto::Policy policy, proto::Policy share, const std::string& from) {
    if (policy == proto::POLICY_NONE || policy == proto::POLICY_UNSPECIFIED) return;
    if (share == proto::POLICY_NONE) {
      Add(field, "expected none, because " + from + " is none");
    } else if (share == proto::POLICY_LATEST && policy == proto::POLICY_ALL) {
      Add(field, "expected none or latest, because " + from + " is latest");
    }
  }

  void CheckTeamId() {
    if (!IsRead("team_id") || IsTeamId(team_.team_id())) return;
    Add("team_id", "expected 32 digits of 0 to 9 and a to f, got " + Quoted(team_.team_id()));
  }

  // Checks that there are at least one rover and at most one base station. Ignores agents that left the team.
  void CheckKinds() {
    const auto& agents = team_.agents();
    const auto is_base = [](const proto::AgentConfig& agent) {
      return agent.kind() == proto::AGENT_KIND_BASE_STATION && !agent.left();
    };
    const auto is_rover = [](const proto::AgentConfig& agent) { return agent.kind() == proto::AGENT_KIND_ROVER; };
    const auto stays = [&](const proto::AgentConfig& agent) { return is_rover(agent) && !agent.left(); };
    if (std::none_of(agents.begin(), agents.end(), is_rover)) {
      Add("agents", "expected at least one rover");
    } else if (std::none_of(agents.begin(), agents.end(), stays)) {
      Add("agents", "expected at least one rover that has not left");
    }
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
    if (IsRead(path + ".name") && !IsPlainName(agent.name())) {
      Add(path + ".name", kPlainNameRule + Quoted(agent.name()));
    }
    if (IsRead(path + ".address")) {
      const std::string why = WhyNoAddress(agent.address(), "other agents");
      if (!why.empty()) Add(path + ".address", why);
    }
    CheckListen(agent, path + ".listen");
    CheckClientAddress(agent, path + ".client_address");
    if (!team_.insecure() && !IsGiven(path + ".key")) {
      Add(path + ".key", "missing: the file of the agent's public key (or `insecure: true` for the team)");
    }
    if (agent.key().size() > kKeyFileLengthMax) Add(path + ".key", "the file's name is too long");
    if (agent.key().ends_with(".sec")) Add(path + ".key", "expected the public key's file, not the secret's");
    CheckPlace(agent, path);
  }

  // Checks that every agent with a CURVE key has a valid signing key, and that no agent of an `insecure` team has one.
  void CheckSigningKeys() {
    for (int i = 0; i < team_.agents_size(); ++i) {
      const proto::AgentConfig& agent = team_.agents(i);
      const std::string path = AgentPath(i) + ".signing_key";
      if (!IsGiven(path)) {
        if (!team_.insecure() && IsGiven(AgentPath(i) + ".key"))
          Add(path, "missing: `moonctl keys add-signing` gives every agent one that has none");
      } else if (!errors_.Has(path) && !IsSigningKey(agent.signing_key())) {
        Add(path, "expected 40 characters in Z85 of an Ed25519 key");
      } else if (team_.insecure()) {
        Add(path, "needs keys, but the team is `insecure: true`");
      }
    }
  }

  void CheckListen(const proto::AgentConfig& agent, const std::string& field) {
    if (!IsRead(field)) return;
    if (!agent.listen().starts_with("tcp://") || !agent.address().starts_with("tcp://")) {
      return Add(field, "expected tcp://HOST:PORT, beside an address of this kind, got " + Quoted(agent.listen()));
    }
    if (const std::string why = WhyNoAddress(agent.listen(), ""); !why.empty()) Add(field, why);
  }

  void CheckClientAddress(const proto::AgentConfig& agent, const std::string& field) {
    if (!IsRead(field)) return;
    if (!agent.client_address().starts_with("tcp://")) {
      return Add(field, "expected tcp://HOST:PORT, got " + Quoted(agent.client_address()));
    }
    if (const std::string why = WhyNoAddress(agent.client_address(), "clients"); !why.empty()) return Add(field, why);
    if (team_.insecure()) Add(field, "needs keys, but the team is `insecure: true`");
  }

  // Checks that a base station has a position and no start pose, and that a rover has no position.
  void CheckPlace(const proto::AgentConfig& agent, const std::string& path) {
    if (errors_.Has(path + ".kind")) return;
    if (agent.kind() == proto::AGENT_KIND_BASE_STATION) {
      if (!IsGiven(path + ".position_m")) Add(path + ".position_m", "missing");
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
    check("signing_key", [](const proto::AgentConfig& agent) { return agent.signing_key(); });
    check("client_address", [](const proto::AgentConfig& agent) { return agent.client_address(); });
    CheckClientAddressesAreOthers();
  }

  // Checks that no client address is also the address of an agent.
  void CheckClientAddressesAreOthers() {
    for (int i = 0; i < team_.agents_size(); ++i) {
      const std::string field = AgentPath(i) + ".client_address";
      if (!IsRead(field)) continue;
      for (int j = 0; j < team_.agents_size(); ++j) {
        if (team_.agents(i).client_address() != team_.agents(j).address()) continue;
        Add(field, team_.agents(i).client_address() + " is already that of " + AgentPath(j));
      }
    }
  }

  // Checks that no two elements of `list` have the same value of `field`.
  void CheckUnique(const std::string& list, int count, const std::string& field,
                   const std::function<std::string(int)>& value_of) {
    std::map<std::string, int> owners;
    for (int i = 0; i < count; ++i) {
      const std::string path = ElementPath(list, i) + "." + field;
      if (!IsRead(path)) continue;
      const std::string value = value_of(i);
      const auto [owner, is_new] = owners.emplace(value, i);
      if (!is_new) Add(path, value + " is already that of " + ElementPath(list, owner->second));
    }
  }

  void CheckKeepPolicies() {
    for (const auto& [name, text] : team_.keep()) {
      const auto given = team_.share().find(name);
      const DataTypeRow* row = RowNamed(name);
      const proto::Policy by_default = row == nullptr ? proto::POLICY_NONE : row->share;
      CheckKeep("keep." + name, text, given == team_.share().end() ? by_default : given->second, "share." + name);
    }
  }

  // Checks the keep rule `text` of a type. `share` is the type's policy, which comes from the field `share_field`.
  void CheckKeep(const std::string& field, const std::string& text, proto::Policy share,
                 const std::string& share_field) {
    if (!IsRead(field) || errors_.Has(share_field)) return;
    const std::optional<KeepRule> rule = ParseKeepRule(text);
    if (!rule) {
      return Add(field, "expected all, latest or a duration such as 7d or 12h, got " + Quoted(text) +
                            DidYouMean(text, {"all", "latest"}));
    }
    if (share == proto::POLICY_LATEST || rule->IsOfAnyAge()) return;
    const std::string policy = YamlName(*proto::Policy_descriptor()->FindValueByNumber(share));
    Add(field, "records of this type are never superseded, since " + share_field + " is " + policy +
                   ": expected all, got " + Quoted(text) + " (retention.keep_days removes old records)");
  }

  void CheckCustomTypes() {
    const int count = team_.custom_types_size();
    for (int i = 0; i < count; ++i) CheckCustomType(team_.custom_types(i), ElementPath("custom_types", i));
    CheckUnique("custom_types", count, "id", [this](int i) { return std::to_string(team_.custom_types(i).id()); });
    CheckUnique("custom_types", count, "name", [this](int i) { return team_.custom_types(i).name(); });
  }

  void CheckCustomType(const proto::CustomType& type, const std::string& path) {
    if (IsRead(path + ".name")) {
      if (!IsTypeName(type.name())) {
        Add(path + ".name", "expected a lower-case letter, then at most 31 lower-case letters, digits and _, got " +
                                Quoted(type.name()));
      } else if (DataTypeFromName(type.name(), {})) {
        Add(path + ".name", type.name() + " is a name of moondb's own");
      }
    }
    const proto::Policy share = type.share() == proto::POLICY_UNSPECIFIED ? proto::POLICY_ALL : type.share();
    CheckKeep(path + ".keep", type.keep(), share, path + ".share");
    CheckNotWider(path + ".rovers", type.rovers(), share, path + ".share");
  }

  void CheckRoles() {
    const proto::AgentConfig* leader = FindRover("roles.leader", team_.roles().leader());
    const proto::AgentConfig* survivor = FindRover("roles.survivor", team_.roles().survivor());
    if (leader != nullptr && leader == survivor) {
      Add("roles.survivor", leader->name() + " is the leader; the designated survivor must be another rover");
    }
  }

  // Checks that command_from holds names of agents, or only "all".
  void CheckCommandFrom() {
    if (!IsGiven("command_from")) return CheckBaseCommands();
    if (!IsRead("command_from")) return;
    const auto& given = team_.command_from();
    if (given.empty()) Add("command_from", "expected names of agents, or all");
    std::vector<std::string> names = {kAllMayCommand};
    for (const proto::AgentConfig& agent : team_.agents()) names.push_back(agent.name());
    for (int i = 0; i < given.size(); ++i) {
      const std::string path =
          IsGiven(ElementPath("command_from", i)) ? ElementPath("command_from", i) : "command_from";
      const auto first = std::find(given.begin(), given.begin() + i, given[i]);
      if (std::find(names.begin(), names.end(), given[i]) == names.end()) {
        Add(path, "no agent is named " + Quoted(given[i]) + DidYouMean(given[i], names));
      } else if (given[i] == kAllMayCommand && given.size() > 1) {
        Add(path, "all must be the only entry, because it names every agent");
      } else if (first != given.begin() + i) {
        Add(path, given[i] + " is named twice");
      } else if (const auto* agent = FindAgent(team_, given[i]); agent != nullptr && agent->left()) {
        Add(path, given[i] + " has left the team; remove it from this list");
      }
    }
  }

  // Checks a team without command_from. The base station commands such a team. If the base station has left the team,
  // command_from is required.
  void CheckBaseCommands() {
    const auto& agents = team_.agents();
    const bool has_left = std::any_of(agents.begin(), agents.end(), [](const proto::AgentConfig& agent) {
      return agent.kind() == proto::AGENT_KIND_BASE_STATION && agent.left();
    });
    if (!has_left || BaseStationOf(team_) != 0) return;
    Add("command_from",
        "missing: the base station, which commands by default, has left; name the agents that may command, or all");
  }

  const proto::AgentConfig* FindRover(const std::string& field, const std::string& name) {
    if (!IsRead(field)) return nullptr;
    std::vector<std::string> names;
    for (int i = 0; i < team_.agents_size(); ++i) {
      const proto::AgentConfig& agent = team_.agents(i);
      names.push_back(agent.name());
      if (agent.name() != name) continue;
      const bool is_rover = agent.kind() == proto::AGENT_KIND_ROVER;
      if (is_rover && !agent.left()) return &agent;
      Add(field, is_rover ? name + " has left the team; name another rover"
                          : name + " is a base station; only a rover can hold this role");
      return nullptr;
    }
    // Do not report an unknown name if some agent's name could not be read: `name` may be the name of that agent.
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

void FillPolicies(proto::Policy DataTypeRow::*by_default, Policies* policies) {
  for (const DataTypeRow& row : DataTypeRows()) {
    proto::Policy& policy = (*policies)[DataTypeName(row.type)];
    if (policy == proto::POLICY_UNSPECIFIED) policy = row.*by_default;
  }
}

// Removes the policies `none`, which types have by default. Files with the same meaning must have the same hash.
void FillRovers(Policies& rovers) {
  for (auto entry = rovers.begin(); entry != rovers.end();) {
    entry = entry->second == proto::POLICY_NONE ? rovers.erase(entry) : std::next(entry);
  }
}

// Returns the canonical text of the keep rule `given`, or `by_default` if `given` is not a rule. Files with the same
// meaning must have the same hash.
std::string KeepText(const std::string& given, const std::string& by_default) {
  const std::optional<KeepRule> rule = ParseKeepRule(given);
  return rule ? ToString(*rule) : by_default;
}

// Completes `keep`: adds a rule for each type whose built-in sharing policy is `latest`, and makes all rules canonical.
// An added rule is `latest` if the team shares the type under the policy `latest` and the type's records have versions
// (only the solver writes such types), otherwise `all`. Requires: `share` has a policy for each built-in type.
void FillKeep(proto::TeamConfig* team) {
  auto& keep = *team->mutable_keep();
  for (const DataTypeRow& row : DataTypeRows()) {
    const std::string name = DataTypeName(row.type);
    if (row.share != proto::POLICY_LATEST && keep.count(name) == 0) continue;
    const bool is_latest = team->share().at(name) == proto::POLICY_LATEST;
    keep[name] = KeepText(keep[name], is_latest && row.version != nullptr ? "latest" : "all");
  }
}

void FillRoles(proto::TeamConfig* team) {
  proto::RolesConfig* roles = team->mutable_roles();
  const auto first_rover_except = [&](const std::string& other) -> std::string {
    for (const proto::AgentConfig& agent : team->agents()) {
      if (agent.kind() == proto::AGENT_KIND_ROVER && !agent.left() && agent.name() != other) return agent.name();
    }
    return "";
  };
  if (roles->leader().empty()) roles->set_leader(first_rover_except(roles->survivor()));
  if (roles->survivor().empty()) roles->set_survivor(first_rover_except(roles->leader()));
}

void FillCommandFrom(proto::TeamConfig* team) {
  if (!team->command_from().empty()) return;
  const proto::AgentConfig* base = FindAgent(*team, BaseStationOf(*team));
  team->add_command_from(base == nullptr ? kAllMayCommand : base->name());
}

void FillCustomTypes(proto::TeamConfig* team) {
  auto& types = *team->mutable_custom_types();
  for (proto::CustomType& type : types) type.set_keep(KeepText(type.keep(), "all"));
  std::sort(types.begin(), types.end(),
            [](const proto::CustomType& a, const proto::CustomType& b) { return a.id() < b.id(); });
}

}  // namespace

bool IsPlainName(const std::string& name) {
  return !name.empty() && name.size() <= kNameLengthMax && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
}

void CheckTeam(const proto::TeamConfig& team, const Places& places, PlacedErrors* errors) {
  TeamChecker(team, places, errors).Check();
}

void FillDefaults(const Places& places, proto::TeamConfig* team) {
  FillFields(places, team);
  FillRoles(team);
  FillCommandFrom(team);
  FillPolicies(&DataTypeRow::share, team->mutable_share());
  FillPolicies(&DataTypeRow::ground, team->mutable_ground());
  FillRovers(*team->mutable_rovers());
  FillKeep(team);
  FillCustomTypes(team);
}

}  // namespace moondb
