// RunDecoders: what a receiver keeps of the runs of maps that come in (coding/batch_codec.h).
//
// A run goes on from batch to batch and from session to session of its sender, which numbers its runs: so a map leans
// on the one before whenever that came. Kept is one run for each sender, at most 10 MB of it (40 where all layers
// are single rows), and those of the senders that were heard last; whose is not kept begins a new one. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <string_view>

#include "actors/sharing/codec.h"
#include "model/error.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

class RunDecoders {
 public:
  explicit RunDecoders(std::size_t runs_max) : runs_max_(runs_max) {}

  // `coded`: the batch's, or of pieces all of them. As DecodeBatch; kNotFound: the batch leans on others of its run
  // that were not decoded here.
  Result<proto::RecordBatch> Decode(AgentId sender, const proto::Batch& batch, std::string_view coded);

 private:
  struct Run {
    AgentId sender = 0;
    std::uint32_t number = 0;
    BatchDecoder decoder;
  };

  std::size_t runs_max_;
  std::list<Run> runs_;  // The one that went on last at the back.
};

}  // namespace moondb
