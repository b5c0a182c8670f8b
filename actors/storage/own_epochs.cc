#include "actors/storage/own_epochs.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <optional>

#include "model/record_hash.h"
#include "model/record_key.h"

namespace moondb {

namespace {

constexpr int kCounterShift = 48;
constexpr int kTagShift = 38;
constexpr int kBaseMarkShift = 30;
constexpr int kPreviousMarkShift = 16;
constexpr std::uint64_t kRandomMask = (1ull << kPreviousMarkShift) - 1;
constexpr std::uint32_t kBaseMarkMax = 0xFF;
constexpr std::uint32_t kMarkMax = 0x3FFF;

// Returns a hash that is stored with the epoch, to detect a changed byte in the table own_epoch.
std::uint64_t HashOf(std::uint64_t epoch) { return HashRecord({{0, epoch, 0}, 0}, "begun"); }

// The epochs of this incarnation that another epoch knew. The other epoch certainly knew all epochs with counters up to
// `certain`, and possibly all epochs with counters up to `possible`.
struct Knowledge {
  std::uint64_t certain = 0;
  std::uint64_t possible = 0;
};

// Computes the Knowledge of each epoch. Requires: epochs are added in rising order.
class Ancestry {
 public:
  explicit Ancestry(std::uint32_t own_tag) : own_tag_(own_tag) {}

  void AddBegun(std::uint64_t epoch) {
    const EpochParts parts = PartsOf(epoch);
    const std::uint64_t own = parts.tag == own_tag_ ? parts.counter : 0;
    Add(epoch, {own, own});
  }

  Knowledge AddForeign(std::uint64_t epoch) {
    const EpochParts parts = PartsOf(epoch);
    const Knowledge knew = KnowledgeOf(parts);
    Add(epoch, knew);
    foreign_by_tag_[parts.tag] = {parts.counter, knew};
    return knew;
  }

 private:
  struct Known {
    std::uint64_t counter = 0;
    Knowledge knew;
  };
  using Found = std::optional<Knowledge>;

  void Add(std::uint64_t epoch, const Knowledge& knew) {
    const EpochParts parts = PartsOf(epoch);
    const Known known{parts.counter, knew};
    by_base_mark_[{parts.counter, BaseMarkOf(epoch)}].push_back(known);
    by_mark_[{parts.tag, MarkOf(epoch)}].push_back(known);
    by_mark_of_any_tag_[MarkOf(epoch)].push_back(known);
  }

  Knowledge KnowledgeOf(const EpochParts& parts) const {
    const Found base = Find(by_base_mark_, std::pair(parts.counter - 1, parts.base_mark), parts.counter);
    const Found previous = PreviousOf(parts);
    const bool is_copy = parts.previous_mark != 0 && parts.tag == own_tag_;
    Knowledge knew;
    for (const Found& parent : {base, previous}) {
      if (!parent) continue;
      knew.certain = std::max(knew.certain, parent->certain);
      knew.possible = std::max(knew.possible, parent->possible);
    }
    if (is_copy && !previous) {
      // No earlier epoch of this copy is known. Assume that the copy diverged from this file right before this epoch.
      const std::uint64_t before = std::max<std::uint64_t>(parts.counter, 2) - 2;
      return {std::max(knew.certain, before), std::max(knew.possible, before)};
    }
    if (!base && !previous && parts.base_mark != 0) knew.possible = kEpochCounterMax;
    return knew;
  }

  Found PreviousOf(const EpochParts& parts) const {
    if (parts.previous_mark == 0) return std::nullopt;
    Found previous = Find(by_mark_, std::pair(parts.tag, parts.previous_mark), parts.counter);
    // The first epoch of a restored backup follows an epoch with another tag.
    if (!previous) previous = Find(by_mark_of_any_tag_, parts.previous_mark, parts.counter);
    if (previous) return previous;
    const auto latest = foreign_by_tag_.find(parts.tag);
    if (latest == foreign_by_tag_.end() || latest->second.counter >= parts.counter) return std::nullopt;
    return latest->second.knew;
  }

  // Returns the Knowledge of the epoch with this `key` and a counter below `counter`; null if there is none. Marks are
  // hashes, so several epochs may have the key. Only the epochs that all of them knew are certainly known.
  template <typename Key>
  static Found Find(const std::map<Key, std::vector<Known>>& known, const Key& key, std::uint64_t counter) {
    Found knew;
    const auto found = known.find(key);
    if (found == known.end()) return knew;
    for (const Known& candidate : found->second) {
      if (candidate.counter >= counter) continue;
      if (!knew) knew = candidate.knew;
      knew->certain = std::min(knew->certain, candidate.knew.certain);
      knew->possible = std::max(knew->possible, candidate.knew.possible);
    }
    return knew;
  }

