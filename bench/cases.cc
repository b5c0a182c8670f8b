#include "bench/cases.h"

#include <utility>

namespace moondb {

BenchCase AsCase(Contest contest) {
  std::string name = contest.name;
  return {std::move(name), [contest = std::move(contest)](const BenchOptions& options) -> Result<std::vector<Section>> {
            Result<Section> section = Measured(contest, options);
            if (!section) return tl::unexpected(section.error());
            return std::vector<Section>{std::move(*section)};
          }};
}

std::vector<BenchCase> AllCases() {
  std::vector<BenchCase> all;
  for (auto cases : {MemoryCases(), InProcessCases(), RemoteCases(), IdleCases()}) {
    all.insert(all.end(), cases.begin(), cases.end());
  }
  return all;
}

}  // namespace moondb
