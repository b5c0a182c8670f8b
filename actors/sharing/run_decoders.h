// RunDecoders: what a receiver keeps of the runs of maps that come in (coding/batch_codec.h).
//
// A run goes on from batch to batch and from session to session of its sender, which numbers its runs: so a map leans
// on the one before whenever that came. There are places for so many senders, each with one run: some 4 MB of maps of
// 4 x 100 x 100 cells, at most 10 MB, or 42 of layers two cells wide. A sender without a place codes each batch by
// itself. Not thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "actors/sharing/codec.h"
#include "model/error.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

class RunDecoders {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  // Who has not been heard for longer than `idle_after` may lose its place.
  RunDecoders(std::size_t places_max, std::chrono::nanoseconds idle_after)
      : places_max_(places_max), idle_after_(idle_after) {}

  // Whether that sender has a place from now on.
  bool TakePlace(AgentId sender, Time now);

  // `coded`: the batch's, or of pieces all of them. As DecodeBatch; kNotFound: the batch leans on others of its run
  // that were not decoded here.
  Result<proto::RecordBatch> Decode(AgentId sender, const proto::Batch& batch, std::string_view coded, Time now);

 private:
  struct Place {
    AgentId sender = 0;
    Time last_heard{};
    std::uint32_t run = 0;
    BatchDecoder decoder;
  };

  Place* Find(AgentId sender);

  std::size_t places_max_;
  std::chrono::nanoseconds idle_after_;
  std::vector<Place> places_;
};

}  // namespace moondb
