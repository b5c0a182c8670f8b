// Diagnose: finds what would stop a robot in the field, from facts about its computer, for `moonctl doctor`.
// Thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Limits beyond which a fact is a finding, besides kOpenFilesLeast (apps/common/process_limits.h) and
// kClockOffsetMax_s (health.h).
inline constexpr double kLossMax = 0.2;         // Fraction of echo requests without an answer.
inline constexpr int kMtuMin_bytes = 1280;      // Smallest packet size of IPv6; smaller ones split each batch.
inline constexpr std::int64_t kYearMin = 2026;  // A clock that shows an earlier year was never set.
inline constexpr std::uint64_t kMemoryMin_bytes = 256ull << 20;

// Facts about another agent, as seen from this computer.
struct PeerFacts {
  AgentId agent = 0;
  std::string name;
  std::string address;           // TeamConfig: tcp://HOST:PORT.
  std::string lookup_error;      // Why the host name has no address; empty: it has one, or the address is ipc://.
  std::string connect_error;     // Why no connection to the address opens; empty: one does.
  std::optional<int> mtu_bytes;  // Size of packets on the route. Null: not known.
  std::optional<double> loss;    // Fraction of echo requests without an answer. Null: not measured.
  std::optional<double> clock_offset_s;  // The peer's clock minus this one. Null: the own agent does not know it.
  std::string other_team_file;           // How the peer's team file differs; empty: it does not, or it is not known.
  std::string version;                   // Version of the peer's agent; empty: not known.
};

// Facts about this computer and its agent.
struct RobotFacts {
  std::string keys_error;     // Why the keys cannot be used; empty: they can.
  bool is_elsewhere = false;  // True if other agents' secret keys are on this computer, and not this agent's.
  std::string data_folder;
  std::string data_folder_error;  // Why the data folder cannot be used; empty: it can.
  std::optional<std::uint64_t> disk_free_bytes;
  bool is_memory_disk = false;                // True: the data folder is lost at a restart.
  std::int64_t year = 0;                      // The clock shows this year (UTC).
  std::optional<bool> is_clock_synchronised;  // The kernel's own state. Null: not known.
  bool is_running = false;                    // The agent answers.
  std::string agent_error;      // Why a running process does not answer; empty: it does, or there is none.
  std::string listen_error;     // Why the agent could not listen at its address; empty: it could, or it does.
  std::string listen_loopback;  // "127.0.1.1" if the host at which the agent listens is only a loopback address here.
  int sqlite_version = 0;       // 3040001 for 3.40.1.
  std::uint64_t open_files_max = 0;
  std::optional<std::uint64_t> memory_available_bytes;
  std::string version;           // Version of this moonctl.
  std::string agent_version;     // Version of the own agent; empty: it does not run.
  std::vector<PeerFacts> peers;  // All agents that have not left the team, without the own one.
};

// One check. A finding is either a fault, with which the robot must not leave, or advice.
struct RobotCheck {
  enum class Kind { kGood, kAdvice, kFault, kUnknown };
  std::string what;  // "keys", "clock".
  Kind kind = Kind::kGood;
  std::string text;    // The fact that was found.
  std::string remedy;  // Advice to the user; empty: none.
};

// Returns whether a TCP endpoint names the loopback interface by itself, without a lookup of its host name.
bool IsLoopback(const std::string& endpoint);

// Returns all checks, the good ones too, in a fixed order.
std::vector<RobotCheck> Diagnose(const proto::TeamConfig& team, const proto::AgentConfig& agent,
                                 const RobotFacts& facts);

}  // namespace moondb
