#include "bench/measure.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "bench/process_status.h"

namespace moondb {
namespace {

// Minimum number of messages per repetition, even if the options ask for fewer.
constexpr std::uint64_t kCountMin = 8;

}  // namespace

double Median(std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  const std::size_t middle = samples.size() / 2;
  return samples.size() % 2 == 1 ? samples[middle] : (samples[middle - 1] + samples[middle]) / 2;
}

Result<Section> Measured(const Contest& contest, const BenchOptions& options) {
  Section section{contest.name, contest.unit, contest.target, {}};
  std::vector<const Contender*> contenders;
  for (const Contender& contender : contest.contenders) {
    if (!contender.measure || !IsAskedFor(contender.name, options)) continue;
    contenders.push_back(&contender);
    section.figures.push_back({contender.name, {}});
  }
  const std::uint64_t count = std::max(options.messages / contest.share, kCountMin);
  for (int repetition = 0; repetition < options.repetitions; ++repetition) {
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      const double cpu_before_s = CpuSeconds();
      const Result<double> sample = contenders[i]->measure(count);
      if (!sample) {
        return tl::unexpected(Error{sample.error().code, contenders[i]->name + ": " + sample.error().text, {}});
      }
      section.figures[i].samples.push_back(*sample);
      section.figures[i].cpu_ns.push_back((CpuSeconds() - cpu_before_s) * 1e9 / static_cast<double>(count));
    }
  }
  return section;
}

bool IsAskedFor(const std::string& contender, const BenchOptions& options) {
  return options.contender.empty() || options.contender == contender;
}

double PerSecond(std::uint64_t count, BenchClock::duration took) {
  return static_cast<double>(count) / std::chrono::duration<double>(took).count();
}

double MicrosecondsEach(std::uint64_t count, BenchClock::duration took) {
  return std::chrono::duration<double, std::micro>(took).count() / static_cast<double>(count);
}

void RunSenders(int sender_count, const std::function<void(int sender)>& send) {
  std::vector<std::thread> threads;
  for (int sender = 0; sender < sender_count; ++sender) threads.emplace_back([&send, sender] { send(sender); });
  for (std::thread& thread : threads) thread.join();
}

}  // namespace moondb
