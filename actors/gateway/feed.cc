#include "actors/gateway/feed.h"

#include <algorithm>

namespace moondb {

bool Feed::Wants(const proto::RecordsStored& stored) const {
  const auto& wanted = request_.data_types();
  return wanted.empty() || std::find_first_of(wanted.begin(), wanted.end(), stored.data_types().begin(),
                                              stored.data_types().end()) != wanted.end();
}

const proto::ReadRequest& Feed::Ask(std::uint64_t last_row_id) {
  is_stale_ = false;
  known_row_id_ = last_row_id;
  return request_;
}

void Feed::OnEmptyPage(bool is_complete) {
  if (!is_complete) return;
  // All rows up to known_row_id_ were searched.
  request_.set_after_row_id(std::max(request_.after_row_id(), known_row_id_));
}

}  // namespace moondb
