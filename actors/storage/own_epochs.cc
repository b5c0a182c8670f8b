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
constexpr int kBaseMarkShift = 20;
constexpr std::uint64_t kRandomMask = (1ull << kBaseMarkShift) - 1;
constexpr std::uint32_t kBaseMarkMax = 0x3FFF;

// A changed byte of the table shows, as in have_interval.
std::uint64_t HashOf(std::uint64_t epoch) { return HashRecord({{0, epoch, 0}, 0}, "begun"); }

}  // namespace

const char* const kForgetIncarnationSql = "DELETE FROM meta WHERE name = 'incarnation'";

EpochParts PartsOf(std::uint64_t epoch) {
  return {epoch >> kCounterShift, static_cast<std::uint32_t>(epoch >> kTagShift) & kEpochTagMax,
          static_cast<std::uint32_t>(epoch >> kBaseMarkShift) & kBaseMarkMax};
}

std::uint32_t MarkOf(std::uint64_t base) {
  if (base == 0) return 0;
  return 1 + static_cast<std::uint32_t>(HashRecord({{0, base, 0}, 0}, "base") % kBaseMarkMax);
}

std::uint64_t EpochOf(const EpochParts& parts, std::uint64_t random) {
  return parts.counter << kCounterShift | static_cast<std::uint64_t>(parts.tag) << kTagShift |
         static_cast<std::uint64_t>(parts.base_mark) << kBaseMarkShift | (random & kRandomMask);
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

std::vector<std::pair<std::uint64_t, std::uint64_t>> OwnEpochs::WhatForeignKnew() const {
  struct Base {
    std::uint32_t tag = 0;
    std::uint64_t knew = 0;
  };
  std::map<std::pair<std::uint64_t, std::uint32_t>, Base> bases;  // By counter and mark.
  const auto add_base = [&bases](std::uint64_t epoch, std::uint64_t knew) {
    bases.insert_or_assign({PartsOf(epoch).counter, MarkOf(epoch)}, Base{PartsOf(epoch).tag, knew});
  };
  std::vector<std::pair<std::uint64_t, std::uint64_t>> knew;
  std::map<std::uint32_t, std::uint64_t> knew_by_tag;  // Of foreign epochs whose counters are lower.
  std::size_t noted = 0;                               // So many of `knew` are in knew_by_tag.
  for (const std::uint64_t epoch : begun_) add_base(epoch, PartsOf(epoch).tag == tag_ ? PartsOf(epoch).counter : 0);
  for (const std::uint64_t epoch : foreign_) {
    const EpochParts parts = PartsOf(epoch);
    for (; noted < knew.size() && PartsOf(knew[noted].first).counter < parts.counter; ++noted) {
      knew_by_tag[PartsOf(knew[noted].first).tag] = knew[noted].second;
    }
    const auto earlier = knew_by_tag.find(parts.tag);
    // An unmarked copy of which this is the first known epoch is taken to have parted from this file right before it.
    const std::uint64_t at_parting = parts.tag == tag_ && parts.counter > 1 ? parts.counter - 2 : 0;
    const std::uint64_t by_file = earlier != knew_by_tag.end() ? earlier->second : at_parting;
    const auto base = bases.find({parts.counter - 1, parts.base_mark});
    std::uint64_t most = by_file;
    if (base != bases.end() && base->second.tag == parts.tag) {
      most = base->second.knew;
    } else if (base != bases.end()) {
      most = std::max(by_file, base->second.knew);
    }
    add_base(epoch, most);
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
    return Next{EpochOf({PartsOf(base).counter + 1, tag, MarkOf(base)}, random()), tag};
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
