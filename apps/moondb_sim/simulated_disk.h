// SimulatedDisk: an in-memory file system for SQLite that loses unsynced writes when the power is cut.
//
// A power cut keeps none, the first few, or a random subset of the unsynced writes; the last write may be torn.
// Afterwards all calls on files that were open fail, so a process that is being destroyed changes nothing. Files opened
// later work. All files of one agent share a path prefix, which the functions take as `prefix`.
//
// Registers itself with SQLite as the VFS name(). Open databases with locking_mode=EXCLUSIVE, because there is no
// shared memory. Close them before the disk is destroyed. Single-threaded. Equal seeds and calls give equal results.
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
  // Cuts the power after `calls` more writes or syncs, even in the middle of a transaction. `calls` 0 cancels a cut
  // that has not happened yet.
  void CutPowerAfter(const std::string& prefix, int calls);
  // Called with the prefix after each power cut.
  std::function<void(const std::string& prefix)> on_cut;

  // Wipe, Save and Restore require: no file with the prefix is open, except by handles that a power cut made invalid.
  void Wipe(const std::string& prefix);
  using Image = std::map<std::string, std::string>;  // Synced content of each file, by path.
  Image Save(const std::string& prefix) const;
  void Restore(const std::string& prefix, const Image& image);
  // Lets all files with the prefix together grow by at most `bytes` more. Null removes the limit.
  void SetRoom(const std::string& prefix, std::optional<std::uint64_t> bytes);
  void SetFailing(const std::string& prefix, bool is_failing);
  bool IsInTrouble(const std::string& prefix) const;

  // Overwrites up to 64 random bytes of the largest file with the prefix.
  void Damage(const std::string& prefix);

  std::uint64_t bytes(const std::string& prefix) const;
  std::uint64_t syncs() const { return sync_count_; }

 private:
  friend struct DiskCalls;  // Functions that SQLite calls.
  struct File;
  struct Vfs;

  std::shared_ptr<File> Find(const std::string& path) const;
  bool IsFailing(const std::string& path) const;
  // Returns by how many bytes the files on the disk of `path` may still grow; null if there is no limit.
  std::optional<std::uint64_t> RoomFor(const std::string& path) const;
  void CountCall(const std::string& path);

  std::string name_;
  std::mt19937_64 rng_;
  std::map<std::string, std::shared_ptr<File>> files_;
  std::map<std::string, int> calls_left_;           // Writes and syncs until the power is cut, by prefix; 0: never.
  std::map<std::string, std::uint64_t> bytes_max_;  // Limits of the total size of all files, by prefix.
  std::set<std::string> failing_;                   // Prefixes of failing disks.
  std::uint64_t sync_count_ = 0;
  std::unique_ptr<Vfs> vfs_;
};

}  // namespace moondb::simulation
