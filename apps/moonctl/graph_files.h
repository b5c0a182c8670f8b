// Reads the graph files that a command line names: one PyFG file, or the g2o files of one graph.
#pragma once

#include <string>
#include <vector>

#include "apps/common/arguments.h"
#include "model/error.h"
#include "model/g2o.h"
#include "model/pyfg.h"

namespace moondb {

struct GraphFileArguments {
  std::vector<std::string> files;
  std::string edge_sigmas;  // "0.1,0.05": m and rad. Empty: the option is not given.
};

// The content of g2o files (`g2o`) or of a PyFG file (`pyfg`).
struct GraphFile {
  bool is_g2o = false;
  G2o g2o;
  Pyfg pyfg;
};

// Adds the positional argument for the files and the option --edge-sigmas. `arguments` must outlive the command.
void AddGraphFileOptions(Command& command, GraphFileArguments& arguments);

bool IsG2o(const std::string& file);

// Fails with kInvalid for a wrong --edge-sigmas, for several files that are not all g2o, and for a file that is missing
// or faulty (ReadG2o, ReadPyfg).
Result<GraphFile> ReadGraphFile(const GraphFileArguments& arguments,
                                InformationCheck check = InformationCheck::kPositiveDefinite);

}  // namespace moondb
