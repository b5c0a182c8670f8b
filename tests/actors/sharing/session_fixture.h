// SessionFixture: one session between two stores in memory, for the tests of SharingSession and its parts.
#pragma once

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <utility>
#include <vector>

#include "actors/sharing/run_decoders.h"
#include "actors/sharing/sharing_session.h"
#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/coding/records.h"
#include "tests/actors/sharing/memory_store.h"

namespace moondb {

inline constexpr AgentId kSelf = 2;
inline constexpr AgentId kDestination = 1;

inline std::string Noise(std::size_t size) {
  static std::mt19937_64 rng(1);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(rng());
  return bytes;
}

// A session with a store on each side. The source's storage answers immediately. The destination answers only when a
// test calls a function such as AnswerHello, Store or Acknowledge.
class SessionFixture : public testing::Test {
 protected:
  void Order() { Take(session_.Order(proto::RecordFilter(), now_)); }

  void Take(SharingActions actions) {
    for (SharingAction& action : actions) {
      if (action.to != 0) {
        EXPECT_EQ(action.to, kDestination);
        sent_.push_back(std::move(action.message));
      } else if (action.message.has_missing_request()) {
        asked_for_ = action.message.missing_request().filter();
        Take(session_.OnMissingReply(action.message.request_id(), source_.Missing(action.message.missing_request()),
                                     now_));
      } else if (action.message.has_peer_have()) {
        peer_haves_.push_back(action.message.peer_have());
      }
    }
  }

  std::vector<proto::Message> TakeSent() { return std::exchange(sent_, {}); }

  // Returns the session id of the last sent message, which must be a Hello. Removes all sent messages.
  std::uint64_t TakeHello() {
    const auto sent = TakeSent();
    EXPECT_FALSE(sent.empty());
    EXPECT_TRUE(sent.back().has_hello());
    return sent.back().hello().session_id();
  }

  void AnswerHello(std::uint32_t credit = 8 * 1024) {
    proto::Have have;
    have.set_session_id(TakeHello());
    *have.mutable_have() = destination_.Have().have();
    have.set_is_whole(true);
    have.set_unacked_bytes_max(credit_ = credit);
    have.set_bytes_per_second_max(granted_rate_);
    *have.mutable_schemas() = schemas_;
    have.set_part_hash(fragments_.PartFrom(kSelf).hash);
    have.set_part_bytes(fragments_.PartFrom(kSelf).bytes);
    have.set_keeps_runs(are_runs_kept_ && runs_.TakePlace(kSelf, now_));
    Take(session_.OnHave(have, now_));
  }

  // Stores a batch at the destination, and returns the destination's acknowledgment. The acknowledgment requests a new
  // run of batches if the batch cannot be decoded.
  proto::Have Store(const proto::Message& message) {
    const proto::Batch& batch = message.batch();
    std::string coded = batch.coded();
    if (batch.has_fragment()) {
      const auto whole = *fragments_.Take(kSelf, batch);
      if (!whole) return AcknowledgmentOf(batch);
      coded = *whole;
    }
    proto::StoreRequest request;
    proto::Have have = AcknowledgmentOf(batch);
    const auto records = runs_.Decode(kSelf, batch, coded, now_);
    if (!records) {
      EXPECT_EQ(records.error().code, ErrorCode::kNotFound) << ToString(records.error());
      have.set_needs_new_run(true);
      return have;
    }
    *request.mutable_records() = records->records();
    *request.mutable_dropped() = batch.dropped();
    *have.mutable_have() = destination_.Store(request).covered();
    return have;
  }

  proto::Have AcknowledgmentOf(const proto::Batch& batch) const {
    proto::Have have;
    have.set_session_id(batch.session_id());
    have.set_batch_number(batch.batch_number());
    have.set_unacked_bytes_max(credit_);
    have.set_bytes_per_second_max(granted_rate_);
    return have;
  }

  void Acknowledge(const proto::Message& batch) { Take(session_.OnHave(Store(batch), now_)); }

