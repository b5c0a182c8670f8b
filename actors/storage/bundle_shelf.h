// The bundles for the ground that wait for its acknowledgment, and what was in those that it has
// (actors/sharing/downlink_actor.h).
//
// Each call that writes is one transaction that survives a power cut. Errors as Database's, and those named.
#pragma once

#include <cstddef>
#include <cstdint>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/downlink.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::size_t kBundlePartBytesMax = 128 * 1024;  // Of a ReadBundleReply.

// kInvalid for a number that was given before.
Result<void> SaveBundle(Database& database, const proto::SaveBundleRequest& request);
Result<proto::LoadBundlesReply> LoadBundles(Database& database);
// From first_byte on; nothing behind the end. kNotFound: no such bundle, or acknowledged: its file is gone.
Result<proto::ReadBundleReply> ReadBundlePart(Database& database, const proto::ReadBundleRequest& request);
// `own`: this agent's have-set. Again: nothing changes. kNotFound: no such bundle.
Result<void> AcknowledgeBundle(Database& database, std::uint32_t number, const HaveSet& own);

}  // namespace moondb