  const std::uint32_t own_tag_;
  std::map<std::pair<std::uint64_t, std::uint32_t>, std::vector<Known>> by_base_mark_;  // Key: counter, base mark.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<Known>> by_mark_;       // Key: tag, mark.
  std::map<std::uint32_t, std::vector<Known>> by_mark_of_any_tag_;
  std::map<std::uint32_t, Known> foreign_by_tag_;  // The highest foreign epoch of each tag.
};

}  // namespace

const char* const kForgetIncarnationSql = "DELETE FROM meta WHERE name = 'incarnation'";

EpochParts PartsOf(std::uint64_t epoch) {
  return {epoch >> kCounterShift, static_cast<std::uint32_t>(epoch >> kTagShift) & kEpochTagMax,
          static_cast<std::uint32_t>(epoch >> kBaseMarkShift) & kBaseMarkMax,
          static_cast<std::uint32_t>(epoch >> kPreviousMarkShift) & kMarkMax};
}

std::uint32_t MarkOf(std::uint64_t epoch) {
  if (epoch == 0) return 0;
  return 1 + static_cast<std::uint32_t>(HashRecord({{0, epoch, 0}, 0}, "mark") % kMarkMax);
}

std::uint32_t BaseMarkOf(std::uint64_t base) { return base == 0 ? 0 : 1 + MarkOf(base) % kBaseMarkMax; }

std::uint64_t EpochOf(const EpochParts& parts, std::uint64_t random) {
  return parts.counter << kCounterShift | static_cast<std::uint64_t>(parts.tag) << kTagShift |
         static_cast<std::uint64_t>(parts.base_mark) << kBaseMarkShift |
         static_cast<std::uint64_t>(parts.previous_mark) << kPreviousMarkShift | (random & kRandomMask);
}

Result<void> OwnEpochs::Load(Database& database) {
  begun_.clear();
  foreign_.clear();
  tag_ = 0;
  const Result<std::int64_t> tag = database.Number("SELECT value FROM meta WHERE name = 'incarnation'");
  if (!tag && tag.error().code != ErrorCode::kNotFound) return tl::unexpected(tag.error());
  if (tag && *tag >= 1 && *tag <= kEpochTagMax) tag_ = static_cast<std::uint32_t>(*tag);
  Query query = database.Prepare("SELECT epoch, hash FROM own_epoch");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return {};
    if (query.Unsigned(1) == HashOf(query.Unsigned(0))) begun_.insert(query.Unsigned(0));
  }
}

std::uint64_t OwnEpochs::highest() const {
  const std::uint64_t begun = begun_.empty() ? 0 : *begun_.rbegin();
  return foreign_.empty() ? begun : std::max(begun, *foreign_.rbegin());
}

bool OwnEpochs::IsPossible(std::uint64_t epoch) const {
  return epoch != 0 && (epoch <= highest_at_start_ || epoch - highest_at_start_ <= kOwnEpochJumpMax);
}

void OwnEpochs::Learn(std::uint64_t epoch) {
  if (begun_.contains(epoch)) return;
  has_learned_ |= foreign_.insert(epoch).second;
  if (foreign_.size() > kForeignEpochsMax) foreign_.erase(foreign_.begin());
}

OwnEpochs::Danger OwnEpochs::Endangered() const {
  Danger danger;
  if (tag_ == 0 || foreign_.empty()) return danger;
  const std::uint64_t highest_foreign = *foreign_.rbegin();
  Ancestry ancestry(tag_);
  Knowledge knew;
  std::vector<std::uint64_t> rising;
  std::merge(begun_.begin(), begun_.end(), foreign_.begin(), foreign_.end(), std::back_inserter(rising));
  for (const std::uint64_t epoch : rising) {
    if (begun_.contains(epoch)) {
      ancestry.AddBegun(epoch);
    } else {
      knew = ancestry.AddForeign(epoch);
    }
  }
  for (const std::uint64_t own : begun_) {
    const EpochParts parts = PartsOf(own);
    if (parts.tag != tag_ || own > highest_foreign || parts.counter <= knew.certain) continue;
    (parts.counter > knew.possible ? danger.certain : danger.possible).insert(own);
  }
  return danger;
}

// Draws a tag that no known epoch has. If half of all tags are taken, the drawn tag may be taken too.
std::uint32_t OwnEpochs::DrawTag(std::mt19937_64& random) const {
  std::set<std::uint32_t> taken;
  for (const std::uint64_t epoch : begun_) taken.insert(PartsOf(epoch).tag);
  for (const std::uint64_t epoch : foreign_) taken.insert(PartsOf(epoch).tag);
  std::uint32_t tag = 0;
  while (tag == 0 || (taken.contains(tag) && taken.size() < kEpochTagMax / 2)) {
    tag = static_cast<std::uint32_t>(random() >> kTagShift) & kEpochTagMax;
  }
  return tag;
}

Result<OwnEpochs::Next> OwnEpochs::Draw(std::mt19937_64& random) const {
  const std::uint32_t tag = tag_ != 0 ? tag_ : DrawTag(random);
  const std::uint64_t base = highest();
  if (PartsOf(base).counter < kEpochCounterMax) {
    const std::uint64_t previous = begun_.empty() ? 0 : *begun_.rbegin();
    return Next{EpochOf({PartsOf(base).counter + 1, tag, BaseMarkOf(base), MarkOf(previous)}, random()), tag};
  }
  // The counter is used up. Continue above the highest epoch in random steps. The bits of such an epoch no longer
  // contain a valid tag.
  const std::uint64_t left = std::numeric_limits<std::uint64_t>::max() - base;
  if (left == 0) return Fail(ErrorCode::kInternal, "no epochs are left for this agent's records");
  return Next{base + 1 + random() % std::min<std::uint64_t>(left, 0xFFFF'FFFF), tag};
}

Result<void> OwnEpochs::Write(Database& database, const Next& begun) const {
  if (begun.tag != tag_) {
    Query query = database.Prepare("INSERT OR REPLACE INTO meta VALUES('incarnation', ?)");
    query << begun.tag;
    if (const Result<void> done = query.Run(); !done) return done;
  }
  Query query = database.Prepare("INSERT OR REPLACE INTO own_epoch VALUES(?, ?)");
  query << begun.epoch << HashOf(begun.epoch);
  return query.Run();
}

void OwnEpochs::ObserveBegun(const Next& begun) {
  tag_ = begun.tag;
  begun_.insert(begun.epoch);
}

}  // namespace moondb
