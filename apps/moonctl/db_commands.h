// The commands of `moonctl db` that send several requests to an agent or work on its database file.
#pragma once

#include <string>
#include <vector>

#include "apps/moonctl/command_context.h"

namespace moondb {

// Makes each agent, or the agent given with -a, verify its own store. Returns kFailed if any store is damaged,
// otherwise kUnreachable if an agent does not answer.
ExitCode VerifyStores(CommandContext& context);

// Counts the records that only one of the two agents holds, and compares the contents of the records that both agents
// hold. Returns kFailed if the agents differ.
ExitCode CompareStores(CommandContext& context, const std::string& first, const std::string& second);

// Arguments of `db prune`, which runs on one agent.
struct PruneArguments {
  std::string older_than;  // "30d", "12h". Empty: any age.
  std::vector<std::string> types;
  bool occluded_maps = false;
  bool is_history = false;
  // Maximum size of the removed records in megabytes. The oldest records are removed first. 0: no limit.
  double megabytes_max = 0;
  bool is_dry_run = false;
};

// Makes the agent given with -a remove records that need not be kept, and prints a summary. Returns kRefused if nothing
// can be removed because the leader or the survivor does not answer the agent.
ExitCode PruneStore(CommandContext& context, const PruneArguments& arguments);

// Arguments of `db query` and `db backup`, which work on an agent's database file on this machine.
struct StoreFileArguments {
  std::string text;         // The query, or the path of the backup.
  std::string data_folder;  // Value of `moonctl up --data-dir`. Empty: the default.
};

inline constexpr std::size_t kQueryRowsMax = 1'000'000;

struct QueryArguments : StoreFileArguments {
  std::size_t rows_max = 0;  // Maximum number of rows. 0: the default of the output format.
  bool is_csv = false;
  std::string out;  // Path of the CSV file. Empty: stdout.
};

ExitCode QueryFile(CommandContext& context, const QueryArguments& arguments);
ExitCode BackUpFile(CommandContext& context, const StoreFileArguments& arguments);

}  // namespace moondb
