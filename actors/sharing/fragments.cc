#include "actors/sharing/fragments.h"

#include <xxhash.h>

#include <algorithm>
#include <utility>

namespace moondb {
namespace {

// Never returns 0, since a PartOfWhole with hash 0 means that the receiver holds no part.
std::uint64_t HashOf(const std::string& bytes) {
  return std::max<std::uint64_t>(XXH64(bytes.data(), bytes.size(), 0), 1);
}

}  // namespace

FragmentCutter::FragmentCutter(CodedBatch whole, std::uint32_t record_count, const PartOfWhole& covered)
    : whole_(std::move(whole)), record_count_(record_count), hash_(HashOf(whole_.bytes)) {
  if (covered.hash == hash_ && covered.bytes < whole_.bytes.size()) next_ = covered.bytes;
}

proto::Batch FragmentCutter::Next(std::size_t bytes_max) {
  proto::Batch batch;
  batch.set_codec(whole_.codec);
  batch.set_record_count(record_count_);
  batch.set_coded(whole_.bytes.substr(next_, bytes_max));
  batch.mutable_fragment()->set_hash(hash_);
  batch.mutable_fragment()->set_first_byte(next_);
  batch.mutable_fragment()->set_whole_bytes(whole_.bytes.size());
  next_ += batch.coded().size();
  return batch;
}

Result<std::optional<std::string>> FragmentCollector::Take(AgentId sender, const proto::Batch& batch) {
  const proto::Fragment& fragment = batch.fragment();
  const std::uint64_t end = fragment.first_byte() + batch.coded().size();
  const bool is_fragment = fragment.hash() != 0 && fragment.whole_bytes() <= whole_bytes_max_ &&
                           fragment.first_byte() < fragment.whole_bytes() && end <= fragment.whole_bytes() &&
                           !batch.coded().empty();
  if (!is_fragment) return Fail(ErrorCode::kCorrupt, "cannot be", "fragment");
  Part* part = Find(sender);
  const bool is_known = part != nullptr && part->hash == fragment.hash() && part->size == fragment.whole_bytes();
  if (!is_known && fragment.first_byte() == 0) {
    // Reuse the buffer of the sender's unfinished batch, so a sender that starts again and again has only one buffer.
    // Reserve the full size now: a buffer that grows by doubling would take three times the memory, and memory pages
    // that are never written cost nothing.
    Part begun = part != nullptr ? std::move(*part) : Part{};
    Forget(sender);
    begun.sender = sender;
    begun.hash = fragment.hash();
    begun.size = fragment.whole_bytes();
    begun.bytes.clear();
    begun.bytes.reserve(begun.size);
    parts_.push_back(std::move(begun));
    part = &parts_.back();
  } else if (!is_known || fragment.first_byte() > part->bytes.size()) {
    // If the hash matches but the size does not, discard the part. Otherwise the receiver would report this part again,
    // and the sender would send the same fragment again.
    if (!is_known && part != nullptr && part->hash == fragment.hash()) Forget(sender);
    return Fail(ErrorCode::kNotFound, "the bytes before this fragment have not arrived", "fragment");
  }
  if (end <= part->bytes.size()) return std::optional<std::string>();
  part->bytes.append(batch.coded(), part->bytes.size() - fragment.first_byte());
  part->written_bytes = std::max(part->written_bytes, part->bytes.size());
  if (part->bytes.size() < part->size) {
    std::size_t bytes = 0;
    for (const Part& other : parts_) bytes += other.written_bytes;
    if (bytes > bytes_max_) parts_.pop_front();
    return std::optional<std::string>();
  }
  std::string whole = std::move(part->bytes);
  Forget(sender);
  if (HashOf(whole) != fragment.hash())
    return Fail(ErrorCode::kCorrupt, "the joined fragments do not match their hash", "fragment");
  return std::optional<std::string>(std::move(whole));
}

PartOfWhole FragmentCollector::PartFrom(AgentId sender) const {
  for (const Part& part : parts_) {
    if (part.sender == sender) return {part.hash, part.bytes.size()};
  }
  return {};
}

FragmentCollector::Part* FragmentCollector::Find(AgentId sender) {
  const auto found = std::find_if(parts_.begin(), parts_.end(), [sender](const Part& p) { return p.sender == sender; });
  return found == parts_.end() ? nullptr : &*found;
}

void FragmentCollector::Forget(AgentId sender) {
  std::erase_if(parts_, [sender](const Part& part) { return part.sender == sender; });
}

}  // namespace moondb
