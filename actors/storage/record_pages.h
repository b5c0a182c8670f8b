// ReadPage: pages through all record tables in the order of storing, by merging their rows.
#pragma once

#include <functional>
#include <vector>

#include "actors/storage/sqlite_database.h"
#include "proto/storage.pb.h"

namespace moondb {

// Limits of one page; what a request leaves at 0 or sets higher becomes the first or the last of a pair.
inline constexpr std::uint32_t kPageBytesDefault = 4 * 1024 * 1024;
inline constexpr std::uint32_t kPageBytesMax = 32 * 1024 * 1024;
inline constexpr std::uint32_t kPageRecordsDefault = 1000;
inline constexpr std::uint32_t kPageRecordsMax = 10'000;

// At least one record, even a larger one. Fails as Database does.
Result<proto::ReadReply> ReadPage(Database& database, const proto::ReadRequest& request);

// The same of queries that each give rows as RecordTable::ReadAfter or ReadNewestFirst does; rows that `accepts`
// refuses are left out.
Result<proto::ReadReply> ReadMerged(std::vector<Query> queries, const proto::ReadRequest& request,
                                    const std::function<bool(const Query&)>& accepts = nullptr);

}  // namespace moondb
