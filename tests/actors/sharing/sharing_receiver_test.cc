#include "actors/sharing/sharing_receiver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "actors/sharing/codec.h"
#include "model/have_page.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "model/wire_version.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/coding/records.h"

namespace moondb {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;

constexpr char kTeamId[] = "0123456789abcdef";  // Team id of the receiver, and of all valid Hellos.

class SharingReceiverTest : public testing::Test {
 protected:
  static SharingReceiver::Options Options() {
    SharingReceiver::Options options;
    options.team = "test";
    options.team_id = kTeamId;
    options.config_hash = 77;
    return options;
  }

  static proto::Hello Hello(std::uint64_t session_id) {
    proto::Hello hello;
    hello.set_wire_version(kWireVersion);
    hello.set_team("test");
    hello.set_team_id(kTeamId);
    hello.set_config_hash(77);
    hello.set_session_id(session_id);
    hello.set_kind(proto::SHARING_KIND_SYNC);
    return hello;
  }

  static proto::Message Batch(std::uint64_t session_id, std::uint32_t number) {
    proto::RecordBatch records;
    *records.add_records()->mutable_key() = ToProto(RecordKey{{2, 9, proto::POWER}, number});
    CodedBatch coded = EncodeBatch(records);
    proto::Message message;
    message.set_ms_type(proto::DATA);
    message.set_remaining(5);
    message.mutable_batch()->set_session_id(session_id);
    message.mutable_batch()->set_batch_number(number);
    message.mutable_batch()->set_codec(coded.codec);
    message.mutable_batch()->set_coded(coded.bytes);
    message.mutable_batch()->set_record_count(1);
    return message;
  }

  // Returns `count` batches of one run, with four maps each. The batches are numbered from 1.
  static std::vector<proto::Message> RunOf(std::uint64_t session_id, std::uint32_t count) {
    SharingEncoder encoder;
    std::vector<proto::Message> batches;
    for (std::uint32_t number = 1; number <= count; ++number) {
      CodedBatch coded = encoder.Encode(proto::CODEC_COMPACT, MapBatch(4 * static_cast<int>(number), 4), 1'000'000);
      proto::Message& message = batches.emplace_back(Batch(session_id, number));
      message.mutable_batch()->set_codec(coded.codec);
      message.mutable_batch()->set_coded(coded.bytes);
      message.mutable_batch()->set_run(7);
      message.mutable_batch()->set_record_count(static_cast<std::uint32_t>(coded.record_count));
    }
    return batches;
  }

  // Returns true if the receiver reacts to the batch with one StoreRequest that contains all records of the batch.
  bool IsStored(const proto::Message& batch, AgentId sender = 2) {
    const auto actions = receiver_.OnBatch(sender, batch, now_);
    if (!actions || actions->size() != 1 || !actions->front().message.has_store_request()) return false;
    const int count = actions->front().message.store_request().records_size();
    return count == static_cast<int>(batch.batch().record_count());
  }

  bool IsNewRunAskedFor(const proto::Message& batch) {
    const auto actions = receiver_.OnBatch(2, batch, now_);
    if (!actions || actions->size() != 1 || !actions->front().message.has_have()) return false;
    const proto::Have& have = actions->front().message.have();
    EXPECT_EQ(have.batch_number(), batch.batch().batch_number());
    EXPECT_GT(have.unacked_bytes_max(), 0u);
    return have.needs_new_run();
  }

  static ErrorCode RefusalOf(const SharingActions& actions) {
    EXPECT_EQ(actions.size(), 1u);
    if (actions.empty() || !actions[0].message.has_refusal()) return ErrorCode::kInternal;
    return FromProto(actions[0].message.refusal().error()).code;
  }

  std::uint64_t OpenSession(AgentId sender, std::uint64_t session_id) {
    const SharingActions asked = receiver_.OnHello(sender, Hello(session_id), now_);
    EXPECT_EQ(asked.size(), 1u);
    return asked.empty() ? 0 : asked[0].message.request_id();
  }

  // Opens a session of `sender`. Storage replies with an empty have-set. Returns the receiver's answer to the Hello.
  proto::Have Open(AgentId sender, std::uint64_t session_id) {
    const SharingActions answered = receiver_.OnHaveReply(OpenSession(sender, session_id), proto::HaveReply());
    EXPECT_EQ(answered.size(), 1u);
    return answered.empty() ? proto::Have() : answered[0].message.have();
  }

