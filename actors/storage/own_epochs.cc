#include "actors/storage/own_epochs.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>

#include "model/record_key.h"

namespace moondb {

namespace {

constexpr int kCounterShift = 48;
constexpr int kTagShift = 34;
constexpr int kBaseTagShift = 20;
constexpr std::uint64_t kRandomMask = (1ull << kBaseTagShift) - 1;
constexpr std::uint64_t kNoFork = std::numeric_limits<std::uint64_t>::max();

// A changed byte of the table shows, as in have_interval.
std::uint64_t HashOf(std::uint64_t epoch) { return HashRecord({{0, epoch, 0}, 0}, "begun"); }

bool HasCounterAndTag(const std::set<std::uint64_t>& epochs, std::uint64_t counter, std::uint32_t tag) {
  const auto found = epochs.lower_bound(EpochOf({counter, tag, 0}, 0));
  return found != epochs.end() && PartsOf(*found).counter == counter && PartsOf(*found).tag == tag;
}

}  // namespace

const char* const kForgetIncarnationSql = "DELETE FROM meta WHERE name = 'incarnation'";

EpochParts PartsOf(std::uint64_t epoch) {
  return {epoch >> kCounterShift, static_cast<std::uint32_t>(epoch >> kTagShift) & kEpochTagMax,
          static_cast<std::uint32_t>(epoch >> kBaseTagShift) & kEpochTagMax};
}

std::uint64_t EpochOf(const EpochParts& parts, std::uint64_t random) {
  return parts.counter << kCounterShift | static_cast<std::uint64_t>(parts.tag) << kTagShift |
         static_cast<std::uint64_t>(parts.base_tag) << kBaseTagShift | (random & kRandomMask);
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
  return epoch != 0 && (epoch <= highest() || epoch - highest() <= kOwnEpochJumpMax);
}

void OwnEpochs::Learn(std::uint64_t epoch) {
  if (begun_.contains(epoch)) return;
  foreign_.insert(epoch);
  if (foreign_.size() > kForeignEpochsMax) foreign_.erase(foreign_.begin());
}

std::uint64_t OwnEpochs::KnewByBase(std::uint64_t base_counter, std::uint64_t fork) const {
  if (base_counter < fork) return base_counter;
  // Of two copies of this file that went on, either may have begun the base.
  const bool is_ours = HasCounterAndTag(begun_, base_counter, tag_) && !HasCounterAndTag(foreign_, base_counter, tag_);
  return is_ours ? base_counter : fork - 1;
}

std::vector<std::pair<std::uint64_t, std::uint64_t>> OwnEpochs::WhatForeignKnew() const {
  std::uint64_t fork = kNoFork;
  for (const std::uint64_t epoch : foreign_) {
    if (PartsOf(epoch).tag == tag_) fork = std::min(fork, PartsOf(epoch).counter);
  }
  std::vector<std::pair<std::uint64_t, std::uint64_t>> knew;
  std::map<std::uint32_t, std::uint64_t> by_tag;  // Of foreign epochs whose counters are lower.
  std::size_t noted = 0;                          // So many of `knew` are in by_tag.
  for (const std::uint64_t epoch : foreign_) {
    const EpochParts parts = PartsOf(epoch);
    for (; noted < knew.size() && PartsOf(knew[noted].first).counter < parts.counter; ++noted) {
      std::uint64_t& most = by_tag[PartsOf(knew[noted].first).tag];
      most = std::max(most, knew[noted].second);
    }
    std::uint64_t most = 0;
    if (parts.tag == tag_) {
      most = fork - (fork > 0 ? 1 : 0);
    } else if (by_tag.contains(parts.tag)) {
      most = by_tag[parts.tag];
    }
    if (parts.base_tag == tag_ && parts.tag != tag_ && parts.counter > 0) {
      most = std::max(most, KnewByBase(parts.counter - 1, fork));
    } else if (parts.base_tag != tag_ && by_tag.contains(parts.base_tag)) {
      most = std::max(most, by_tag[parts.base_tag]);
    }
    knew.emplace_back(epoch, most);
  }
  return knew;
}

std::set<std::uint64_t> OwnEpochs::Endangered() const {
  std::set<std::uint64_t> endangered;
  if (tag_ == 0 || foreign_.empty()) return endangered;
  const auto knew = WhatForeignKnew();
  // From the highest down: what the one that knew least of those above knew.
  auto above = knew.rbegin();
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  for (auto own = begun_.rbegin(); own != begun_.rend(); ++own) {
    for (; above != knew.rend() && above->first > *own; ++above) least = std::min(least, above->second);
    const EpochParts parts = PartsOf(*own);
    if (parts.tag == tag_ && least < parts.counter) endangered.insert(*own);
  }
  return endangered;
}

// None that is known belongs to another incarnation for certain.
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
    return Next{EpochOf({PartsOf(base).counter + 1, tag, PartsOf(base).tag}, random()), tag};
  }
  // The counter is used up: go on above the highest epoch, by random steps, which no tags fit.
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

void OwnEpochs::NoteBegun(const Next& begun) {
  tag_ = begun.tag;
  begun_.insert(begun.epoch);
}

}  // namespace moondb
