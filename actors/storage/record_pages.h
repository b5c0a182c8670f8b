// ReadPage: reads the records of all tables page by page in the order of storing, by merging the tables' rows.
#pragma once

#include <functional>
#include <vector>

#include "actors/storage/record_tables.h"
#include "actors/storage/sqlite_database.h"
#include "proto/storage.pb.h"

namespace moondb {

// Limits of one page: the default, used if the request has 0, and the maximum.
inline constexpr std::uint32_t kPageBytesDefault = 4 * 1024 * 1024;
inline constexpr std::uint32_t kPageBytesMax = 32 * 1024 * 1024;
inline constexpr std::uint32_t kPageRecordsDefault = 1000;
inline constexpr std::uint32_t kPageRecordsMax = 10'000;

// Returns the timestamps that the request selects.
TimestampRange TimesOf(const proto::ReadRequest& request);

// Returns a page with at least one record, even if that record exceeds the byte limit. The page is empty if there are
// no further records. Fails as Database does.
Result<proto::ReadReply> ReadPage(Database& database, const proto::ReadRequest& request);

// Merges the rows of `queries` into one page. Skips rows for which `accepts` returns false. Requires: each query
// returns the same columns, in the same order of rows, as RecordTable::ReadAfter, or as ReadNewestFirst if the request
// has is_newest_first.
Result<proto::ReadReply> ReadMerged(std::vector<Query> queries, const proto::ReadRequest& request,
                                    const std::function<bool(const Query&)>& accepts = nullptr);

}  // namespace moondb
