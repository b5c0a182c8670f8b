#include "apps/moonctl/diagnosis.h"

#include <cmath>

#include "apps/common/process_limits.h"
#include "apps/common/table.h"
#include "apps/moonctl/health.h"
#include "model/team_member.h"

namespace moondb {
namespace {

using Kind = RobotCheck::Kind;

constexpr double kMegabyte_bytes = 1e6;
// The WAL-reset bug (docs/SPACE.md, "Other programs at the store"): 3.7.0 to 3.51.2.
constexpr int kWalResetBugFirst = 3'007'000;
constexpr int kWalResetBugLast = 3'051'002;

RobotCheck Good(std::string what, std::string text) { return {std::move(what), Kind::kGood, std::move(text), ""}; }

RobotCheck Fault(std::string what, std::string text, std::string remedy) {
  return {std::move(what), Kind::kFault, std::move(text), std::move(remedy)};
}

RobotCheck Advice(std::string what, std::string text, std::string remedy) {
  return {std::move(what), Kind::kAdvice, std::move(text), std::move(remedy)};
}

RobotCheck Unknown(std::string what, std::string text, std::string remedy) {
  return {std::move(what), Kind::kUnknown, std::move(text), std::move(remedy)};
}

RobotCheck KeysCheck(const proto::TeamConfig& team, const proto::AgentConfig& agent, const RobotFacts& facts) {
  if (team.insecure()) {
    return Advice("keys",
                  "the team file has `insecure: true`: any program that reaches the ports can impersonate any agent",
                  "create a team with keys: moonctl config init");
  }
  if (facts.is_elsewhere) {
    return Fault("keys", "this computer has the secret keys of another agent, but not those of " + agent.name(),
                 "run moonctl doctor on the computer of " + agent.name() + "; do not copy its secret keys here");
  }
  if (facts.keys_error.empty())
    return Good("keys", "the keys match the team file, and no other user can read the secret keys");
  return Fault(
      "keys", facts.keys_error,
      "copy the files to this robot again: moonctl config pack " + agent.name() + ", then moonctl config unpack here");
}

RobotCheck DataCheck(const RobotFacts& facts) {
  if (!facts.data_folder_error.empty()) {
    return Fault("data", facts.data_folder_error, "give the agent its own writable folder with --data-dir");
  }
  if (facts.is_memory_disk) {
    return Fault("data", facts.data_folder + " is in memory: a reboot loses all records",
                 "choose a folder on a disk: --data-dir");
  }
  return Good("data", facts.data_folder + " is writable");
}

// SQLite can lose committed data if two connections write or checkpoint a store at the same moment.
RobotCheck SqliteCheck(const RobotFacts& facts) {
  const int version = facts.sqlite_version;
  const std::string name = "SQLite " + std::to_string(version / 1'000'000) + "." +
                           std::to_string(version / 1000 % 1000) + "." + std::to_string(version % 1000);
  if (version < kWalResetBugFirst || version > kWalResetBugLast) return Good("sqlite", "the store uses " + name);
  return Good("sqlite", "the store uses " + name +
                            ", which has the WAL-reset bug: let no other program write or checkpoint the store");
}

RobotCheck DiskCheck(const proto::TeamConfig& team, const RobotFacts& facts) {
  if (!facts.disk_free_bytes)
    return Unknown("disk", "the free space of the disk cannot be read",
                   "check that the disk of the data folder is mounted");
  const auto free = static_cast<double>(*facts.disk_free_bytes);
  const double least = team.retention().disk_free_mb_min() * kMegabyte_bytes;
  const std::string text = FormatBytes(free) + " are free";
  if (free >= least) return Good("disk", text);
  return Fault("disk", text + ", less than the " + FormatBytes(least) + " of retention.disk_free_mb_min",
               "free disk space (moonctl db prune), or use a larger disk");
}

RobotCheck ClockCheck(const RobotFacts& facts) {
  if (facts.year < kYearMin) {
    return Fault("clock", "the clock shows the year " + std::to_string(facts.year),
                 "set the clock, for example with chrony");
  }
  for (const PeerFacts& peer : facts.peers) {
    if (!peer.clock_offset_s || std::abs(*peer.clock_offset_s) <= kClockOffsetMax_s) continue;
    return Fault(
        "clock",
        "the clock differs by " + FormatSeconds(std::abs(*peer.clock_offset_s)) + " from the clock of " + peer.name,
        "synchronise both clocks, for example with chrony");
  }
  if (facts.is_clock_synchronised == false) {
    return Advice("clock", "the kernel reports that the clock is not synchronised",
                  "run chrony or another NTP client: ranges need clocks that agree within milliseconds");
  }
  if (!facts.is_clock_synchronised)
    return Unknown("clock", "the kernel does not report whether the clock is synchronised", "");
  return Good("clock", "the clock is synchronised");
}

RobotCheck PortCheck(const proto::TeamConfig& team, const proto::AgentConfig& agent, const RobotFacts& facts) {
  const bool has_others = std::ranges::any_of(team.agents(), [&](const proto::AgentConfig& other) {
    return other.id() != agent.id() && other.address().starts_with("tcp://") && !IsLoopback(other.address());
  });
  if (!facts.listen_loopback.empty() && has_others) {
    return Fault("address",
                 ListenAddressOf(agent) + " is " + facts.listen_loopback +
                     " on this computer (see /etc/hosts), so no other computer reaches the agent",
                 "give " + agent.name() + " `listen: tcp://0.0.0.0:PORT` in the team file, or a number as address");
  }
  if (facts.listen_error.empty()) {
    return Good("address", ListenAddressOf(agent) + (facts.is_running ? " is in use by the agent" : " is free"));
  }
  return Fault("address", facts.listen_error,
               "correct `address` of " + agent.name() + " in the team file, or stop the program that uses the port");
}

RobotCheck AgentCheck(const proto::AgentConfig& agent, const RobotFacts& facts) {
  if (!facts.agent_error.empty()) {
    return Fault("agent", facts.agent_error, "read the agent's log, and restart the agent");
  }
  if (!facts.is_running) {
    return Advice("agent",
                  agent.name() + " is not running; the clocks and team files of other agents were not compared",
                  "start it: systemctl start moondb-agent@" + agent.name() + ", or moonctl up -a " + agent.name());
  }
  if (facts.agent_version != facts.version) {
    return Advice("agent",
                  "the running agent has version " + facts.agent_version + ", but " + facts.version + " is installed",
                  "restart the agent");
  }
  return Good("agent", "the agent answers");
}

RobotCheck LimitsCheck(const RobotFacts& facts) {
  if (facts.open_files_max < kOpenFilesLeast) {
    return Fault(
        "limits", "a process may open only " + std::to_string(facts.open_files_max) + " files",
        "allow " + std::to_string(kOpenFilesLeast) + " open files: LimitNOFILE in the systemd unit, or ulimit -Hn");
  }
  if (facts.memory_available_bytes && *facts.memory_available_bytes < kMemoryMin_bytes) {
    return Fault("limits",
                 FormatBytes(static_cast<double>(*facts.memory_available_bytes)) + " of free memory is too little",
                 "stop other programs; docs/SIZING.md gives the memory that an agent needs");
  }
  return Good("limits", "the limit of open files and the free memory suffice");
}

void AddPeerChecks(const PeerFacts& peer, const RobotFacts& facts, std::vector<RobotCheck>& checks) {
  const std::string what = "to " + peer.name;
  if (!peer.lookup_error.empty()) {
    checks.push_back(Fault(what, peer.address + ": " + peer.lookup_error,
                           "correct the host name in the team file, or the DNS settings of this computer"));
    return;
  }
  const std::size_t before = checks.size();
  if (!peer.connect_error.empty()) {
    checks.push_back(
        Fault(what, peer.address + ": " + peer.connect_error,
              "check that " + peer.name + " is switched on, its agent runs, and its firewall opens the port"));
  }
  if (peer.mtu_bytes && *peer.mtu_bytes < kMtuMin_bytes) {
    checks.push_back(Advice(what, "the path carries packets of at most " + std::to_string(*peer.mtu_bytes) + " bytes",
                            "raise the radio's MTU to " + std::to_string(kMtuMin_bytes) + " or more"));
  }
  if (peer.loss && *peer.loss > kLossMax) {
    checks.push_back(Fault(what, FormatFixed(100 * *peer.loss, 0) + " % of pings are not answered",
                           "move the antennas or the robots, or change the radio's channel"));
  }
  if (!peer.other_team_file.empty()) {
    checks.push_back(Fault(what, peer.name + " has a different team file: " + peer.other_team_file,
                           "copy the same team file to both robots (moonctl config pack) and restart their agents"));
  }
  if (!peer.version.empty() && !facts.agent_version.empty() && peer.version != facts.agent_version) {
    checks.push_back(Advice(
        what, peer.name + " runs version " + peer.version + ", but this agent runs version " + facts.agent_version,
        "install the same version; docs/COMPATIBILITY.md says what differs"));
  }
  if (checks.size() > before) return;
  std::string text = peer.address;
  if (!peer.address.starts_with("tcp://")) {
    checks.push_back(Good(what, text));
    return;
  }
  text += " accepts connections";
  text +=
      peer.loss ? ", " + FormatFixed(100 * *peer.loss, 0) + " % loss" : ", loss not measured (no permission to ping)";
  if (peer.mtu_bytes) text += ", MTU " + std::to_string(*peer.mtu_bytes);
  checks.push_back(Good(what, text));
}

}  // namespace

bool IsLoopback(const std::string& endpoint) {
  return endpoint.starts_with("tcp://127.") || endpoint.starts_with("tcp://localhost:") ||
         endpoint.starts_with("tcp://[::1]:");
}

std::vector<RobotCheck> Diagnose(const proto::TeamConfig& team, const proto::AgentConfig& agent,
                                 const RobotFacts& facts) {
  std::vector<RobotCheck> checks{KeysCheck(team, agent, facts), DataCheck(facts),        SqliteCheck(facts),
                                 DiskCheck(team, facts),        ClockCheck(facts),       LimitsCheck(facts),
                                 PortCheck(team, agent, facts), AgentCheck(agent, facts)};
  for (const PeerFacts& peer : facts.peers) AddPeerChecks(peer, facts, checks);
  return checks;
}

}  // namespace moondb
