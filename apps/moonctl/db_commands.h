// The commands of `moonctl db` that are more than one question to each agent.
#pragma once

#include <string>
#include <vector>

#include "apps/moonctl/command_context.h"

namespace moondb {

// Lets each agent (or -a) hold its store against itself: kFailed where anything is damaged, else kUnreachable where an
// agent does not answer.
ExitCode VerifyStores(CommandContext& context);

// What two agents hold and the other lacks, and whether what both hold is the same: kFailed where not.
ExitCode CompareStores(CommandContext& context, const std::string& first, const std::string& second);

// Of `db prune`, on one agent.
struct PruneArguments {
  std::string older_than;  // "30d", "12h"; empty: of any age.
  std::vector<std::string> types;
  bool occluded_maps = false;
  bool is_history = false;
  double megabytes_max = 0;  // 0: no limit.
  bool is_dry_run = false;
};

// Lets the agent of -a remove what need not be kept, and shows what went: kRefused where nothing could, since leader or
// survivor cannot be asked.
ExitCode PruneStore(CommandContext& context, const PruneArguments& arguments);

// Of `db query` and `db backup`, which work on an agent's file on this machine.
struct StoreFileArguments {
  std::string text;         // The query, or where the backup goes.
  std::string data_folder;  // As given to `moonctl up`; empty: its default.
};

inline constexpr std::size_t kQueryRowsMax = 1'000'000;

struct QueryArguments : StoreFileArguments {
  std::size_t rows_max = 0;  // 0: as many as suit the form of the answer.
  bool is_csv = false;
  std::string out;  // A file for the CSV; empty: stdout.
};

ExitCode QueryFile(CommandContext& context, const QueryArguments& arguments);
ExitCode BackUpFile(CommandContext& context, const StoreFileArguments& arguments);

}  // namespace moondb
