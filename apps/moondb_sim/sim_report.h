// The report of one run of the simulator.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "apps/moondb_sim/invariants.h"

namespace moondb::simulation {

struct SimReport {
  std::vector<Violation> violations;     // The first few.
  std::vector<std::string> last_events;  // Before the first violation.
  std::map<std::string, int> faults;     // How often each struck.
  std::map<std::string, int> rare;       // How often it came into each of RareStateKinds, where it did.
  std::uint64_t records = 0;             // Inserted by robots.
  std::uint64_t messages = 0;            // Handled by actors.
  std::uint64_t radio_bytes = 0;
  std::uint64_t have_bytes = 0;   // Bytes of messages with have-sets.
  std::uint64_t batch_bytes = 0;  // And those with records.
  std::uint64_t trace_hash = 0;
  double pruned = 0;    // Records.
  int failovers = 0;    // Requests of survivors to lead.
  double refill_s = 0;  // With SimOptions::measures_refill, over a radio of 1 Mbit/s; negative: not within a day.
  std::uint64_t refill_bytes = 0;
};

}  // namespace moondb::simulation
