// HaveCollector: assembles a destination's have-set from the pages in which it arrives (model/have_page.h).
//
// The collector waits for one page at a time, and ignores duplicate and late pages. The collector refuses a page that
// names a record outside the page's own key range, and an empty page that is not the last. It also refuses a page that
// would exceed the limit of pages or of the have-set's size. These checks bound the memory for one destination, even if
// the destination sends pages endlessly. Plain value.
#pragma once

#include <utility>

#include "model/error.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "proto/sharing.pb.h"

namespace moondb {

class HaveCollector {
 public:
  enum class Taken {
    kNothing,  // The page is not the expected one.
    kPage,
    kLastPage,
  };

  // Accepts one page. Returns kInvalid for a malformed page, and then discards all collected pages.
  Result<Taken> Take(const proto::Have& page);
  void Clear() { *this = HaveCollector(); }

  // True if at least one page was collected and the have-set is not complete.
  bool is_begun() const { return page_count_ > 0; }
  // The first key of the page that the collector waits for. A default key means the first page.
  const RecordKey& next() const { return next_; }
  // Returns the complete have-set and clears the collector. Requires: the last page was collected.
  HaveSet TakeWhole() { return std::exchange(*this, HaveCollector()).have_; }

 private:
  Result<HaveSet> Check(const proto::Have& page) const;

  HaveSet have_;
  RecordKey next_;
  int page_count_ = 0;
};

}  // namespace moondb
