// Stores the bundles for a ground station until it acknowledges them, and which records the acknowledged bundles held
// (actors/sharing/downlink_actor.h).
//
// Each function that writes is one transaction that survives a power cut. Errors: those of Database, and those named
// below.
#pragma once

#include <cstddef>
#include <cstdint>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/downlink.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::size_t kBundlePartBytesMax = 128 * 1024;  // Bytes of one ReadBundleReply.

// kInvalid if a bundle with this number or a higher one was saved before.
Result<void> SaveBundle(Database& database, const proto::SaveBundleRequest& request);
Result<proto::LoadBundlesReply> LoadBundles(Database& database);
// Reads from `first_byte` on; returns no bytes beyond the end. kNotFound if the bundle does not exist, or was
// acknowledged and its file deleted.
Result<proto::ReadBundleReply> ReadBundlePart(Database& database, const proto::ReadBundleRequest& request);
// `own` is this agent's have-set. Idempotent. kNotFound if the bundle does not exist.
Result<void> AcknowledgeBundle(Database& database, std::uint32_t number, const HaveSet& own);

}  // namespace moondb
