#include "actors/sharing/radio_share.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(RadioShareTest, GivesEachMovingSessionAnEqualPart) {
  RadioShare share(12'000);
  EXPECT_EQ(share.Part(0), 12'000) << "whoever begins has all of it";
  EXPECT_EQ(share.Part(3), 4'000);
  share.HearElsewhere(1);
  EXPECT_EQ(share.Part(3), 3'000);
  EXPECT_FALSE(RadioShare(0).is_limited());
}

TEST(RadioShareTest, TellsTheOtherActorOfEachChangeAndAgainWhereItBeganAnew) {
  RadioShare share(12'000);
  EXPECT_TRUE(share.MustTell(0)) << "it has heard nothing yet";
  share.NoteTold(0);
  EXPECT_FALSE(share.MustTell(0));
  share.HearElsewhere(0);
  EXPECT_FALSE(share.MustTell(0)) << "or two idle actors would tell each other for ever";
  share.NoteTold(2);
  EXPECT_FALSE(share.MustTell(2));
  share.HearElsewhere(3);
  EXPECT_FALSE(share.MustTell(2));
  share.HearElsewhere(0);
  EXPECT_TRUE(share.MustTell(2)) << "it may not know";
}

}  // namespace
}  // namespace moondb
