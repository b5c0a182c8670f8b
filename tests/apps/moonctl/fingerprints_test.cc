#include "apps/moonctl/fingerprints.h"

#include <gmock/gmock.h>

#include <random>

#include "proto/types.pb.h"
#include "tests/client/fake_agent.h"

namespace moondb {
namespace {

using testing::ElementsAre;

constexpr StreamKey kStream{2, 7, proto::POSE_GRAPH_NODE};

// Hashes of the records of kStream at one agent, by seq.
using Hashes = std::map<std::uint64_t, std::uint64_t>;

Hashes SomeHashes(std::uint64_t count) {
  std::mt19937_64 random(1);
  Hashes hashes;
  for (std::uint64_t seq = 1; seq <= count; ++seq) hashes[seq] = random();
  return hashes;
}

RequestFingerprint Asking(const Hashes& hashes, int& asked) {
  return [&hashes, &asked](const StreamKey&, const IntervalSet& seqs) -> Result<Fingerprint> {
    ++asked;
    Fingerprint fingerprint;
    for (const auto& [seq, hash] : hashes) {
      if (!seqs.Contains(seq)) continue;
      fingerprint.hash ^= hash;
      ++fingerprint.record_count;
    }
    return fingerprint;
  };
}

std::vector<std::uint64_t> Differing(const Hashes& first, const Hashes& second, std::size_t keys_max, int& asked) {
  HaveSet held;
  held[kStream].held.Add({1, 400});
  held[kStream].held.Add({500, 1000});
  held[{3, 1, kStream.type}];  // A stream without held records.
  const auto keys = FindDiffering(held, Asking(first, asked), Asking(second, asked), keys_max);
  EXPECT_TRUE(keys);
  std::vector<std::uint64_t> seqs;
  for (const RecordKey& key : *keys) {
    EXPECT_EQ(key.stream, kStream);
    seqs.push_back(key.seq);
  }
  return seqs;
}

TEST(FingerprintsTest, FindsDifferencesByBisection) {
  const Hashes sound = SomeHashes(1000);
  int asked = 0;
  EXPECT_THAT(Differing(sound, sound, 10, asked), ElementsAre());
  EXPECT_EQ(asked, 2);

  Hashes damaged = sound;
  damaged[450] ^= 1;  // Seq 450 is not held, so it is not compared.
  EXPECT_THAT(Differing(sound, damaged, 10, asked), ElementsAre());
  damaged[1] ^= 1 << 9;
  damaged[400] ^= 1;
  damaged.erase(500);
  damaged[1000] = 0;
  asked = 0;
  EXPECT_THAT(Differing(sound, damaged, 10, asked), ElementsAre(1, 400, 500, 1000));
  EXPECT_LT(asked, 4 * 2 * 2 * 11);
  EXPECT_THAT(Differing(damaged, sound, 3, asked), ElementsAre(1, 400, 500));
}

TEST(FingerprintsTest, ReturnsAnErrorAtOnce) {
  HaveSet held;
  held[kStream].held.Add({1, 9});
  int asked = 0;
  const Hashes sound = SomeHashes(9);
  const RequestFingerprint failing = [](const StreamKey&, const IntervalSet&) {
    return Result<Fingerprint>(Fail(ErrorCode::kTimedOut, "no answer"));
  };
  EXPECT_EQ(FindDiffering(held, Asking(sound, asked), failing, 10).error().code, ErrorCode::kTimedOut);
}

// Returns the answers of a fake agent. The hash of each of its records is the record's seq, and each answer covers
// `per_answer` records.
FakeAgent::Answer InParts(std::uint64_t per_answer) {
  return [per_answer](const proto::ClientMessage& request) {
    const proto::StreamHave& stream = request.control_request().fingerprint().stream();
    proto::ClientMessage answer;
    answer.set_request_id(request.request_id());
    proto::FingerprintReply& reply = *answer.mutable_control_reply()->mutable_fingerprint();
    std::uint64_t left = per_answer;
    for (const proto::Interval& interval : stream.held()) {
      for (std::uint64_t seq = interval.first(); seq <= interval.last() && left > 0; ++seq, --left) {
        reply.set_fingerprint(reply.fingerprint() ^ seq);
        reply.set_record_count(reply.record_count() + 1);
        reply.set_last_seq(seq);
      }
    }
    reply.set_is_complete(left > 0);
    return std::vector{answer.SerializeAsString()};
  };
}

Result<Fingerprint> RequestInParts(std::uint64_t per_answer) {
  FakeAgent agent(InParts(per_answer));
  const auto client = Client::Connect(agent.endpoint(), "rover1", {});
  EXPECT_TRUE(client);
  IntervalSet seqs;
  seqs.Add({1, 5});
  seqs.Add({8, 11});
  return FingerprintOf(**client, kStream, seqs);
}

TEST(FingerprintsTest, PutsTheFingerprintTogetherFromAnswersInParts) {
  for (const std::uint64_t per_answer : {1, 2, 5, 9, 100}) {
    const auto whole = RequestInParts(per_answer);
    ASSERT_TRUE(whole) << ToString(whole.error());
    EXPECT_EQ(whole->record_count, 9);
    EXPECT_EQ(whole->hash, (1 ^ 2 ^ 3 ^ 4 ^ 5) ^ (8 ^ 9 ^ 10 ^ 11));
  }
}

TEST(FingerprintsTest, GivesUpIfAnswersMakeNoProgress) {
  EXPECT_EQ(RequestInParts(0).error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace moondb