  void InsertMaps(int count, int first = 0) {
    const proto::RecordBatch maps = MapBatch(first, count);
    for (const proto::StoredRecord& map : maps.records()) {
      source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, map.content());
    }
  }

  // Inserts maps, orders all records, and answers the Hello. `first` is the index of the first map.
  void OrderMaps(int count, int first = 0, std::uint32_t credit = 8 * 1024) {
    InsertMaps(count, first);
    Order();
    AnswerHello(credit);
  }

  // Inserts a map of random cells, which hardly compress. The map is too large for one message.
  void InsertNoiseMap(int index, int side) {
    const auto any_cell = [this](int, int, int) { return static_cast<Cell>(rng_() % 3); };
    const proto::StoredRecord map = MapOf(DrawLayers(1, side, side, any_cell), index);
    source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, map.content());
  }

  static bool IsReadByItself(const proto::Message& message) {
    const proto::Batch& batch = message.batch();
    return DecodeBatch(batch.codec(), batch.coded(), batch.record_count()).has_value();
  }

  // Stores and acknowledges batches at the destination until the session sends no more messages. Returns all batches.
  std::vector<proto::Message> RunToEnd() {
    std::vector<proto::Message> batches;
    while (!sent_.empty()) {
      for (proto::Message& message : TakeSent()) {
        Acknowledge(message);
        batches.push_back(std::move(message));
      }
    }
    return batches;
  }

  // Stores and acknowledges each batch immediately. Returns the total size in bytes of the batches sent before `end`.
  std::size_t BytesUntil(SharingSession::Time end) {
    std::size_t bytes = 0;
    while (now_ < end) {
      for (const proto::Message& message : TakeSent()) {
        if (!message.has_batch()) continue;
        bytes += message.batch().ByteSizeLong();
        Acknowledge(message);
      }
      if (sent_.empty()) Advance(std::chrono::milliseconds(100));
    }
    return bytes;
  }

  // Advances the time in steps of 100 ms, and runs the session's timer at each step.
  void Advance(std::chrono::nanoseconds duration) {
    for (const auto end = now_ + duration; now_ < end;) {
      now_ += std::chrono::milliseconds(100);
      Take(session_.OnTimer(now_));
    }
  }

  static proto::RecordFilter States() {
    proto::RecordFilter states;
    states.add_origin_agents(kSelf);
    states.add_data_types(proto::POWER);
    return states;
  }

  proto::ShareSession Status() const { return session_.Status(now_); }

  static SharingSession::Options Options() {
    SharingSession::Options options;
    options.state_types = {proto::POWER, proto::MODE};
    options.schemas = SchemasOf({});
    return options;
  }

  // Replaces the session by one that uses `codec` instead of the compact codec. Requires: no order is open.
  void UseCodec(proto::Codec codec) {
    SharingSession::Options options = Options();
    options.codec = codec;
    session_ = SharingSession(options, proto::SHARING_KIND_SYNC, kDestination, first_id_ += 1000);
  }

  std::uint64_t first_id_ = 1000;  // First id of session_. UseCodec gives each new session higher ids.
  SharingSession session_{Options(), proto::SHARING_KIND_SYNC, kDestination, first_id_};
  SharingSession::Time now_{};
  std::uint32_t credit_ = 8 * 1024;  // Credit in bytes that the destination grants.
  std::uint32_t granted_rate_ = 0;   // Bytes per second that the destination grants. 0: no limit.
  TypeSchemas schemas_;              // Schemas that the destination reports. Empty: none.
  MemoryStore source_;
  MemoryStore destination_;
  FragmentCollector fragments_{1'000'000};  // Fragments that the destination has received.
  RunDecoders runs_{1, {}};
  bool are_runs_kept_ = true;
  std::mt19937_64 rng_{3};
  std::vector<proto::Message> sent_;
  std::vector<proto::PeerHave> peer_haves_;
  proto::RecordFilter asked_for_;  // Filter of the last MissingRequest to the source's storage.
};

}  // namespace moondb
