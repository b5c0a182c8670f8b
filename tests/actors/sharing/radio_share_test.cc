#include "actors/sharing/radio_share.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(RadioShareTest, GivesEachActiveSessionAnEqualPart) {
  RadioShare share(12'000);
  EXPECT_EQ(share.Part(0), 12'000) << "the first session has all of it";
  EXPECT_EQ(share.Part(3), 4'000);
  share.SetMovingElsewhere(1);
  EXPECT_EQ(share.Part(3), 3'000);
  EXPECT_FALSE(RadioShare(0).is_limited());
}

TEST(RadioShareTest, NotifiesTheOtherActorOfEachChangeAndAgainAfterItsRestart) {
  RadioShare share(12'000);
  EXPECT_TRUE(share.MustNotify(0)) << "it has heard nothing yet";
  share.ObserveNotified(0);
  EXPECT_FALSE(share.MustNotify(0));
  share.SetMovingElsewhere(0);
  EXPECT_FALSE(share.MustNotify(0)) << "or two idle actors would notify each other permanently";
  share.ObserveNotified(2);
  EXPECT_FALSE(share.MustNotify(2));
  share.SetMovingElsewhere(3);
  EXPECT_FALSE(share.MustNotify(2));
  share.SetMovingElsewhere(0);
  EXPECT_TRUE(share.MustNotify(2)) << "it may not know";
}

}  // namespace
}  // namespace moondb
