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
    return Advice("keys", "the team is `insecure: true`: every program that reaches the ports can speak as any agent",
                  "make a team with keys: moonctl config init");
  }
  if (facts.keys_error.empty()) return Good("keys", "match the team file, and nobody else reads the secrets");
  return Fault("keys", facts.keys_error,
               "bring the files again: moonctl config pack " + agent.name() + ", then moonctl config unpack here");
}

RobotCheck DataCheck(const RobotFacts& facts) {
  if (!facts.data_folder_error.empty()) {
    return Fault("data", facts.data_folder_error, "give the agent a folder of its own that it may write");
  }
  if (facts.is_memory_disk) {
    return Fault("data", facts.data_folder + " is in memory: a restart loses all records",
                 "choose a folder on a disk: --data-dir");
  }
  return Good("data", facts.data_folder + " can be written");
}

RobotCheck DiskCheck(const proto::TeamConfig& team, const RobotFacts& facts) {
  if (!facts.disk_free_bytes) return Unknown("disk", "its free space is not known", "");
  const auto free = static_cast<double>(*facts.disk_free_bytes);
  const double least = team.retention().disk_free_mb_min() * kMegabyte_bytes;
  const std::string text = FormatBytes(free) + " are free";
  if (free >= least) return Good("disk", text);
  return Fault("disk", text + ", less than the " + FormatBytes(least) + " of retention.disk_free_mb_min",
               "make room (moonctl db prune), or take a larger disk");
}

RobotCheck ClockCheck(const RobotFacts& facts) {
  if (facts.year < kYearMin) {
    return Fault("clock", "it shows the year " + std::to_string(facts.year), "set it, for example with chrony");
  }
  for (const PeerFacts& peer : facts.peers) {
    if (!peer.clock_offset_s || std::abs(*peer.clock_offset_s) <= kClockOffsetMax_s) continue;
    return Fault("clock",
                 "it differs by " + FormatSeconds(std::abs(*peer.clock_offset_s)) + " from that of " + peer.name,
                 "synchronise both, for example with chrony");
  }
  if (facts.is_clock_synchronised == false) {
    return Advice("clock", "the kernel says that nothing synchronises it",
                  "run chrony or another NTP client: ranges need milliseconds");
  }
  if (!facts.is_clock_synchronised) return Unknown("clock", "the kernel does not say whether it is synchronised", "");
  return Good("clock", "is synchronised");
}

RobotCheck PortCheck(const proto::AgentConfig& agent, const RobotFacts& facts) {
  if (facts.listen_error.empty()) {
    return Good("address", ListenAddressOf(agent) + (facts.is_running ? " is in use by the agent" : " is free"));
  }
  return Fault("address", facts.listen_error,
               "correct `address` of " + agent.name() + " in the team file, or stop the other program");
}

RobotCheck AgentCheck(const proto::AgentConfig& agent, const RobotFacts& facts) {
  if (!facts.agent_error.empty()) {
    return Fault("agent", facts.agent_error, "read its log, and restart it");
  }
  if (!facts.is_running) {
    return Advice("agent", agent.name() + " does not run: clocks and team files of the others are not compared",
                  "start it: systemctl start moondb-agent@" + agent.name() + ", or moonctl up -a " + agent.name());
  }
  if (facts.agent_version != facts.version) {
    return Advice("agent", "runs version " + facts.agent_version + ", and " + facts.version + " is installed",
                  "restart it");
  }
  return Good("agent", "answers");
}

RobotCheck LimitsCheck(const RobotFacts& facts) {
  if (facts.open_files_max < kOpenFilesLeast) {
    return Fault("limits", "a process may open " + std::to_string(facts.open_files_max) + " files",
                 "allow " + std::to_string(kOpenFilesLeast) + ": LimitNOFILE in the unit, or ulimit -Hn");
  }
  if (facts.memory_available_bytes && *facts.memory_available_bytes < kMemoryMin_bytes) {
    return Fault("limits", FormatBytes(static_cast<double>(*facts.memory_available_bytes)) + " of memory are free",
                 "end other programs; docs/SIZING.md gives what an agent needs");
  }
  return Good("limits", "open files and memory suffice");
}

void AddPeerChecks(const PeerFacts& peer, const RobotFacts& facts, std::vector<RobotCheck>& checks) {
  const std::string what = "to " + peer.name;
  if (!peer.lookup_error.empty()) {
    checks.push_back(Fault(what, peer.address + ": " + peer.lookup_error,
                           "correct the name in the team file, or the name service of this computer"));
    return;
  }
  const std::size_t before = checks.size();
  if (!peer.connect_error.empty()) {
    checks.push_back(Fault(what, peer.address + ": " + peer.connect_error,
                           "is " + peer.name + " on, its agent running, the port open in its firewall?"));
  }
  if (peer.mtu_bytes && *peer.mtu_bytes < kMtuMin_bytes) {
    checks.push_back(Advice(what, "packets on the way carry " + std::to_string(*peer.mtu_bytes) + " bytes at most",
                            "raise the radio's MTU to " + std::to_string(kMtuMin_bytes) + " or more"));
  }
  if (peer.loss && *peer.loss > kLossMax) {
    checks.push_back(Fault(what, FormatFixed(100 * *peer.loss, 0) + " % of echo requests have no answer",
                           "move the antennas or the robots, or change the radio's channel"));
  }
  if (!peer.other_team_file.empty()) {
    checks.push_back(Fault(what, "its team file differs: " + peer.other_team_file,
                           "bring the same file to both (moonctl config pack) and restart their agents"));
  }
  if (!peer.version.empty() && !facts.agent_version.empty() && peer.version != facts.agent_version) {
    checks.push_back(Advice(what, "its agent has version " + peer.version + ", this one " + facts.agent_version,
                            "install the same version; docs/COMPATIBILITY.md says what differs"));
  }
  if (checks.size() > before) return;
  std::string text = peer.address;
  if (!peer.address.starts_with("tcp://")) {
    checks.push_back(Good(what, text));
    return;
  }
  text += " accepts connections";
  text += peer.loss ? ", " + FormatFixed(100 * *peer.loss, 0) + " % loss" : ", loss not measured (may not ping)";
  if (peer.mtu_bytes) text += ", MTU " + std::to_string(*peer.mtu_bytes);
  checks.push_back(Good(what, text));
}

}  // namespace

std::vector<RobotCheck> Diagnose(const proto::TeamConfig& team, const proto::AgentConfig& agent,
                                 const RobotFacts& facts) {
  std::vector<RobotCheck> checks{KeysCheck(team, agent, facts),
                                 DataCheck(facts),
                                 DiskCheck(team, facts),
                                 ClockCheck(facts),
                                 LimitsCheck(facts),
                                 PortCheck(agent, facts),
                                 AgentCheck(agent, facts)};
  for (const PeerFacts& peer : facts.peers) AddPeerChecks(peer, facts, checks);
  return checks;
}

}  // namespace moondb
