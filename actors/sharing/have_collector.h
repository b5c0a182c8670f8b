// HaveCollector: puts a destination's have-set together out of the pages in which it comes (model/have_page.h).
//
// One page is waited for at a time; one that came before, or late, changes nothing. What is here stays until Clear, so
// that only the page that was lost is asked for again. A page is refused that names a record outside of what it speaks
// of, that says nothing and is not the last, or with which the have-set would be larger than any may be: so a
// destination that never comes to an end is noticed, and what is kept of it is bounded. Plain value.
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
    kNothing,  // It is not the page that is waited for.
    kPage,
    kLastPage,
  };

  // kInvalid for a page that cannot be; all that was collected is forgotten then.
  Result<Taken> Take(const proto::Have& page);
  void Clear() { *this = HaveCollector(); }

  // A page is here, and more are to come.
  bool is_begun() const { return page_count_ > 0; }
  // Where the page begins that is waited for; a default key: the first one.
  const RecordKey& next() const { return next_; }
  // After the last page; begins anew.
  HaveSet TakeWhole() { return std::exchange(*this, HaveCollector()).have_; }

 private:
  Result<HaveSet> Check(const proto::Have& page) const;

  HaveSet have_;
  RecordKey next_;
  int page_count_ = 0;
};

}  // namespace moondb
