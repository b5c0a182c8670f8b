// history_bench: measures how long inserting a state takes while the robot's own disk keeps all superseded states.
//
//   history_bench [--inserts N] [--folder FOLDER] [--history-mb MB]
//
// Inserts states of one key into two new stores in FOLDER (default: the working folder): one store keeps history, the
// other does not. The inserts alternate between the stores. Each insert is a transaction that survives a power cut.
// Prints one JSON object: medians of the first and of the last thousand inserts (microseconds), and the bytes written
// to the disk per insert. Exit code 0: measured; 1: a store could not be written; other: wrong arguments.
#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "actors/storage/record_store.h"
#include "apps/common/arguments.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr std::size_t kWindow = 1000;

struct Options {
  std::size_t inserts = 100'000;
  std::string folder = ".";
  double history_mb = 64;
};

struct Measured {
  double first_us = 0;
  double last_us = 0;
  double bytes_an_insert = 0;  // Bytes per insert written to the database file and its log.
  double history_count = 0;
  double history_bytes = 0;
  double file_bytes = 0;
};

double MedianOf(std::vector<double> times) {
  std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
  return times[times.size() / 2];
}

class Run {
 public:
  static Result<Run> Begin(const Options& options, bool has_history) {
    RecordStore::Options store;
    store.path = std::filesystem::path(options.folder) / (has_history ? "history.sqlite" : "latest.sqlite");
    std::error_code ignored;
    for (const char* ending : {"", "-wal", "-shm"}) std::filesystem::remove(store.path + ending, ignored);
    store.self = 1;
    store.team = {1};
    store.policies[proto::TEMPERATURE] = proto::POLICY_LATEST;
    if (has_history) {
      store.history.bytes_max = static_cast<std::uint64_t>(options.history_mb * 1e6);
      store.history.keep[proto::TEMPERATURE] = KeepRule{};
    }
    Result<std::unique_ptr<RecordStore>> opened = RecordStore::Open(store);
    if (!opened) return tl::unexpected(opened.error());
    return Run(*std::move(opened));
  }

  Result<void> Insert(int number) {
    proto::InsertRequest request;
    proto::Record& record = *request.add_records();
    record.set_timestamp_ns(1'700'000'000'000'000'000 + number * 1'000'000'000LL);
    record.mutable_temperature()->set_celsius(-40 + 0.001 * number);
    const auto begin = std::chrono::steady_clock::now();
    const RecordStore::Inserted inserted = store_->Insert(request);
    times_us_.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count());
    if (IsError(inserted.reply.error())) return tl::unexpected(FromProto(inserted.reply.error()));
    return {};
  }

  Result<Measured> End() {
    const Result<proto::StorageStatus> status = store_->GetStatus();
    if (!status) return tl::unexpected(status.error());
    const Result<std::uint64_t> used = store_->database().UsedPageBytes();
    if (!used) return tl::unexpected(used.error());
    const auto window = static_cast<std::ptrdiff_t>(std::min(kWindow, times_us_.size()));
    Measured measured;
    measured.first_us = MedianOf({times_us_.begin(), times_us_.begin() + window});
    measured.last_us = MedianOf({times_us_.end() - window, times_us_.end()});
    measured.bytes_an_insert =
        static_cast<double>(store_->database().WrittenBytes()) / static_cast<double>(times_us_.size());
    measured.history_count = status->history_count();
    measured.history_bytes = status->history_bytes();
    measured.file_bytes = static_cast<double>(*used);
    return measured;
  }

 private:
  explicit Run(std::unique_ptr<RecordStore> store) : store_(std::move(store)) {}

  std::unique_ptr<RecordStore> store_;
  std::vector<double> times_us_;
};

std::string JsonOf(const Measured& measured) {
  return fmt::format(
      "{{\"first_1000_median_us\":{:.1f},\"last_1000_median_us\":{:.1f},\"written_bytes_an_insert\":{:.0f},"
      "\"history_count\":{:.0f},\"history_bytes\":{:.0f},\"file_bytes\":{:.0f}}}",
      measured.first_us, measured.last_us, measured.bytes_an_insert, measured.history_count, measured.history_bytes,
      measured.file_bytes);
}

int Complain(const Error& error) {
  fmt::print(stderr, "history_bench: {}\n", ToString(error));
  return 1;
}

int RunBench(const Options& options) {
  Result<Run> with = Run::Begin(options, /*has_history=*/true);
  if (!with) return Complain(with.error());
  Result<Run> without = Run::Begin(options, /*has_history=*/false);
  if (!without) return Complain(without.error());
  // The inserts alternate between the stores, so that other load on the machine slows both equally.
  for (std::size_t i = 0; i < options.inserts; ++i) {
    if (const Result<void> done = with->Insert(static_cast<int>(i)); !done) return Complain(done.error());
    if (const Result<void> done = without->Insert(static_cast<int>(i)); !done) return Complain(done.error());
  }
  const Result<Measured> kept = with->End();
  if (!kept) return Complain(kept.error());
  const Result<Measured> latest = without->End();
  if (!latest) return Complain(latest.error());
  fmt::print("{{\"inserts\":{},\"history_mb_max\":{},\"with_history\":{},\"without\":{}}}\n", options.inserts,
             options.history_mb, JsonOf(*kept), JsonOf(*latest));
  return 0;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::Options options;
  moondb::Command app("history_bench", "Measures inserting states whose predecessors are kept.");
  app.AddOption("--inserts", options.inserts, "States, of one key (100000)").Within(1u, 100'000'000u);
  app.AddOption("--folder", options.folder, "Folder for the stores, on the disk to measure").ExistingFolder();
  app.AddOption("--history-mb", options.history_mb, "retention.history_mb_max (64)").Within(0.0, 1e6);
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
  return moondb::RunBench(options);
}
