// Results of one run of the simulator.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "apps/moondb_sim/invariants.h"

namespace moondb::simulation {

struct SimReport {
  std::vector<Violation> violations;     // The first violations, at most ten.
  std::vector<std::string> last_events;  // Last messages handled before the first violation.
  std::map<std::string, int> faults;     // How often each fault struck.
  std::map<std::string, int> rare;       // How often the run reached each rare state.
  std::uint64_t records = 0;             // Records inserted by robots.
  std::uint64_t messages = 0;            // Messages handled by actors.
  std::uint64_t radio_bytes = 0;
  std::uint64_t have_bytes = 0;   // Bytes of messages with have-sets.
  std::uint64_t batch_bytes = 0;  // Bytes of messages with records.
  std::uint64_t trace_hash = 0;
  double pruned = 0;  // Records pruned.
  int failovers = 0;  // Number of survivors' requests to lead.
  // Seconds to refill an empty survivor over a radio of 1 Mbit/s (SimOptions::measures_refill). Negative if it takes
  // more than a day.
  double refill_s = 0;
  std::uint64_t refill_bytes = 0;
};

}  // namespace moondb::simulation
