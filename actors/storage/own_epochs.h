// OwnEpochs: which epochs of this agent's own records are known, which of them this file's history began, and whose
// states a later epoch cannot have known (docs/decisions/0010-what-an-epoch-knew.md).
//
// An epoch's 64 bits say where it comes from:
//   16 bits  counter: one above the counter of its *base*, the highest own epoch known when it was begun
//   10 bits  tag of the incarnation that began it
//    8 bits  of the mark of its base; 0: there was none
//   14 bits  mark of the epoch that its file's history had begun before it; 0: it had begun none
//   16 bits  at random, so that two copies of one file that go on separately use no name twice
// A *mark* is a hash of all bits of an epoch. An *incarnation* is one history of a database file. Its tag is drawn with
// its first epoch: in a file that was created empty, and in a copy that `moonctl db backup` made, which takes the tag
// out of it (kForgetIncarnationSql).
//
// An epoch that is claimed or comes home and that this file's history did not begin is *foreign*: another disk of this
// agent began it, or an unmarked copy of this very file. It knew its base, the one before it in its file, and what
// these knew. Where the one before it is not known here, the highest lower one of its tag stands for it.
//
// Plain values but for Load and the two functions that write, which act inside the caller's transaction and fail as
// Database does.
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
// 0 for epoch 0, which is none.
std::uint32_t MarkOf(std::uint64_t epoch);
std::uint32_t BaseMarkOf(std::uint64_t base);
// For tests: `random` is taken as far as its bits go.
std::uint64_t EpochOf(const EpochParts& parts, std::uint64_t random);

inline constexpr std::uint32_t kEpochTagMax = 0x3FF;
inline constexpr std::uint64_t kEpochCounterMax = 0xFFFF;
// 16384 lives of this agent that a lost disk knew of; who claims more would use up the epochs that are left.
inline constexpr std::uint64_t kOwnEpochJumpMax = 1ull << (48 + 14);
// The highest ones are kept, so that no peer fills the memory with claims.
inline constexpr std::size_t kForeignEpochsMax = 4096;

class OwnEpochs {
 public:
  // What the file's history began. What is foreign is Learn's to say.
  Result<void> Load(Database& database);

  // True if this incarnation has begun an epoch; false for a restored copy, and for a new file to which peers brought
  // this agent's records.
  bool has_incarnation() const { return tag_ != 0; }
  std::uint64_t highest() const;  // Of all that are known; 0: none is.
  // The process starts here, with all that its file knows: what is claimed from now on is held against it.
  void NoteStart() { highest_at_start_ = highest(); }
  // Whether one that somebody claims can be: at most kOwnEpochJumpMax above the highest as the process started, however
  // many were claimed since, and not 0.
  bool IsPossible(std::uint64_t epoch) const;
  bool IsKnown(std::uint64_t epoch) const { return begun_.contains(epoch) || foreign_.contains(epoch); }
  void Learn(std::uint64_t epoch);  // Nothing where this file's history began it.

  // Epochs of this incarnation that the highest foreign one is above and did not know: their states would give way to
  // older ones. What a lower foreign one did not know, the highest one's disk has stored once more, or has later states
  // of.
  struct Danger {
    std::set<std::uint64_t> certain;
    std::set<std::uint64_t> possible;  // What it was begun upon is not known here well enough to tell.
  };
  Danger Endangered() const;

  // One above all that are known, to be written and, once that is committed, to be noted.
  struct Next {
    std::uint64_t epoch = 0;
    std::uint32_t tag = 0;  // This incarnation's, from now on.
  };
  // kInternal: none are left.
  Result<Next> Draw(std::mt19937_64& random) const;
  Result<void> Write(Database& database, const Next& begun) const;
  void NoteBegun(const Next& begun);

 private:
  std::uint32_t DrawTag(std::mt19937_64& random) const;

  std::uint32_t tag_ = 0;  // 0: not drawn yet.
  std::set<std::uint64_t> begun_;
  std::set<std::uint64_t> foreign_;
  std::uint64_t highest_at_start_ = 0;
};

// Of a copy that is not the agent's store: who opens it as one is a new incarnation. Nothing where `database` has no
// tables of moondb's.
extern const char* const kForgetIncarnationSql;

}  // namespace moondb
