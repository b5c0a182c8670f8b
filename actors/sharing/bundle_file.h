// Bundles for a ground station. A bundle is a file of limited size that contains records in the compact form
// (coding/batch_codec.h), their have-set, and a checksum over all bytes. proto/bundle.proto defines the format. The
// functions open no files. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "model/error.h"
#include "model/have_set.h"
#include "proto/bundle.pb.h"
#include "proto/record.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::size_t kBundleBytesMin = 1024;
inline constexpr std::size_t kBundleBytesMax = 16 * 1024 * 1024;

class BatchEncoder;

class BundleWriter {
 public:
  // `head` is a BundleFile without `have` and `parts`. `bytes_max` limits the size of the file. Requires: `bytes_max`
  // lies between kBundleBytesMin and kBundleBytesMax.
  BundleWriter(proto::BundleFile head, std::size_t bytes_max);
  ~BundleWriter();

  // Adds as many of the first records as fit, and returns their number.
  int Add(const proto::RecordBatch& records);

  const HaveSet& have() const { return have_; }
  std::uint64_t record_count() const { return record_count_; }

  // Returns the bytes of the file. Call once.
  std::string Finish();

 private:
  bool AddAll(const proto::RecordBatch& records);

  const std::size_t bytes_max_;
  proto::BundleFile file_;
  HaveSet have_;
  std::uint64_t record_count_ = 0;
  std::unique_ptr<BatchEncoder> encoder_;
};

// Called for each record of a bundle. If it returns an error, ReadBundle stops and returns the error.
using VisitBundled = std::function<Result<void>(const proto::StoredRecord& record)>;

// Calls `visit` for all records of a bundle, in order, and returns the bundle without its parts. Returns kCorrupt if
// `file` is not a bundle, has another version, is damaged, or contains other records than its have-set covers.
Result<proto::BundleFile> ReadBundle(std::string_view file, const VisitBundled& visit);

// Returns the XXH64 of the file, which identifies a bundle together with its number.
std::uint64_t HashOfBundle(std::string_view file);

}  // namespace moondb
