#include "actors/sharing/have_collector.h"

#include <cstdint>

#include "model/have_page.h"

namespace moondb {

Result<HaveCollector::Taken> HaveCollector::Take(const proto::Have& page) {
  if (FromProto(page.have_from()) != next_) return Taken::kNothing;
  const Result<HaveSet> checked = Check(page);
  if (!checked) {
    Clear();
    return tl::unexpected(checked.error());
  }
  have_.Merge(*checked);
  ++page_count_;
  next_ = FromProto(page.have_next());
  return page.has_have_next() ? Taken::kPage : Taken::kLastPage;
}

Result<HaveSet> HaveCollector::Check(const proto::Have& page) const {
  Result<HaveSet> have = FromProto(page.have());
  if (!have) return have;
  const bool is_last = !page.has_have_next();
  const RecordKey end = FromProto(page.have_next());
  if (!is_last && (end <= next_ || have->streams().empty() || page_count_ + 1 >= kHavePagesMax)) {
    return Fail(ErrorCode::kInvalid, "does not advance, or there are too many pages", "have_next");
  }
  for (const auto& [key, stream] : have->streams()) {
    const IntervalSet covered = stream.Covered();
    const RecordKey first{key, covered.is_empty() ? UINT64_MAX : covered.intervals().front().first};
    const RecordKey last{key, covered.Max()};
    if (first < next_ || (!is_last && last >= end)) {
      return Fail(ErrorCode::kInvalid, "lists records that were not asked for", "have");
    }
  }
  if (const Result<void> fits = have_.CheckJoins(*have); !fits) return tl::unexpected(fits.error());
  return have;
}

}  // namespace moondb
