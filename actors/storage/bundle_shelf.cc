#include "actors/storage/bundle_shelf.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>

#include "model/have_set.h"
#include "proto/downlink.pb.h"

namespace moondb {

namespace {

// Reads the have-set of a bundle from the current row. Returns an empty have-set if the row is damaged; the bundle's
// records are then sent again in a new bundle.
HaveSet HaveOf(const Query& query, int column) {
  proto::HaveSet parsed;
  const std::string_view bytes = query.Bytes(column);
  if (parsed.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    if (Result<HaveSet> have = FromProto(parsed)) return *std::move(have);
  }
  spdlog::error("storage: a record is damaged and excluded from the bundle for the ground station");
  return {};
}

proto::DownlinkBundle BundleOf(const Query& query) {
  proto::DownlinkBundle bundle;
  bundle.set_number(static_cast<std::uint32_t>(query.Integer(0)));
  bundle.set_made_ns(query.Integer(1));
  bundle.set_record_count(static_cast<double>(query.Integer(2)));
  bundle.set_bytes(static_cast<double>(query.Integer(3)));
  bundle.set_hash(query.Unsigned(4));
  return bundle;
}

Error NoSuchBundle(std::uint32_t number) {
  return {ErrorCode::kNotFound, "no bundle " + std::to_string(number), "number"};
}

// Returns the have-set of the records of all acknowledged bundles. It is stored in the row of the bundle that was
// acknowledged last.
Result<HaveSet> AcknowledgedHave(Database& database) {
  HaveSet have;
  Query query = database.Prepare("SELECT have FROM downlink_bundle WHERE file IS NULL AND length(have) > 0");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return have;
    have.Merge(HaveOf(query, 0));
  }
}

// Returns `have`, plus the seqs that `own` has dropped in the same streams. No later bundle can contain a dropped seq.
// With the gaps closed, the have-set needs few intervals.
HaveSet WithoutGaps(const HaveSet& have, const HaveSet& own) {
  HaveSet filled;
  for (const auto& [stream, state] : have.streams()) {
    filled[stream].dropped = state.Covered();
    filled[stream].dropped.Add(own.Get(stream).dropped);
  }
  return filled;
}

}  // namespace

Result<void> SaveBundle(Database& database, const proto::SaveBundleRequest& request) {
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  const proto::DownlinkBundle& bundle = request.bundle();
  const std::string have = request.have().SerializeAsString();
  {
    Query known = database.Prepare("SELECT 1 FROM downlink_bundle WHERE number >= ?");
    known << bundle.number();
    const Result<bool> row = known.Step();
    if (!row) return tl::unexpected(row.error());
    if (*row) return Fail(ErrorCode::kInvalid, "is the number of an earlier bundle", "bundle.number");
    Query insert = database.Prepare(
        "INSERT INTO downlink_bundle(number, made_ns, record_count, bytes, hash, have, file) VALUES(?, ?, ?, ?, ?, ?, "
        "?)");
    insert << bundle.number() << bundle.made_ns() << static_cast<std::int64_t>(bundle.record_count())
           << request.file().size() << bundle.hash() << Blob{have} << Blob{request.file()};
    if (const Result<void> done = insert.Run(); !done) return done;
  }
  return transaction->Commit();
}

Result<proto::LoadBundlesReply> LoadBundles(Database& database) {
  const Result<HaveSet> acknowledged = AcknowledgedHave(database);
  if (!acknowledged) return tl::unexpected(acknowledged.error());
  const Result<std::int64_t> last = database.Number("SELECT coalesce(max(number), 0) FROM downlink_bundle");
  if (!last) return tl::unexpected(last.error());
  proto::LoadBundlesReply reply;
  reply.set_last_number(static_cast<std::uint32_t>(*last));
  *reply.mutable_acknowledged() = ToProto(*acknowledged);
  HaveSet taken = *acknowledged;
  Query query = database.Prepare(
      "SELECT number, made_ns, record_count, bytes, hash, have FROM downlink_bundle WHERE file IS NOT NULL"
      " ORDER BY number");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) break;
    *reply.add_waiting() = BundleOf(query);
    taken.Merge(HaveOf(query, 5));
  }
  *reply.mutable_taken() = ToProto(taken);
  return reply;
}

Result<proto::ReadBundleReply> ReadBundlePart(Database& database, const proto::ReadBundleRequest& request) {
  Query query = database.Prepare(
      "SELECT number, made_ns, record_count, bytes, hash, substr(file, ?, ?) FROM downlink_bundle"
      " WHERE number = ? AND file IS NOT NULL");
  const std::uint64_t first_byte = std::min<std::uint64_t>(request.first_byte(), INT32_MAX);
  query << first_byte + 1 << kBundlePartBytesMax << request.number();
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  if (!*row) return tl::unexpected(NoSuchBundle(request.number()));
  proto::ReadBundleReply reply;
  *reply.mutable_bundle() = BundleOf(query);
  reply.set_part(std::string(query.Bytes(5)));
  return reply;
}

Result<void> AcknowledgeBundle(Database& database, std::uint32_t number, const HaveSet& own) {
  Result<Transaction> transaction = Transaction::Begin(database);
  if (!transaction) return tl::unexpected(transaction.error());
  Result<HaveSet> have = AcknowledgedHave(database);
  if (!have) return tl::unexpected(have.error());
  {
    Query bundle = database.Prepare("SELECT have, file IS NULL FROM downlink_bundle WHERE number = ?");
    bundle << number;
    const Result<bool> row = bundle.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return tl::unexpected(NoSuchBundle(number));
    if (bundle.Integer(1) != 0) return {};
    have->Merge(HaveOf(bundle, 0));
  }
  {
    const std::string all = ToProto(WithoutGaps(*have, own)).SerializeAsString();
    Query empty = database.Prepare("UPDATE downlink_bundle SET have = x'' WHERE file IS NULL");
    if (const Result<void> done = empty.Run(); !done) return done;
    Query acknowledge = database.Prepare("UPDATE downlink_bundle SET have = ?, file = NULL WHERE number = ?");
    acknowledge << Blob{all} << number;
    if (const Result<void> done = acknowledge.Run(); !done) return done;
  }
  return transaction->Commit();
}

}  // namespace moondb
