#include "actors/storage/write_count.h"

#include <utility>

namespace moondb {

namespace {

void KeepLast(std::map<std::uint32_t, std::uint64_t>& days) {
  while (days.size() > kWrittenDaysKept) days.erase(days.begin());
}

}  // namespace

Result<void> WriteCount::Load(Database& database) {
  days_.clear();
  Query query = database.Prepare("SELECT day, bytes FROM written WHERE day BETWEEN 0 AND 4294967295");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) break;
    days_[static_cast<std::uint32_t>(query.Integer(0))] = query.Unsigned(1);
  }
  KeepLast(days_);
  return {};
}

Result<void> WriteCount::Save(Database& database, std::uint32_t day) {
  // Do nothing if nothing was written since the last save. Without this check, each save of an idle agent would cause
  // another save, because a save itself writes bytes.
  if (database.WrittenBytes() == seen_) return {};
  const std::uint64_t counted = database.WrittenBytes();
  std::map<std::uint32_t, std::uint64_t> days = Days(database, day);
  Result<Transaction> transaction = Transaction::Begin(database, Database::Durability::kNormal);
  if (!transaction) return tl::unexpected(transaction.error());
  Query store = database.Prepare("INSERT OR REPLACE INTO written VALUES(?, ?)");
  store << day << days[day];
  if (const Result<void> done = store.Run(); !done) return done;
  Query forget = database.Prepare("DELETE FROM written WHERE day < ? OR day > ?");
  forget << days.begin()->first << day;
  if (const Result<void> done = forget.Run(); !done) return done;
  if (const Result<void> done = transaction->Commit(); !done) return done;
  days_ = std::move(days);
  counted_ = counted;
  seen_ = database.WrittenBytes();
  return {};
}

std::map<std::uint32_t, std::uint64_t> WriteCount::Days(const Database& database, std::uint32_t day) const {
  std::map<std::uint32_t, std::uint64_t> days = days_;
  // Days after `day` come from a time when the clock was ahead.
  days.erase(days.upper_bound(day), days.end());
  days[day] += database.WrittenBytes() - counted_;
  KeepLast(days);
  return days;
}

}  // namespace moondb
