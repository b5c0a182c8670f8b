// OwnEpochs keeps the known epochs of this agent's own records: epochs that were begun in the history of this agent's
// present database file, and *foreign* epochs, which were begun elsewhere. It finds the epochs whose states (records
// under the policy `latest`) a higher foreign epoch cannot have known (docs/decisions/0010-epoch-reports.md).
//
// The 64 bits of an epoch identify its ancestry:
//   - 16 bits: counter, one above the counter of its *base*, which is the highest own epoch known when the epoch began;
//   - 10 bits: tag of the incarnation that began the epoch;
//   - 8 bits: derived from the mark of the base; 0 if there was no base;
//   - 14 bits: mark of the previous epoch in its file's history; 0 for the first epoch;
//   - 16 random bits, so that two diverging copies of one file do not use the same epoch twice.
// A *mark* is a hash of all bits of an epoch. An *incarnation* is one history of a database file; its tag is drawn with
// its first epoch. A file that was created empty starts a new incarnation. A copy made by `moonctl db backup` also
// starts a new incarnation, because the tag is removed from the copy (kForgetIncarnationSql).
//
// A *foreign* epoch is an epoch of this agent that a peer reports or returns and that this file's history did not
// begin. It began on another disk of this agent, or in a copy of this file that kept the tag. A foreign epoch knew the
// records of its base, of the previous epoch in its file, and of all epochs that these two epochs knew. If the previous
// epoch is not known here, the highest known epoch below the foreign epoch with the same tag is used instead.
//
// Load and Write run inside the caller's transaction and fail as Database does. The other functions use no database.
#pragma once

#include <cstdint>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "model/error.h"

namespace moondb {

struct EpochParts {
  std::uint64_t counter = 0;
  std::uint32_t tag = 0;
  std::uint32_t base_mark = 0;
  std::uint32_t previous_mark = 0;
  bool operator==(const EpochParts&) const = default;
};
EpochParts PartsOf(std::uint64_t epoch);
// Returns the mark of an epoch. Returns 0 for epoch 0, which is not valid.
std::uint32_t MarkOf(std::uint64_t epoch);
std::uint32_t BaseMarkOf(std::uint64_t base);
// For tests. Returns the epoch with these parts; the lowest 16 bits of `random` become its random bits.
std::uint64_t EpochOf(const EpochParts& parts, std::uint64_t random);

inline constexpr std::uint32_t kEpochTagMax = 0x3FF;
inline constexpr std::uint64_t kEpochCounterMax = 0xFFFF;
// A claimed epoch may exceed the highest epoch at the start of this process by at most this number. It equals 16384
// process starts on a lost disk. Without this limit, a false claim could use up all epochs.
inline constexpr std::uint64_t kOwnEpochJumpMax = 1ull << (48 + 14);
// Maximum number of foreign epochs in memory. Only the highest are kept, so claims of peers cannot fill the memory.
inline constexpr std::size_t kForeignEpochsMax = 4096;

class OwnEpochs {
 public:
  // Loads the epochs that the file's history began. Foreign epochs are not stored; Learn adds them.
  Result<void> Load(Database& database);

  // Returns true if this incarnation has begun an epoch. Returns false for a restored copy or a new file that has not
  // begun an epoch yet, even if peers have returned this agent's records.
  bool has_incarnation() const { return tag_ != 0; }
  std::uint64_t highest() const;  // The highest known epoch; 0 if none is known.
  // Call once, when all own epochs in this agent's database file are known. From then on, IsPossible compares epochs
  // that peers claim with the highest epoch known at this call.
  void ObserveStart() {
    highest_at_start_ = highest();
    has_learned_ = false;
  }
  // Returns true once, after a foreign epoch was added since the start: the disk was replaced or restored before it.
  bool TakeLearned() { return has_learned_ && !std::exchange(is_taken_, true); }
  // Returns whether an epoch that a peer claims can exist: it is not 0, and at most kOwnEpochJumpMax above the highest
  // epoch at the start of the process. Later claims do not raise this limit.
  bool IsPossible(std::uint64_t epoch) const;
  bool IsKnown(std::uint64_t epoch) const { return begun_.contains(epoch) || foreign_.contains(epoch); }
  void Learn(std::uint64_t epoch);  // Adds a foreign epoch. Does nothing if this file's history began the epoch.

  // Epochs of this incarnation that are in danger: the highest foreign epoch is above them but did not know them, so
  // older states stored under the foreign epoch would replace the states of these epochs. Only the highest foreign
  // epoch is checked, because the disk that began it has already reissued or replaced the states that lower foreign
  // epochs did not know.
  struct Danger {
    std::set<std::uint64_t> certain;
    // Epochs that may be in danger. Too little is known about the base of the foreign epoch to decide.
    std::set<std::uint64_t> possible;
  };
  Danger Endangered() const;

  // An epoch above all known epochs. The caller passes it to Write and, after the commit, to ObserveBegun.
  struct Next {
    std::uint64_t epoch = 0;
    std::uint32_t tag = 0;  // The tag of this incarnation; drawn now if the incarnation had none.
  };
  // Returns the epoch that this agent can begin next. Fails with kInternal if no epochs are left.
  Result<Next> Draw(std::mt19937_64& random) const;
  Result<void> Write(Database& database, const Next& begun) const;
  void ObserveBegun(const Next& begun);

 private:
  std::uint32_t DrawTag(std::mt19937_64& random) const;

  std::uint32_t tag_ = 0;  // Tag of this incarnation; 0 until drawn.
  std::set<std::uint64_t> begun_;
  std::set<std::uint64_t> foreign_;
  std::uint64_t highest_at_start_ = 0;
  bool has_learned_ = false;
  bool is_taken_ = false;
};

// SQL that removes the incarnation from a copy of a store. An agent that opens the copy as its store then starts a new
// incarnation. Fails in a file that is not a store.
extern const char* const kForgetIncarnationSql;

}  // namespace moondb
