#include "model/event.h"

#include <gmock/gmock.h>

#include "proto/status.pb.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<std::string> TextsOf(const std::vector<OwnEvent>& events) {
  std::vector<std::string> texts;
  for (const proto::HealthFinding& finding : FindingsOf(events)) texts.push_back(finding.text());
  return texts;
}

OwnEvent Damage(std::int64_t timestamp_ns, const std::string& text = "damaged") {
  return {timestamp_ns, proto::EVENT_KIND_DAMAGE, text};
}

OwnEvent Lost(std::int64_t timestamp_ns, const std::string& text) {
  return {timestamp_ns, proto::EVENT_KIND_LOST, text};
}

OwnEvent Acknowledged(std::int64_t timestamp_ns, std::int64_t until_ns) {
  return {timestamp_ns, proto::EVENT_KIND_ACKNOWLEDGED, AcknowledgedText(until_ns, 1)};
}

TEST(FindingsTest, AreDamageAndLossesUntilTheyAreAcknowledged) {
  const std::vector<OwnEvent> events = {{1, proto::EVENT_KIND_STARTED, "started"},
                                        Damage(2),
                                        {3, proto::EVENT_KIND_COMMAND, "stop"},
                                        Lost(4, kEndedWithoutStopping)};
  EXPECT_THAT(TextsOf(events), ElementsAre("damaged", kEndedWithoutStopping));
  std::vector<OwnEvent> acknowledged = events;
  acknowledged.push_back(Acknowledged(5, 4));
  EXPECT_THAT(TextsOf(acknowledged), IsEmpty());
  acknowledged.push_back(Damage(6, "again"));
  EXPECT_THAT(TextsOf(acknowledged), ElementsAre("again"));
}

TEST(FindingsTest, FindingsDuringAnAcknowledgmentStay) {
  EXPECT_THAT(TextsOf({Damage(2, "read"), Damage(7, "not read"), Acknowledged(8, 2)}), ElementsAre("not read"));
}

TEST(FindingsTest, AnAcknowledgmentUnderAClockThatWasAheadHidesNothingLater) {
  EXPECT_THAT(TextsOf({Damage(9000, "ahead"), Acknowledged(9001, 9000), Damage(5, "later")}), ElementsAre("later"));
}

TEST(FindingsTest, APeersReturnReplacesItsLoss) {
  const std::string lost = LostPeerText("rover2");
  const std::string back = BackPeerText("rover2", 240);
  EXPECT_EQ(lost, "rover2 was lost");
  EXPECT_EQ(back, "rover2 was lost for 240 s, and is back");
  EXPECT_EQ(BackPeerText("rover2", 7200), "rover2 was lost for 120 min, and is back");
  EXPECT_THAT(TextsOf({Lost(1, lost), Lost(2, back)}), ElementsAre(back));
  EXPECT_THAT(TextsOf({Lost(1, lost), Lost(2, back), Lost(3, lost)}), ElementsAre("rover2 was lost (2 times)"));
  EXPECT_THAT(TextsOf({Lost(1, lost), Lost(2, LostPeerText("rover22"))}), ElementsAre(lost, "rover22 was lost"));
  EXPECT_THAT(TextsOf({Lost(1, lost), Acknowledged(2, 1), Lost(3, back)}), IsEmpty());
  EXPECT_TRUE(SaysLost("rover2 was lost (2 times)", "rover2"));
  EXPECT_FALSE(SaysLost(back, "rover2"));
  EXPECT_FALSE(SaysLost(LostPeerText("rover22"), "rover2"));
}

TEST(FindingsTest, CountWhatHappensAgainAndAreBounded) {
  std::vector<OwnEvent> events;
  for (int i = 1; i <= 5; ++i) events.push_back(Lost(i, kEndedWithoutStopping));
  EXPECT_THAT(TextsOf(events), ElementsAre("the previous process ended without a clean stop (5 times)"));
  for (int i = 0; i < 100; ++i) events.push_back(Damage(10 + i, std::to_string(i)));
  EXPECT_EQ(FindingsOf(events).size(), kFindingsMax);
  EXPECT_EQ(FindingsOf(events).back().text(), "99");
}

TEST(FindingsTest, AnUnreadableAcknowledgmentDoesNotCount) {
  EXPECT_EQ(AcknowledgedUntil(AcknowledgedText(123, 2)), 123);
  for (const char* text : {"", "up to timestamp", "up to timestamp x", "up to timestamp 99999999999999999999"}) {
    EXPECT_FALSE(AcknowledgedUntil(text)) << text;
  }
}

}  // namespace
}  // namespace moondb
