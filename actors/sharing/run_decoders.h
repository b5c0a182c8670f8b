// RunDecoders: the decoders of the runs of maps that a receiver gets from its senders (coding/batch_codec.h).
//
// A sender numbers its runs, and continues a run across sessions. The receiver has `places_max` places, each for the
// decoder of one sender's current run. A place takes about 4 MB for maps of 4 x 100 x 100 cells, and at most 10 MB, or
// 42 MB for layers that are two cells wide. A sender without a place codes each batch independently. Not thread-safe.
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

  // A sender that sent nothing for longer than `idle_after` may lose its place.
  RunDecoders(std::size_t places_max, std::chrono::nanoseconds idle_after)
      : places_max_(places_max), idle_after_(idle_after) {}

  // Gives the sender a place if it has none and a place is free or idle. Returns true if the sender then has a place.
  bool TakePlace(AgentId sender, Time now);

  // Decodes a batch of the sender. `coded` is the batch's coded bytes, joined if they came in fragments. Returns the
  // errors of DecodeBatch, for example kNotFound if the batch depends on earlier batches of its run that were not
  // decoded here.
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
