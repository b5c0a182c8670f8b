#include <string>
#include <utility>

#include "bench/cases.h"
#include "bench/in_process.h"
#include "bench/process_status.h"

namespace moondb {
namespace {

constexpr int kManySenders = 8;

// Runs fan_in once. Returns the peak of the resident memory minus the resident memory before the run, in megabytes.
Result<double> Growth(const InProcess& contender, int sender_count, std::uint64_t count) {
  const std::int64_t before = ResidentBytes();
  ResetPeakResident();
  if (const Result<double> ran = contender.fan_in(sender_count, count); !ran) return tl::unexpected(ran.error());
  return static_cast<double>(PeakResidentBytes() - before) * 1e-6;
}

// Returns a case that measures each contender once, moondb first. A second measurement would be too low, because the
// heap keeps the memory that it has grown to.
BenchCase MemoryCase(std::string name, int sender_count) {
  return {name, [name, sender_count](BenchOptions options) {
            const auto of = [sender_count](const InProcess& contender) -> Measure {
              if (!contender.fan_in) return nullptr;
              return [=](std::uint64_t count) { return Growth(contender, sender_count, count); };
            };
            const Contest contest = {name,
                                     "MB",
                                     "<= 16",
                                     /*share=*/1,
                                     {{"moondb", of(MoondbInProcess())}, {"caf", of(CafInProcess())}}};
            options.repetitions = 1;
            return AsCase(contest).run(options);
          }};
}

}  // namespace

std::vector<BenchCase> MemoryCases() {
  return {MemoryCase("memory_one_to_one", 1), MemoryCase("memory_fan_in", kManySenders)};
}

}  // namespace moondb
