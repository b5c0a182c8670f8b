// Stores the bundles for a ground station (actors/sharing/downlink_actor.h) until the station acknowledges them. Also
// remembers which records the acknowledged bundles held.
//
// Each function that writes is one transaction that survives a power cut. All functions fail as Database does, or with
// the errors named below.
#pragma once

#include <cstddef>
#include <cstdint>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/downlink.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::size_t kBundlePartBytesMax = 128 * 1024;  // Maximum bytes of a bundle's file per ReadBundleReply.

// Saves a new bundle. Fails with kInvalid if a bundle with this number or a higher number was saved before.
Result<void> SaveBundle(Database& database, const proto::SaveBundleRequest& request);
Result<proto::LoadBundlesReply> LoadBundles(Database& database);
// Returns a part of a bundle's file, starting at `first_byte`. The part is empty if `first_byte` is at or behind the
// end of the file. Fails with kNotFound if the bundle does not exist, or if its file was deleted because the bundle was
// acknowledged.
Result<proto::ReadBundleReply> ReadBundlePart(Database& database, const proto::ReadBundleRequest& request);
// Marks the bundle as acknowledged and deletes its file. `own` is this agent's have-set. Idempotent. Fails with
// kNotFound if the bundle does not exist.
Result<void> AcknowledgeBundle(Database& database, std::uint32_t number, const HaveSet& own);

}  // namespace moondb