  SharingReceiver receiver_{Options(), 500};
  SharingReceiver::Time now_{};
};

TEST_F(SharingReceiverTest, AnswersAHelloWithTheWholeHaveSet) {
  const SharingActions asked = receiver_.OnHello(2, Hello(10), now_);
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(asked[0].to, 0u);
  ASSERT_TRUE(asked[0].message.has_have_request());
  proto::HaveReply reply;
  proto::StreamHave& stream = *reply.mutable_have()->add_streams();
  stream.set_origin_agent(3);
  const SharingActions answered = receiver_.OnHaveReply(asked[0].message.request_id(), reply);
  ASSERT_EQ(answered.size(), 1u);
  EXPECT_EQ(answered[0].to, 2u);
  EXPECT_EQ(answered[0].message.ms_type(), proto::ACKNOWLEDGMENT);
  const proto::Have& have = answered[0].message.have();
  EXPECT_EQ(have.session_id(), 10u);
  EXPECT_TRUE(have.is_whole());
  EXPECT_EQ(have.unacked_bytes_max(), 8u * 1024);
  EXPECT_EQ(have.have().streams(0).origin_agent(), 3u);
}

TEST_F(SharingReceiverTest, AnswersWithTheOriginsThatTheHelloRequests) {
  proto::Hello hello = Hello(10);
  hello.add_origin_agents(3);
  hello.add_origin_agents(5);
  hello.add_everyones_types(proto::MAP_QUARANTINE);
  const SharingActions asked = receiver_.OnHello(2, hello, now_);
  ASSERT_EQ(asked.size(), 1u);
  const proto::HaveRequest& request = asked[0].message.have_request();
  EXPECT_TRUE(request.is_for_peer());
  EXPECT_THAT(request.origin_agents(), ElementsAre(3u, 5u));
  EXPECT_THAT(request.everyones_types(), ElementsAre(proto::MAP_QUARANTINE));
}

TEST_F(SharingReceiverTest, AnswersEachHelloWithOnePage) {
  proto::HaveReply reply;
  const RecordKey next{{3, 7, proto::POWER}, 9};
  *reply.mutable_next() = ToProto(next);
  proto::Hello hello = Hello(10);
  hello.set_schema_hash(5);
  const SharingActions asked = receiver_.OnHello(2, hello, now_);
  EXPECT_FALSE(asked.at(0).message.have_request().has_from());
  EXPECT_EQ(asked[0].message.have_request().bytes_max(), kHavePageBytesMax);
  const proto::Have first = receiver_.OnHaveReply(asked[0].message.request_id(), reply).at(0).message.have();
  EXPECT_FALSE(first.has_have_from());
  EXPECT_EQ(FromProto(first.have_next()), next);
  EXPECT_GT(first.unacked_bytes_max(), 0u);
  EXPECT_FALSE(first.keeps_runs()) << "it stands on the last page";

  *hello.mutable_have_from() = ToProto(next);
  const SharingActions asked_on = receiver_.OnHello(2, hello, now_);
  EXPECT_EQ(FromProto(asked_on.at(0).message.have_request().from()), next);
  EXPECT_TRUE(receiver_.OnHello(2, hello, now_).empty()) << "it is being answered";
  const proto::Have last =
      receiver_.OnHaveReply(asked_on[0].message.request_id(), proto::HaveReply()).at(0).message.have();
  EXPECT_EQ(FromProto(last.have_from()), next);
  EXPECT_FALSE(last.has_have_next());
  EXPECT_TRUE(last.keeps_runs());
  EXPECT_EQ(receiver_.MovingSessions(now_), 1u);
}

TEST_F(SharingReceiverTest, RefusesToContinueAnUnknownSession) {
  proto::Hello hello = Hello(10);
  *hello.mutable_have_from() = ToProto(RecordKey{{3, 7, proto::POWER}, 9});
  EXPECT_EQ(RefusalOf(receiver_.OnHello(2, hello, now_)), ErrorCode::kNotFound);
  OpenSession(2, 9);
  EXPECT_EQ(RefusalOf(receiver_.OnHello(2, hello, now_)), ErrorCode::kNotFound);
  EXPECT_EQ(receiver_.counts().refused_hellos, 0) << "the sender did nothing wrong";
  EXPECT_EQ(receiver_.OnBatch(2, Batch(9, 1), now_)->size(), 1u) << "the session that is known stays";
}

// Each sender sends ten batches. A batch takes less than 10 kB, but decodes to 16 MiB. At first, the receiver decodes
// two batches of each sender and drops the others.
TEST_F(SharingReceiverTest, LimitsTheBytesDecodedPerSenderAndMinute) {
  proto::RecordBatch records;
  *records.add_records()->mutable_key() = ToProto(RecordKey{{2, 9, proto::POWER}, 1});
  records.mutable_records(0)->set_content(std::string(16 << 20, '\0'));
  const CodedBatch bomb = EncodeBatch(records);
  ASSERT_LT(bomb.bytes.size(), 10'000u);
  const auto decoded_of = [&](AgentId sender, SharingReceiver::Time at) {
    receiver_.OnHello(sender, Hello(5), at);
    int decoded = 0;
    for (std::uint32_t number = 1; number <= 10; ++number) {
      proto::Message message = Batch(5, number);
      message.mutable_batch()->set_codec(bomb.codec);
      message.mutable_batch()->set_coded(bomb.bytes);
      const auto actions = receiver_.OnBatch(sender, message, at);
      decoded += actions && !actions->empty() ? 1 : 0;
    }
    return decoded;
  };
  EXPECT_EQ(decoded_of(2, now_), 2);
  EXPECT_EQ(receiver_.counts().dropped_messages, 8);
  EXPECT_EQ(decoded_of(3, now_), 2) << "another sender has its own";
  EXPECT_EQ(decoded_of(2, now_ + std::chrono::minutes(1)), 1) << "the second went beyond what it had";
}

TEST_F(SharingReceiverTest, RefusesMessagesOfAnotherTeamOrKind) {
  proto::Hello hello = Hello(10);
  hello.set_team_id("fedcba9876543210");
  EXPECT_EQ(RefusalOf(receiver_.OnHello(2, hello, now_)), ErrorCode::kRefused) << "a team of the same name";
  hello.clear_team_id();
  EXPECT_EQ(RefusalOf(receiver_.OnHello(2, hello, now_)), ErrorCode::kRefused);
  hello = Hello(10);
  hello.set_kind(proto::SHARING_KIND_REPLICATION);
  EXPECT_EQ(RefusalOf(receiver_.OnHello(2, hello, now_)), ErrorCode::kRefused);
  EXPECT_EQ(receiver_.counts().refused_hellos, 3);
}

TEST_F(SharingReceiverTest, RefusesAnotherWireVersionAndNamesBoth) {
  for (const std::uint32_t version : {0u, kWireVersion + 1}) {
    proto::Hello hello = Hello(10);
    hello.set_wire_version(version);
    const SharingActions refused = receiver_.OnHello(2, hello, now_);
    EXPECT_EQ(RefusalOf(refused), ErrorCode::kRefused);
    const std::string text = refused.at(0).message.refusal().error().text();
    EXPECT_NE(text.find("protocol version " + std::to_string(kWireVersion) + ","), std::string::npos) << text;
    EXPECT_NE(text.find("uses version " + std::to_string(version) + ":"), std::string::npos) << text;
  }
  EXPECT_EQ(receiver_.counts().refused_hellos, 2);
}

// The Hello has wire version 42 and contains a field that this program does not know.
TEST_F(SharingReceiverTest, ReadsTheWireVersionOfAnyVersionsHello) {
  proto::Hello hello;
  ASSERT_TRUE(hello.ParseFromString("\x08\x2A\x12\x03tea\x7A\x02no"));
  EXPECT_EQ(hello.wire_version(), 42u);
}

TEST_F(SharingReceiverTest, AcceptsAnotherConfigurationAndRemembersItsAgent) {
  proto::Hello hello = Hello(10);
  hello.set_config_hash(78);
  hello.set_team("renamed");
  EXPECT_TRUE(receiver_.OnHello(2, hello, now_).at(0).message.has_have_request());
  EXPECT_EQ(receiver_.other_configs(), std::set<AgentId>{2});
  (void)receiver_.OnHello(2, Hello(11), now_);
  EXPECT_TRUE(receiver_.other_configs().empty());
}

TEST_F(SharingReceiverTest, RefusesABatchOfAnUnknownSession) {
  EXPECT_EQ(RefusalOf(*receiver_.OnBatch(2, Batch(10, 1), now_)), ErrorCode::kNotFound);
  OpenSession(2, 10);
  EXPECT_EQ(RefusalOf(*receiver_.OnBatch(2, Batch(11, 1), now_)), ErrorCode::kNotFound);
  EXPECT_EQ(RefusalOf(*receiver_.OnBatch(3, Batch(10, 1), now_)), ErrorCode::kNotFound);
}

TEST_F(SharingReceiverTest, AcknowledgesABatchOnlyAfterItsCommit) {
  OpenSession(2, 10);
  const auto stored = receiver_.OnBatch(2, Batch(10, 4), now_);
  ASSERT_TRUE(stored);
  ASSERT_EQ(stored->size(), 1u);
  EXPECT_EQ(stored->at(0).to, 0u);
  EXPECT_EQ(stored->at(0).message.store_request().sender(), 2u);
  proto::StoreReply reply;
  reply.set_stored_count(1);
  reply.mutable_covered()->add_streams()->set_origin_agent(2);
  const SharingActions acknowledged = receiver_.OnStoreReply(stored->at(0).message.request_id(), reply);
  ASSERT_EQ(acknowledged.size(), 1u);
  const proto::Message& message = acknowledged[0].message;
  EXPECT_EQ(acknowledged[0].to, 2u);
  EXPECT_EQ(message.ms_type(), proto::ACKNOWLEDGMENT);
  EXPECT_EQ(message.agent_id(), 2u);
  EXPECT_EQ(message.data_type(), static_cast<std::uint32_t>(proto::POWER));
  EXPECT_EQ(message.record_id(), "2.0000000000000009.2.4");
  EXPECT_EQ(message.remaining(), 5u);
  EXPECT_EQ(message.have().batch_number(), 4u);
  EXPECT_FALSE(message.have().is_whole());
  EXPECT_EQ(receiver_.counts().received_records, 1);
  EXPECT_TRUE(receiver_.OnStoreReply(stored->at(0).message.request_id(), reply).empty());
}

TEST_F(SharingReceiverTest, DoesNotAcknowledgeAFailedCommit) {
  OpenSession(2, 10);
  const auto stored = receiver_.OnBatch(2, Batch(10, 1), now_);
  proto::StoreReply reply;
  reply.mutable_error()->set_code(proto::ERROR_CODE_FULL);
  EXPECT_EQ(RefusalOf(receiver_.OnStoreReply(stored->at(0).message.request_id(), reply)), ErrorCode::kUnavailable);
}

TEST_F(SharingReceiverTest, SharesItsCreditAmongActiveSenders) {
  const auto credit_at_hello = [this](AgentId sender) {
    const std::uint64_t asked = OpenSession(sender, 10);
    return receiver_.OnHaveReply(asked, proto::HaveReply()).at(0).message.have().unacked_bytes_max();
  };
  const auto credit_at_batch = [this](AgentId sender, std::uint32_t number, std::uint64_t remaining) {
    proto::Message batch = Batch(10, number);
    batch.set_remaining(remaining);
    const std::uint64_t asked = receiver_.OnBatch(sender, batch, now_)->at(0).message.request_id();
    return receiver_.OnStoreReply(asked, proto::StoreReply()).at(0).message.have().unacked_bytes_max();
  };
  EXPECT_EQ(credit_at_hello(2), 8192u);
  EXPECT_EQ(credit_at_hello(3), 4096u);
  EXPECT_EQ(credit_at_batch(2, 1, 5), 4096u);
  EXPECT_EQ(credit_at_batch(3, 1, 0), 8192u) << "it has ended";
  EXPECT_EQ(credit_at_batch(2, 2, 5), 8192u);
  EXPECT_EQ(credit_at_hello(3), 4096u);
  now_ += seconds(6);
  EXPECT_EQ(credit_at_batch(2, 3, 5), 8192u) << "the other was silent";
}

TEST_F(SharingReceiverTest, CountsAndDropsDamagedBatches) {
  OpenSession(2, 10);
  proto::Message damaged = Batch(10, 1);
  damaged.mutable_batch()->mutable_coded()->resize(2);
  EXPECT_FALSE(receiver_.OnBatch(2, damaged, now_));
  damaged = Batch(10, 1);
  damaged.mutable_batch()->add_dropped();
  EXPECT_FALSE(receiver_.OnBatch(2, damaged, now_));
  damaged = Batch(10, 1);
  damaged.mutable_batch()->set_record_count(7);
  EXPECT_FALSE(receiver_.OnBatch(2, damaged, now_));
  EXPECT_EQ(receiver_.counts().damaged_messages, 3);
}

TEST_F(SharingReceiverTest, StoresFragmentedRecordsAndReportsHowMuchArrived) {
  const proto::Message whole = Batch(11, 1);
  FragmentCutter cutter({whole.batch().codec(), whole.batch().coded()}, 1, {});
  std::vector<proto::Message> fragments;
  while (!cutter.is_done()) {
    proto::Message& fragment = fragments.emplace_back(whole);
    *fragment.mutable_batch() = cutter.Next(8);
    fragment.mutable_batch()->set_session_id(11);
    fragment.mutable_batch()->set_batch_number(static_cast<std::uint32_t>(fragments.size()));
  }
  ASSERT_GT(fragments.size(), 1u);
  Open(2, 10);
  const std::uint64_t question = OpenSession(2, 11);
  for (std::size_t i = 0; i + 1 < fragments.size(); ++i) {
    const SharingActions acknowledged = *receiver_.OnBatch(2, fragments[i], now_);
    ASSERT_EQ(acknowledged.size(), 1u);
    EXPECT_EQ(acknowledged[0].to, 2u);
    EXPECT_EQ(acknowledged[0].message.have().batch_number(), i + 1);
    EXPECT_FALSE(acknowledged[0].message.have().is_whole());
  }
  const proto::Have have = receiver_.OnHaveReply(question, {})[0].message.have();
  EXPECT_EQ(have.part_hash(), fragments[0].batch().fragment().hash());
  EXPECT_EQ(have.part_bytes(), 8 * (fragments.size() - 1));
  const SharingActions asked = *receiver_.OnBatch(2, fragments.back(), now_);
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(asked[0].message.store_request().records_size(), 1);
  EXPECT_TRUE(receiver_.OnBatch(2, fragments.back(), now_)->empty()) << "a late copy";
  fragments.back().mutable_batch()->set_batch_number(static_cast<std::uint32_t>(fragments.size()) + 1);
  EXPECT_EQ(RefusalOf(*receiver_.OnBatch(2, fragments.back(), now_)), ErrorCode::kNotFound) << "its beginning is gone";
  proto::Message impossible = fragments[0];
  impossible.mutable_batch()->set_batch_number(100);
  impossible.mutable_batch()->mutable_fragment()->set_whole_bytes(UINT64_MAX);
  EXPECT_FALSE(receiver_.OnBatch(2, impossible, now_));
  EXPECT_EQ(receiver_.counts().damaged_messages, 1);
}

TEST_F(SharingReceiverTest, BoundsTheBatchesThatWaitForStorage) {
  Open(2, 10);
  for (std::uint32_t number = 1; number <= 16; ++number) {
    EXPECT_EQ(receiver_.OnBatch(2, Batch(10, number), now_)->size(), 1u);
  }
  EXPECT_TRUE(receiver_.OnBatch(2, Batch(10, 17), now_)->empty());
  EXPECT_EQ(receiver_.counts().dropped_messages, 1);
  OpenSession(2, 11);
  EXPECT_EQ(receiver_.OnBatch(2, Batch(11, 1), now_)->size(), 1u);
}

TEST_F(SharingReceiverTest, IgnoresALateHello) {
  Open(2, 10);
  OpenSession(2, 11);
  EXPECT_TRUE(receiver_.OnHello(2, Hello(10), now_).empty());
  EXPECT_EQ(receiver_.OnBatch(2, Batch(11, 1), now_)->size(), 1u);
  // No radio delays a Hello by a minute. The receiver therefore concludes that the Hello of session 11 was damaged, and
  // accepts session 10.
  now_ += seconds(61);
  EXPECT_EQ(receiver_.OnHello(2, Hello(10), now_).size(), 1u);
}

TEST_F(SharingReceiverTest, AnswersOnlyTheNewestHello) {
  const std::uint64_t first = OpenSession(2, 10);
  for (std::uint64_t session_id = 11; session_id <= 1000; ++session_id) {
    EXPECT_TRUE(receiver_.OnHello(2, Hello(session_id), now_).empty()) << "storage has one question of it";
  }
  const SharingActions next = receiver_.OnHaveReply(first, proto::HaveReply());
  ASSERT_EQ(next.size(), 1u);
  ASSERT_TRUE(next[0].message.has_have_request());
  const SharingActions answer = receiver_.OnHaveReply(next[0].message.request_id(), proto::HaveReply());
  ASSERT_EQ(answer.size(), 1u);
  EXPECT_EQ(answer[0].message.have().session_id(), 1000u);
}

TEST_F(SharingReceiverTest, AsksStorageAgainIfItsAnswerIsLost) {
  OpenSession(2, 10);
  EXPECT_TRUE(receiver_.OnHello(2, Hello(11), now_).empty());
  now_ += seconds(11);
  const SharingActions asked = receiver_.OnHello(2, Hello(12), now_);
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(receiver_.OnHaveReply(asked[0].message.request_id(), proto::HaveReply()).at(0).message.have().session_id(),
            12u);
}

TEST_F(SharingReceiverTest, AsksStorageOnceForARepeatedHello) {
  const std::uint64_t asked = OpenSession(2, 10);
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(receiver_.OnHello(2, Hello(10), now_).empty());
  EXPECT_EQ(receiver_.OnHaveReply(asked, proto::HaveReply()).size(), 1u);
}

TEST_F(SharingReceiverTest, BoundsSessionsAndReplacesSilentOnes) {
  for (AgentId sender = 1; sender <= 16; ++sender) OpenSession(sender, 10);
  EXPECT_EQ(RefusalOf(receiver_.OnHello(17, Hello(10), now_)), ErrorCode::kFull);
  now_ += seconds(59);
  OpenSession(2, 11);
  now_ += seconds(2);
  EXPECT_TRUE(receiver_.OnHello(17, Hello(10), now_).at(0).message.has_have_request());
  EXPECT_EQ(RefusalOf(*receiver_.OnBatch(1, Batch(10, 1), now_)), ErrorCode::kNotFound);
  EXPECT_EQ(receiver_.OnBatch(2, Batch(11, 1), now_)->size(), 1u);
}

TEST_F(SharingReceiverTest, GrantsEachSenderItsPartOfTheBudget) {
  SharingReceiver::Options options = Options();
  options.bytes_per_second_max = 12'000;
  SharingReceiver receiver(options, 500);
  const auto granted_to = [&](AgentId sender) {
    const auto asked = receiver.OnHello(sender, Hello(now_.time_since_epoch().count() + 10), now_);
    return receiver.OnHaveReply(asked[0].message.request_id(), {})[0].message.have().bytes_per_second_max();
  };
  EXPECT_EQ(granted_to(2), 12'000u);
  EXPECT_EQ(granted_to(3), 6'000u);
  receiver.SetMovingElsewhere(2);
  now_ += seconds(4);
  EXPECT_EQ(granted_to(4), 2'400u) << "two beside these three";
  EXPECT_EQ(receiver.MovingSessions(now_), 3u);
  now_ += seconds(4);
  EXPECT_EQ(receiver.MovingSessions(now_), 1u) << "who is silent gives its part back";
  receiver.SetMovingElsewhere(23);
  EXPECT_EQ(granted_to(5), 480u);
  now_ += seconds(18);
  EXPECT_EQ(receiver.MovingSessions(now_), 1u) << "so slow a sender is heard that seldom";
  now_ += seconds(1);
  EXPECT_EQ(receiver.MovingSessions(now_), 0u);
  receiver.SetMovingElsewhere(2);
  EXPECT_EQ(granted_to(4), 4'000u);
  proto::Message last = Batch(now_.time_since_epoch().count() + 10, 1);
  last.set_remaining(0);
  ASSERT_TRUE(receiver.OnBatch(4, last, now_));
  EXPECT_EQ(receiver.MovingSessions(now_), 0u) << "and the one that reported its end";
}

TEST_F(SharingReceiverTest, SendsItsSchemasToASenderWithOthers) {
  SharingReceiver::Options options = Options();
  options.schemas = SchemasOf({});
  SharingReceiver receiver(options, 500);
  const auto answer_to = [&](AgentId sender, std::uint64_t schema_hash) {
    proto::Hello hello = Hello(10);
    hello.set_schema_hash(schema_hash);
    const auto asked = receiver.OnHello(sender, hello, now_);
    return receiver.OnHaveReply(asked[0].message.request_id(), {})[0].message.have();
  };
  EXPECT_TRUE(answer_to(2, HashSchemas(options.schemas)).schemas().empty());
  EXPECT_EQ(answer_to(3, 5).schemas_size(), options.schemas.size());
}

TEST_F(SharingReceiverTest, ReadsARunInOrderAndOtherwiseRequestsANewOne) {
  Open(2, 10);
  const std::vector<proto::Message> run = RunOf(10, 4);
  EXPECT_TRUE(IsStored(run[0]));
  EXPECT_TRUE(IsStored(run[1]));
  EXPECT_TRUE(IsNewRunAskedFor(run[3]));
  EXPECT_TRUE(IsStored(run[2])) << "it came late";
  EXPECT_TRUE(IsStored(run[3]));
  EXPECT_EQ(receiver_.counts().damaged_messages, 0);
}

TEST_F(SharingReceiverTest, LateCopiesDoNotChangeARun) {
  Open(2, 10);
  const std::vector<proto::Message> run = RunOf(10, 3);
  EXPECT_TRUE(IsStored(run[0]));
  EXPECT_TRUE(IsStored(run[1]));
  EXPECT_TRUE(IsStored(run[0])) << "it can be read by itself";
  const auto late = receiver_.OnBatch(2, run[1], now_);
  ASSERT_TRUE(late);
  EXPECT_TRUE(late->empty());
  EXPECT_TRUE(IsStored(run[2]));
}

TEST_F(SharingReceiverTest, ADamagedBatchEndsItsRun) {
  Open(2, 10);
  std::vector<proto::Message> run = RunOf(10, 3);
  EXPECT_TRUE(IsStored(run[0]));
  std::string& coded = *run[1].mutable_batch()->mutable_coded();
  coded[coded.size() / 2] = static_cast<char>(coded[coded.size() / 2] ^ 1);
  EXPECT_FALSE(receiver_.OnBatch(2, run[1], now_));
  EXPECT_EQ(receiver_.counts().damaged_messages, 1);
  EXPECT_TRUE(IsNewRunAskedFor(run[2]));
}

TEST_F(SharingReceiverTest, KeepsRunsFromSessionToSession) {
  Open(2, 10);
  std::vector<proto::Message> run = RunOf(10, 2);
  run[0].set_remaining(0);
  EXPECT_TRUE(IsStored(run[0]));
  Open(2, 11);
  run[1].mutable_batch()->set_session_id(11);
  EXPECT_TRUE(IsStored(run[1]));
}

TEST_F(SharingReceiverTest, DistinguishesRunsByTheirNumbers) {
  Open(2, 10);
  std::vector<proto::Message> run = RunOf(10, 2);
  EXPECT_TRUE(IsStored(run[0]));
  run[1].mutable_batch()->set_run(8);
  EXPECT_TRUE(IsNewRunAskedFor(run[1])) << "run 8 has as many maps before it as are here of run 7";
  run[1].mutable_batch()->set_run(7);
  EXPECT_TRUE(IsStored(run[1]));
}

TEST_F(SharingReceiverTest, ABatchWithoutMapsMayOvertakeOneOfARun) {
  Open(2, 10);
  const std::vector<proto::Message> run = RunOf(10, 2);
  EXPECT_TRUE(IsStored(run[0]));
  EXPECT_TRUE(IsStored(Batch(10, 3)));
  EXPECT_TRUE(IsStored(run[1]));
}

TEST_F(SharingReceiverTest, KeepsRunsOfALimitedNumberOfSendersAndInformsTheOthers) {
  SharingReceiver::Options options = Options();
  options.run_places_max = 2;
  receiver_ = SharingReceiver(options, 500);
  const std::vector<proto::Message> run = RunOf(10, 2);
  const auto is_run_kept = [this](AgentId sender) { return Open(sender, 10).keeps_runs(); };
  EXPECT_TRUE(is_run_kept(2));
  EXPECT_TRUE(is_run_kept(3));
  EXPECT_FALSE(is_run_kept(4));
  for (const AgentId sender : {2u, 3u, 4u}) EXPECT_TRUE(IsStored(run[0], sender));
  EXPECT_TRUE(IsStored(run[1], 2));
  EXPECT_TRUE(IsStored(run[1], 3));
  now_ += options.idle_after + seconds(1);
  EXPECT_TRUE(is_run_kept(4)) << "the others were silent";
}

}  // namespace
}  // namespace moondb
