#include "apps/moondb_sim/session_checker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "actors/sharing/codec.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr StreamKey kStream{2, 7, proto::LOCAL_TRAVERSABILITY_MAP};

// Returns batch `number` with one record of `bytes` random bytes. The record's seq is the batch number.
proto::Message Batch(std::uint32_t number, std::size_t bytes, std::uint64_t remaining) {
  static std::mt19937_64 rng(1);
  std::string content(bytes, '\0');
  for (char& byte : content) byte = static_cast<char>(rng());
  proto::RecordBatch records;
  *records.add_records()->mutable_key() = ToProto(RecordKey{kStream, number});
  records.mutable_records(0)->set_content(content);
  CodedBatch coded = EncodeBatch(records);
  proto::Message message;
  message.set_remaining(remaining);
  message.mutable_batch()->set_session_id(5);
  message.mutable_batch()->set_batch_number(number);
  message.mutable_batch()->set_codec(coded.codec);
  message.mutable_batch()->set_coded(std::move(coded.bytes));
  message.mutable_batch()->set_record_count(1);
  return message;
}

// Returns the acknowledgment of batch `number` from a receiver that holds `seqs`.
proto::Have Acknowledged(std::uint32_t number, IntervalSet::Interval seqs) {
  HaveSet have;
  have[kStream].held.Add(seqs);
  proto::Have message;
  message.set_session_id(5);
  message.set_batch_number(number);
  *message.mutable_have() = ToProto(have);
  return message;
}

class SessionCheckerTest : public testing::Test {
 protected:
  SessionCheckerTest() {
    proto::Hello hello;
    hello.set_session_id(5);
    checker_.OnHello(hello);
  }

  std::vector<std::string> BrokenBy(const proto::Message& batch) {
    std::vector<std::string> invariants;
    for (const auto& [rule, text] : checker_.OnBatch(batch)) invariants.push_back(rule);
    return invariants;
  }

  SessionChecker checker_;
};

TEST_F(SessionCheckerTest, CountsBytesInFlightUntilTheyAreAcknowledged) {
  EXPECT_THAT(BrokenBy(Batch(1, 3500, 9)), IsEmpty());
  EXPECT_THAT(BrokenBy(Batch(2, 3500, 9)), IsEmpty());
  EXPECT_THAT(BrokenBy(Batch(3, 3500, 9)), ElementsAre("unacked_bounded"));
  checker_.OnHave(Acknowledged(3, {3, 3}));
  checker_.OnHave(Acknowledged(2, {2, 3}));
  EXPECT_THAT(BrokenBy(Batch(4, 3500, 9)), IsEmpty());
}

TEST_F(SessionCheckerTest, CoveredRecordsCountAsAcknowledged) {
  EXPECT_THAT(BrokenBy(Batch(1, 3500, 9)), IsEmpty());
  EXPECT_THAT(BrokenBy(Batch(2, 3500, 9)), IsEmpty());
  checker_.OnHave(Acknowledged(2, {1, 2}));
  EXPECT_THAT(BrokenBy(Batch(3, 3500, 0)), IsEmpty());
}

TEST_F(SessionCheckerTest, ALargeRecordIsSentInFragments) {
  EXPECT_THAT(BrokenBy(Batch(1, 5'000, 9)), ElementsAre("unacked_bounded"));
  proto::Message whole = Batch(2, 5'000, 9);
  whole.set_record_id(ToString(RecordKey{kStream, 2}));
  proto::Message first = whole;
  proto::Message last = whole;
  const std::string& coded = whole.batch().coded();
  for (proto::Message* fragment : {&first, &last})
    fragment->mutable_batch()->mutable_fragment()->set_whole_bytes(coded.size());
  first.mutable_batch()->set_coded(coded.substr(0, 4000));
  last.mutable_batch()->set_coded(coded.substr(4000));
  last.mutable_batch()->mutable_fragment()->set_first_byte(4000);
  last.mutable_batch()->set_batch_number(3);
  checker_.OnHave(Acknowledged(1, {1, 1}));
  EXPECT_THAT(BrokenBy(first), IsEmpty());
  EXPECT_THAT(BrokenBy(last), IsEmpty());
  checker_.OnHave(Acknowledged(2, {1, 1}));
  EXPECT_THAT(BrokenBy(Batch(4, 100, 0)), ElementsAre("end_is_last"));
  checker_.OnHave(Acknowledged(4, {2, 4}));
  EXPECT_THAT(BrokenBy(Batch(5, 100, 0)), IsEmpty());
}

TEST_F(SessionCheckerTest, TheEndIsSentLast) {
  EXPECT_THAT(BrokenBy(Batch(1, 100, 9)), IsEmpty());
  EXPECT_THAT(BrokenBy(Batch(2, 100, 0)), ElementsAre("end_is_last"));
}

TEST_F(SessionCheckerTest, AnswersOfOtherSessionsAcknowledgeNothing) {
  EXPECT_THAT(BrokenBy(Batch(1, 100, 9)), IsEmpty());
  proto::Have other = Acknowledged(1, {1, 1});
  other.set_session_id(4);
  checker_.OnHave(other);
  EXPECT_THAT(BrokenBy(Batch(2, 100, 0)), ElementsAre("end_is_last"));
  proto::Hello hello;
  hello.set_session_id(6);
  checker_.OnHello(hello);
  EXPECT_THAT(BrokenBy(Batch(1, 100, 0)), IsEmpty());
}

TEST_F(SessionCheckerTest, BatchThatDoesNotDecodeIsRefused) {
  proto::Message batch = Batch(1, 100, 9);
  batch.mutable_batch()->set_record_count(2);
  EXPECT_THAT(BrokenBy(batch), ElementsAre("nothing_refused"));
}

}  // namespace
}  // namespace moondb::simulation
