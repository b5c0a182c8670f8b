#include "actors/sharing/fragments.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace moondb {
namespace {

constexpr AgentId kSender = 2;

std::string Noise(std::size_t size) {
  static std::mt19937_64 rng(1);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(rng());
  return bytes;
}

std::vector<proto::Batch> Cut(const std::string& bytes, std::size_t bytes_max, const PartOfWhole& covered = {}) {
  FragmentCutter cutter({proto::CODEC_PLAIN, bytes}, 1, covered);
  std::vector<proto::Batch> fragments;
  while (!cutter.is_done()) fragments.push_back(cutter.Next(bytes_max));
  return fragments;
}

TEST(FragmentsTest, MakeUpTheWhole) {
  const std::string whole = Noise(10'001);
  const auto fragments = Cut(whole, 1000);
  ASSERT_EQ(fragments.size(), 11u);
  FragmentCollector collector(100'000);
  for (std::size_t i = 0; i < fragments.size(); ++i) {
    EXPECT_EQ(fragments[i].record_count(), 1u);
    const auto taken = collector.Take(kSender, fragments[i]);
    ASSERT_TRUE(taken);
    EXPECT_EQ(*taken, i == 10 ? std::optional<std::string>(whole) : std::nullopt);
  }
  EXPECT_EQ(collector.PartFrom(kSender).hash, 0u);
}

TEST(FragmentsTest, ResumeAfterALinkFailure) {
  const std::string whole = Noise(10'000);
  FragmentCollector collector(100'000);
  const auto fragments = Cut(whole, 1000);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(collector.Take(kSender, fragments[i]));
  EXPECT_EQ(collector.PartFrom(kSender).bytes, 4000u);
  const auto rest = Cut(whole, 3000, collector.PartFrom(kSender));
  ASSERT_EQ(rest.size(), 2u);
  EXPECT_EQ(rest[0].fragment().first_byte(), 4000u);
  ASSERT_TRUE(collector.Take(kSender, rest[0]));
  ASSERT_TRUE(collector.Take(kSender, fragments[5])) << "one that came before";
  EXPECT_EQ(**collector.Take(kSender, rest[1]), whole);
  EXPECT_EQ(Cut(Noise(10'000), 1000, {1234, 4000}).size(), 10u) << "of another whole";
  EXPECT_EQ(Cut(whole, 1000, {rest[0].fragment().hash(), 10'000}).size(), 10u) << "more than there can be";
}

TEST(FragmentsTest, NeedTheFragmentsBeforeThem) {
  FragmentCollector collector(100'000);
  const auto fragments = Cut(Noise(10'000), 1000);
  EXPECT_EQ(collector.Take(kSender, fragments[1]).error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(collector.Take(kSender, fragments[0]));
  EXPECT_EQ(collector.Take(kSender, fragments[2]).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(collector.Take(kSender, Cut(Noise(10'000), 1000)[1]).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(collector.PartFrom(kSender).bytes, 1000u);
  EXPECT_EQ(collector.PartFrom(3).bytes, 0u);
}

TEST(FragmentsTest, RestartAfterAPartThatStatesAWrongSize) {
  const std::string whole = Noise(3000);
  FragmentCollector collector(100'000);
  proto::Batch wrong = Cut(whole, 1000)[0];
  wrong.mutable_fragment()->set_whole_bytes(4000);
  ASSERT_TRUE(collector.Take(kSender, wrong));
  const auto rest = Cut(whole, 1000, collector.PartFrom(kSender));
  ASSERT_EQ(rest[0].fragment().first_byte(), 1000u);
  EXPECT_EQ(collector.Take(kSender, rest[0]).error().code, ErrorCode::kNotFound);
  const auto second = Cut(whole, 3000, collector.PartFrom(kSender));
  ASSERT_EQ(second.size(), 1u) << "the part is not reported again";
  EXPECT_EQ(**collector.Take(kSender, second[0]), whole);
}

TEST(FragmentsTest, RejectInvalidFragments) {
  FragmentCollector collector(5'000);
  const proto::Batch good = Cut(Noise(3000), 1000)[0];
  const auto broken = [&](auto change) {
    proto::Batch batch = good;
    change(batch);
    const auto taken = collector.Take(kSender, batch);
    return !taken && taken.error().code == ErrorCode::kCorrupt;
  };
  EXPECT_TRUE(broken([](proto::Batch& batch) { batch.mutable_fragment()->set_hash(0); }));
  EXPECT_TRUE(broken([](proto::Batch& batch) { batch.mutable_fragment()->set_whole_bytes(5'001); }));
  EXPECT_TRUE(broken([](proto::Batch& batch) { batch.mutable_fragment()->set_whole_bytes(999); }));
  EXPECT_TRUE(broken([](proto::Batch& batch) { batch.mutable_fragment()->set_first_byte(2'500); }));
  EXPECT_TRUE(broken([](proto::Batch& batch) { batch.mutable_fragment()->set_first_byte(UINT64_MAX - 10); }));
  EXPECT_TRUE(broken([](proto::Batch& batch) { batch.clear_coded(); }));
  EXPECT_FALSE(broken([](proto::Batch&) {}));
}

TEST(FragmentsTest, OneSenderUsesNoMoreSpaceThanTheLargestRecord) {
  FragmentCollector collector(5'000, 2'000);
  EXPECT_EQ(collector.Take(kSender, Cut(Noise(2001), 1000)[0]).error().code, ErrorCode::kCorrupt);
  for (int i = 0; i < 2; ++i) {
    const auto fragments = Cut(Noise(2000), 1500);
    ASSERT_TRUE(collector.Take(kSender, fragments[0]));
    EXPECT_EQ(collector.PartFrom(kSender).hash, fragments[0].fragment().hash()) << "in place of the one before";
    ASSERT_TRUE(collector.Take(3, Cut(Noise(1500), 1500)[0])) << "whole at once";
  }
}

TEST(FragmentsTest, DetectARecordThatDoesNotMatchItsHash) {
  FragmentCollector collector(100'000);
  auto fragments = Cut(Noise(2000), 1000);
  (*fragments[0].mutable_coded())[7] ^= 1;
  ASSERT_TRUE(collector.Take(kSender, fragments[0]));
  EXPECT_EQ(collector.Take(kSender, fragments[1]).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(collector.PartFrom(kSender).bytes, 0u) << "begins anew";
}

TEST(FragmentsTest, EvictTheOldestPartialRecordIfThereIsNoRoom) {
  FragmentCollector collector(5'000);
  const auto first = Cut(Noise(4000), 1000);
  const auto second = Cut(Noise(4000), 1000);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(collector.Take(2, first[i]));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(collector.Take(3, second[i]));
  EXPECT_EQ(collector.PartFrom(2).bytes, 0u);
  EXPECT_EQ(collector.PartFrom(3).bytes, 3000u);
  EXPECT_EQ(collector.Take(2, first[3]).error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(**collector.Take(3, second[3]) != "");
}

TEST(FragmentsTest, ABufferCountsAllBytesEverWrittenToIt) {
  FragmentCollector collector(5'000);
  const auto first = Cut(Noise(4000), 1000);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(collector.Take(2, first[i]));
  ASSERT_TRUE(collector.Take(2, Cut(Noise(4000), 1000)[0])) << "in the buffer of the first";
  const auto other = Cut(Noise(4000), 1000);
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(collector.Take(3, other[i]));
  EXPECT_EQ(collector.PartFrom(2).bytes, 1000u);
  ASSERT_TRUE(collector.Take(3, other[2]));
  EXPECT_EQ(collector.PartFrom(2).bytes, 0u);
  EXPECT_EQ(collector.PartFrom(3).bytes, 3000u);
}

}  // namespace
}  // namespace moondb
