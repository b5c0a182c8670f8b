// Tests have-sets that are sent in pages. A session requests its destination's have-set page by page.
#include <gtest/gtest.h>

#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

using std::chrono::seconds;

// Maximum size of a page in bytes. About four streams fit into one page.
constexpr std::size_t kPageBytes = 100;

class HavePagesTest : public SessionFixture {
 protected:
  HavePagesTest() {
    for (std::uint64_t epoch = 1; epoch <= 20; ++epoch) destination_.Insert(kSelf, proto::POWER, "p", epoch);
    for (std::uint64_t epoch = 1; epoch <= 21; ++epoch) source_.Insert(kSelf, proto::POWER, "p", epoch);
  }

  // Returns the destination's answer to `hello`: the requested page of the destination's have-set.
  proto::Have PageFor(const proto::Hello& hello) const {
    proto::HaveRequest request;
    *request.mutable_from() = hello.have_from();
    request.set_bytes_max(kPageBytes);
    const proto::HaveReply reply = destination_.Have(request);
    proto::Have page;
    page.set_session_id(hello.session_id());
    page.set_is_whole(true);
    page.set_unacked_bytes_max(credit_);
    *page.mutable_have() = reply.have();
    if (hello.has_have_from()) *page.mutable_have_from() = hello.have_from();
    if (reply.has_next()) *page.mutable_have_next() = reply.next();
    return page;
  }

  // Returns the Hello that the session sent. Expects that the session sent no other message since the last call.
  proto::Hello NextHello() {
    const auto sent = TakeSent();
    EXPECT_EQ(sent.size(), 1u);
    EXPECT_TRUE(!sent.empty() && sent.back().has_hello());
    return sent.empty() ? proto::Hello() : sent.back().hello();
  }

  // Answers each Hello with the requested page, until the session sends another kind of message. Returns the number of
  // pages.
  int AnswerAll() {
    int pages = 0;
    for (; !sent_.empty() && sent_.back().has_hello(); ++pages) Take(session_.OnHave(PageFor(NextHello()), now_));
    return pages;
  }

  void ExpectOneRecordMoreAndTheEnd() {
    std::uint32_t count = 0;
    for (const auto& message : RunToEnd()) count += message.batch().record_count();
    EXPECT_EQ(count, 1u);
    EXPECT_EQ(destination_.have(), source_.have());
    EXPECT_FALSE(session_.is_open());
  }
};

TEST_F(HavePagesTest, AreRequestedOneAfterTheOther) {
  Order();
  EXPECT_GE(AnswerAll(), 4);
  ExpectOneRecordMoreAndTheEnd();
  EXPECT_EQ(Status().resends(), 0);
  EXPECT_EQ(Status().refused_haves(), 0);
}

TEST_F(HavePagesTest, OnlyALostPageIsRequestedAgain) {
  Order();
  Take(session_.OnHave(PageFor(NextHello()), now_));
  const proto::Hello lost = NextHello();
  Advance(seconds(6));
  const proto::Hello again = NextHello();
  EXPECT_EQ(again.session_id(), lost.session_id());
  EXPECT_EQ(FromProto(again.have_from()), FromProto(lost.have_from()));
  EXPECT_NE(FromProto(again.have_from()), RecordKey());
  Take(session_.OnHave(PageFor(again), now_));
  AnswerAll();
  ExpectOneRecordMoreAndTheEnd();
}

TEST_F(HavePagesTest, ReceivedPagesSurviveALinkFailure) {
  Order();
  Take(session_.OnHave(PageFor(NextHello()), now_));
  const RecordKey waited_for = FromProto(NextHello().have_from());
  Advance(std::chrono::minutes(10));
  TakeSent();
  Take(session_.OnConnected(now_));
  EXPECT_EQ(FromProto(PageFor(sent_.back().hello()).have_from()), waited_for);
  AnswerAll();
  ExpectOneRecordMoreAndTheEnd();
}

TEST_F(HavePagesTest, RepeatedAndLatePagesChangeNothing) {
  Order();
  std::vector<proto::Have> before;
  while (!sent_.empty() && sent_.back().has_hello()) {
    before.push_back(PageFor(NextHello()));
    Take(session_.OnHave(before.back(), now_));
    const std::size_t sent = sent_.size();
    if (sent_.back().has_batch()) break;
    for (const proto::Have& page : before) Take(session_.OnHave(page, now_));
    EXPECT_EQ(sent_.size(), sent) << "a page that came twice is not answered";
  }
  // All pages arrive once more, during the transfer of records. The pages still report correctly which records the
  // destination has, so the session does not refuse these pages.
  for (const proto::Have& page : before) Take(session_.OnHave(page, now_));
  ExpectOneRecordMoreAndTheEnd();
  EXPECT_EQ(Status().refused_haves(), 0);
}

TEST_F(HavePagesTest, PagesOfAnEarlierSessionAreIgnored) {
  Order();
  const proto::Have old = PageFor(NextHello());
  Advance(seconds(6));
  const proto::Hello hello = NextHello();
  EXPECT_NE(hello.session_id(), old.session_id());
  Take(session_.OnHave(old, now_));
  EXPECT_TRUE(sent_.empty());
}

// A destination that restarted may have lost its disk. The pages that it sent before may name records that are lost
// now.
TEST_F(HavePagesTest, AreRequestedFromTheFirstOnceTheDestinationRestarted) {
  Order();
  Take(session_.OnHave(PageFor(NextHello()), now_));
  destination_ = MemoryStore();
  proto::Refusal refusal;
  refusal.set_session_id(NextHello().session_id());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_NOT_FOUND);
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_FALSE(sent_.back().hello().has_have_from());
  AnswerAll();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(HavePagesTest, AreNotRequestedInAShutWindowAndContinueAfterIt) {
  Order();
  const proto::Hello first = NextHello();
  Take(session_.SetWindow(SharingSession::Window::kShut, now_));
  Take(session_.OnHave(PageFor(first), now_));
  Advance(seconds(60));
  EXPECT_TRUE(sent_.empty());
  Take(session_.SetWindow(SharingSession::Window::kOpen, now_));
  EXPECT_TRUE(sent_.back().hello().has_have_from());
  AnswerAll();
  ExpectOneRecordMoreAndTheEnd();
}

TEST_F(HavePagesTest, AreRequestedFromTheFirstIfAnOrderCoversMore) {
  proto::RecordFilter own;
  own.add_origin_agents(kSelf);
  Take(session_.Order(own, now_));
  Take(session_.OnHave(PageFor(NextHello()), now_));
  NextHello();
  Order();
  EXPECT_FALSE(NextHello().has_have_from());
}

TEST_F(HavePagesTest, AreRequestedFromTheFirstAfterADelayIfOneIsInvalid) {
  Order();
  Take(session_.OnHave(PageFor(NextHello()), now_));
  proto::Have bad = PageFor(NextHello());
  *bad.mutable_have_next() = bad.have_from();
  Take(session_.OnHave(bad, now_));
  EXPECT_TRUE(sent_.empty());
  EXPECT_EQ(Status().refused_haves(), 1);
  Advance(seconds(6));
  EXPECT_FALSE(sent_.back().hello().has_have_from());
  AnswerAll();
  ExpectOneRecordMoreAndTheEnd();
}

}  // namespace
}  // namespace moondb
