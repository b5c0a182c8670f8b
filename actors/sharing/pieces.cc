#include "actors/sharing/pieces.h"

#include <xxhash.h>

#include <algorithm>
#include <utility>

namespace moondb {
namespace {

// Never 0, which stands for none.
std::uint64_t HashOf(const std::string& bytes) {
  return std::max<std::uint64_t>(XXH64(bytes.data(), bytes.size(), 0), 1);
}

}  // namespace

PieceCutter::PieceCutter(CodedBatch whole, std::uint32_t record_count, const PartOfWhole& had)
    : whole_(std::move(whole)), record_count_(record_count), hash_(HashOf(whole_.bytes)) {
  if (had.hash == hash_ && had.bytes < whole_.bytes.size()) next_ = had.bytes;
}

proto::Batch PieceCutter::Next(std::size_t bytes_max) {
  proto::Batch batch;
  batch.set_codec(whole_.codec);
  batch.set_record_count(record_count_);
  batch.set_coded(whole_.bytes.substr(next_, bytes_max));
  batch.mutable_piece()->set_hash(hash_);
  batch.mutable_piece()->set_first_byte(next_);
  batch.mutable_piece()->set_whole_bytes(whole_.bytes.size());
  next_ += batch.coded().size();
  return batch;
}

Result<std::optional<std::string>> PieceCollector::Take(AgentId sender, const proto::Batch& batch) {
  const proto::Piece& piece = batch.piece();
  const std::uint64_t end = piece.first_byte() + batch.coded().size();
  const bool is_piece = piece.hash() != 0 && piece.whole_bytes() <= whole_bytes_max_ &&
                        piece.first_byte() < piece.whole_bytes() && end <= piece.whole_bytes() &&
                        !batch.coded().empty();
  if (!is_piece) return Fail(ErrorCode::kCorrupt, "cannot be", "piece");
  Part* part = Find(sender);
  const bool is_known = part != nullptr && part->hash == piece.hash() && part->size == piece.whole_bytes();
  if (!is_known && piece.first_byte() == 0) {
    // What it began before gives its buffer: a sender that finishes nothing has one, however often it begins. Growing
    // by doubling would take three times as much; pages that nothing was written to take nothing.
    Part begun = part != nullptr ? std::move(*part) : Part{};
    Forget(sender);
    begun.sender = sender;
    begun.hash = piece.hash();
    begun.size = piece.whole_bytes();
    begun.bytes.clear();
    begun.bytes.reserve(begun.size);
    parts_.push_back(std::move(begun));
    part = &parts_.back();
  } else if (!is_known || piece.first_byte() > part->bytes.size()) {
    // The sender goes on from this part because its hash is right; reported again, the part would bring the same piece.
    if (!is_known && part != nullptr && part->hash == piece.hash()) Forget(sender);
    return Fail(ErrorCode::kNotFound, "what comes before this piece is not here", "piece");
  }
  if (end <= part->bytes.size()) return std::optional<std::string>();
  part->bytes.append(batch.coded(), part->bytes.size() - piece.first_byte());
  part->written_bytes = std::max(part->written_bytes, part->bytes.size());
  if (part->bytes.size() < part->size) {
    std::size_t bytes = 0;
    for (const Part& other : parts_) bytes += other.written_bytes;
    if (bytes > bytes_max_) parts_.pop_front();
    return std::optional<std::string>();
  }
  std::string whole = std::move(part->bytes);
  Forget(sender);
  if (HashOf(whole) != piece.hash()) return Fail(ErrorCode::kCorrupt, "the whole is not what its hash says", "piece");
  return std::optional<std::string>(std::move(whole));
}

PartOfWhole PieceCollector::PartFrom(AgentId sender) const {
  for (const Part& part : parts_) {
    if (part.sender == sender) return {part.hash, part.bytes.size()};
  }
  return {};
}

PieceCollector::Part* PieceCollector::Find(AgentId sender) {
  const auto found = std::find_if(parts_.begin(), parts_.end(), [sender](const Part& p) { return p.sender == sender; });
  return found == parts_.end() ? nullptr : &*found;
}

void PieceCollector::Forget(AgentId sender) {
  std::erase_if(parts_, [sender](const Part& part) { return part.sender == sender; });
}

}  // namespace moondb
