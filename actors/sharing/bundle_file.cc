#include "actors/sharing/bundle_file.h"

#include <xxhash.h>

#include <algorithm>
#include <utility>

#include "actors/sharing/coding/batch_codec.h"
#include "model/bounded_parse.h"
#include "model/check.h"
#include "model/record_key.h"

namespace moondb {
namespace {

constexpr std::string_view kMagic = "moondb bundle 1\n";
constexpr std::size_t kHashBytes = 8;

std::uint64_t Hash(std::string_view bytes) { return XXH64(bytes.data(), bytes.size(), 0); }

std::string HashBytes(std::uint64_t hash) {
  std::string bytes;
  for (std::size_t i = 0; i < kHashBytes; ++i) bytes += static_cast<char>(hash >> (8 * i));
  return bytes;
}

void Note(const proto::StoredRecord& record, HaveSet& have) {
  const RecordKey key = FromProto(record.key());
  have[key.stream].held.Add(key.seq);
}

tl::unexpected<Error> Corrupt(const std::string& text) { return Fail(ErrorCode::kCorrupt, text); }

}  // namespace

BundleWriter::BundleWriter(proto::BundleFile head, std::size_t bytes_max)
    : bytes_max_(bytes_max),
      file_(std::move(head)),
      encoder_(std::make_unique<BatchEncoder>(MapRunEncoder::Previous::kWhereItPays)) {
  Check(bytes_max >= kBundleBytesMin && bytes_max <= kBundleBytesMax, "a bundle's size is within its limits");
  encoder_->BeginRun();
}

BundleWriter::~BundleWriter() = default;

int BundleWriter::Add(const proto::RecordBatch& records) {
  int count = records.records_size();
  proto::RecordBatch part = records;
  while (count > 0 && !AddAll(part)) {
    count /= 2;
    part.mutable_records()->DeleteSubrange(count, part.records_size() - count);
  }
  if (count == 0 || count == records.records_size()) return count;
  proto::RecordBatch rest = records;
  rest.mutable_records()->DeleteSubrange(0, count);
  // About 2 * count records did not fit, so try at most `count` further records.
  rest.mutable_records()->DeleteSubrange(count, rest.records_size() - count);
  return count + Add(rest);
}

bool BundleWriter::AddAll(const proto::RecordBatch& records) {
  BatchEncoder encoder = *encoder_;  // A copy, since records that do not fit must not change the encoder's state.
  HaveSet have = have_;
  for (const proto::StoredRecord& record : records.records()) Note(record, have);
  proto::BundlePart& part = *file_.add_parts();
  part.set_coded(encoder.Encode(records));
  part.set_record_count(static_cast<std::uint32_t>(records.records_size()));
  *file_.mutable_have() = ToProto(have);
  if (kMagic.size() + kHashBytes + file_.ByteSizeLong() > bytes_max_) {
    file_.mutable_parts()->RemoveLast();
    *file_.mutable_have() = ToProto(have_);
    return false;
  }
  *encoder_ = std::move(encoder);
  have_ = std::move(have);
  record_count_ += static_cast<std::uint64_t>(records.records_size());
  return true;
}

std::string BundleWriter::Finish() {
  const std::string body = file_.SerializeAsString();
  return std::string(kMagic) + HashBytes(Hash(body)) + body;
}

Result<proto::BundleFile> ReadBundle(std::string_view file, const VisitBundled& visit) {
  const std::size_t version_at = kMagic.size() - 2;
  if (!file.starts_with(kMagic.substr(0, version_at))) return Corrupt("is not a moondb bundle");
  if (!file.starts_with(kMagic)) return Corrupt("has an unknown bundle version; this moondb reads version 1");
  if (file.size() > kBundleBytesMax) return Corrupt("is larger than a bundle may be (16 MiB)");
  const std::string_view body = file.substr(std::min(kMagic.size() + kHashBytes, file.size()));
  proto::BundleFile bundle;
  if (file.substr(kMagic.size(), kHashBytes) != HashBytes(Hash(body)) || !ParseBounded(body, &bundle)) {
    return Corrupt("is damaged: fetch it again");
  }
  BatchDecoder decoder;
  HaveSet seen;
  for (const proto::BundlePart& part : bundle.parts()) {
    const Result<proto::RecordBatch> batch = decoder.Decode(part.coded(), part.record_count());
    if (!batch) return Corrupt(batch.error().text);
    for (const proto::StoredRecord& record : batch->records()) {
      if (const Result<void> visited = visit(record); !visited) return tl::unexpected(visited.error());
      Note(record, seen);
    }
  }
  const Result<HaveSet> have = FromProto(bundle.have());
  if (!have || *have != seen) return Corrupt("contains other records than its header lists");
  bundle.clear_parts();
  return bundle;
}

std::uint64_t HashOfBundle(std::string_view file) { return Hash(file); }

}  // namespace moondb
