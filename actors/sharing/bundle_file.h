// A bundle for the ground: one file of records within a byte budget, in the compact form of batches, with its have-set
// and a checksum over all of it (proto/bundle.proto has its bytes).
//
// Plain values and functions, no files: from one thread at a time.
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
  // `head`: all but have and parts. `bytes_max`: of the file; kBundleBytesMin to kBundleBytesMax.
  BundleWriter(proto::BundleFile head, std::size_t bytes_max);
  ~BundleWriter();

  // Adds as many of the records as fit, from the first on; how many. Encodes each a few times where not all fit.
  int Add(const proto::RecordBatch& records);

  const HaveSet& have() const { return have_; }
  std::uint64_t record_count() const { return record_count_; }

  // The file. Once.
  std::string Finish();

 private:
  bool AddAll(const proto::RecordBatch& records);

  const std::size_t bytes_max_;
  proto::BundleFile file_;
  HaveSet have_;
  std::uint64_t record_count_ = 0;
  std::unique_ptr<BatchEncoder> encoder_;
};

// Sees one record; an error ends the reading and is returned.
using VisitBundled = std::function<Result<void>(const proto::StoredRecord& record)>;

// Shows all records of a bundle, in order, and gives back its head: all but the parts. kCorrupt: no bundle, one of
// another version, damaged, or with other records than its have-set says.
Result<proto::BundleFile> ReadBundle(std::string_view file, const VisitBundled& visit);

// XXH64, which names a bundle beside its number.
std::uint64_t HashOfBundle(std::string_view file);

}  // namespace moondb
