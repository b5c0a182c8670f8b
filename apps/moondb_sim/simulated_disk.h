// SimulatedDisk: an in-memory file system for SQLite that loses unsynced writes when the power is cut.
//
// At a power cut, unsynced writes are lost, or some of them remain: a prefix, or any subset, the last write perhaps
// torn. Afterwards every call on a file that was open fails, so a process that is being destroyed changes nothing any
// more. Files that are opened later work. All files of one agent share a path prefix, which the functions below take.
//
// Registers itself with SQLite as the VFS name(). Databases are opened with this VFS in locking_mode=EXCLUSIVE, since
// there is no shared memory. They must be closed before the disk is destroyed. Single-threaded. Equal seeds and calls
// give equal results.
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
  // Cuts the power after `calls` more writes or syncs, which may be in the middle of a transaction. 0 cancels a cut
  // that has not happened yet.
  void CutPowerAfter(const std::string& prefix, int calls);
  // Called with the prefix after each power cut.
  std::function<void(const std::string& prefix)> on_cut;

  // Wipe, Save and Restore require: no file with the prefix is open, except by handles from before a power cut.
  void Wipe(const std::string& prefix);
  using Image = std::map<std::string, std::string>;  // Content of each file after a power cut, by path.
  Image Save(const std::string& prefix) const;
  void Restore(const std::string& prefix, const Image& image);
  // Limits by how many bytes all files with the prefix together may still grow. Null removes the limit.
  void SetRoom(const std::string& prefix, std::optional<std::uint64_t> bytes);
  void SetFailing(const std::string& prefix, bool is_failing);
  bool IsInTrouble(const std::string& prefix) const;

  // Overwrites some bytes of the largest file with the prefix.
  void Damage(const std::string& prefix);

  std::uint64_t bytes(const std::string& prefix) const;
  std::uint64_t syncs() const { return sync_count_; }

 private:
  friend struct DiskCalls;  // Functions that SQLite calls.
  struct File;
  struct Vfs;

  std::shared_ptr<File> Find(const std::string& path) const;
  bool IsFailing(const std::string& path) const;
  // Returns by how many bytes the files on the disk of `path` may still grow. Null if unlimited.
  std::optional<std::uint64_t> RoomFor(const std::string& path) const;
  void CountCall(const std::string& path);

  std::string name_;
  std::mt19937_64 rng_;
  std::map<std::string, std::shared_ptr<File>> files_;
  std::map<std::string, int> calls_left_;           // Writes and syncs until the power is cut, by prefix; 0: never.
  std::map<std::string, std::uint64_t> bytes_max_;  // Size limits of full disks, by prefix.
  std::set<std::string> failing_;                   // Prefixes of failing disks.
  std::uint64_t sync_count_ = 0;
  std::unique_ptr<Vfs> vfs_;
};

}  // namespace moondb::simulation
