// SimulatedDisk: files in memory that lose what was not synced when the power is cut, as a file system for SQLite.
//
// What was written and not synced at a power cut is lost, or a part of it stays: a prefix, or any of the writes, the
// last one perhaps torn. From the power cut on every call on a file that was open fails, so that a process that is
// being destroyed changes nothing any more; what is opened afterwards works. Files whose paths begin alike belong to
// one agent: such a beginning is what the calls below name.
//
// Registers itself with SQLite under name(); databases are opened with it as their `vfs`, in locking_mode=EXCLUSIVE
// (there is no shared memory), and must be closed before it is destroyed. From one thread. Equal seeds and calls give
// equal results.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>

namespace moondb::simulation {

class SimulatedDisk {
 public:
  explicit SimulatedDisk(std::uint64_t seed);
  ~SimulatedDisk();
  SimulatedDisk(const SimulatedDisk&) = delete;
  SimulatedDisk& operator=(const SimulatedDisk&) = delete;

  const std::string& name() const { return name_; }

  void CutPower(const std::string& prefix);
  // After so many more writes or syncs the power is cut: in the middle of a transaction. 0: not any more.
  void CutPowerAfter(const std::string& prefix, int calls);
  // Called after each power cut with the prefix.
  std::function<void(const std::string& prefix)> on_cut;

  // None of these files is open (or all were cut).
  void Wipe(const std::string& prefix);
  using Image = std::map<std::string, std::string>;  // What each file would hold after a power cut, by path.
  Image Save(const std::string& prefix) const;
  void Restore(const std::string& prefix, const Image& image);
  // Its files together become at most so much longer than they are now; none: as long as they like.
  void SetRoom(const std::string& prefix, std::optional<std::uint64_t> bytes);
  void SetFailing(const std::string& prefix, bool is_failing);
  bool IsInTrouble(const std::string& prefix) const;

  // Some bytes of the largest file become others.
  void Damage(const std::string& prefix);

  std::uint64_t bytes(const std::string& prefix) const;
  std::uint64_t syncs() const { return sync_count_; }

 private:
  friend struct DiskCalls;  // What SQLite calls.
  struct File;
  struct Vfs;

  std::shared_ptr<File> Find(const std::string& path) const;
  bool IsFailing(const std::string& path) const;
  // How many more bytes the files of its disk may have; none: as many as they like.
  std::optional<std::uint64_t> RoomFor(const std::string& path) const;
  void CountCall(const std::string& path);

  std::string name_;
  std::mt19937_64 rng_;
  std::map<std::string, std::shared_ptr<File>> files_;
  std::map<std::string, int> calls_left_;           // Until the power is cut, by prefix; 0: it is not.
  std::map<std::string, std::uint64_t> bytes_max_;  // Of full disks, by prefix.
  std::set<std::string> failing_;                   // Prefixes.
  std::uint64_t sync_count_ = 0;
  std::unique_ptr<Vfs> vfs_;
};

}  // namespace moondb::simulation
