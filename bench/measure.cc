#include "bench/measure.h"

#include <algorithm>
#include <utility>

namespace moondb {

double Figure::median() const {
  std::vector<double> sorted = samples;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t middle = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}

Result<std::vector<Figure>> MeasureInTurn(const std::vector<Contender>& contenders, int repetitions,
                                          std::uint64_t count) {
  std::vector<Figure> figures;
  for (const Contender& contender : contenders) figures.push_back({contender.name, {}});
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      const Result<double> sample = contenders[i].measure(count);
      if (!sample) {
        return tl::unexpected(Error{sample.error().code, contenders[i].name + ": " + sample.error().text, {}});
      }
      figures[i].samples.push_back(*sample);
    }
  }
  return figures;
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
