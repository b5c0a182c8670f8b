// Runs each decoder on its corpus and on random mutations of the corpus. The environment variable MOONDB_FUZZ_RUNS
// sets the number of mutations per decoder (default: 200). MOONDB_FUZZ_SEED sets the seed of the mutations
// (default: random).
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>
#include <sstream>

#include "tests/actors/sharing/mutator.h"
#include "tests/fuzz/decoders.h"

namespace moondb {
namespace {

std::uint64_t Setting(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

std::vector<std::string> CorpusOf(const char* decoder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(MOONDB_FUZZ_CORPUS) / decoder)) {
    paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<std::string> corpus;
  for (const std::filesystem::path& path : paths) {
    std::ostringstream bytes;
    bytes << std::ifstream(path, std::ios::binary).rdbuf();
    corpus.push_back(bytes.str());
  }
  return corpus;
}

class FuzzSmokeTest : public testing::TestWithParam<FuzzedDecoder> {};

TEST_P(FuzzSmokeTest, SurvivesItsCorpusAndMutationsOfIt) {
  const std::uint64_t seed = Setting("MOONDB_FUZZ_SEED", std::random_device()());
  std::cout << "seed " << seed << std::endl;
  Mutator mutator(seed);
  const std::vector<std::string> corpus = CorpusOf(GetParam().name);
  ASSERT_FALSE(corpus.empty());
  for (const std::string& bytes : corpus) GetParam().run(bytes);
  for (std::uint64_t left = Setting("MOONDB_FUZZ_RUNS", 200); left > 0; --left) {
    std::string bytes = corpus[mutator.Draw(corpus.size())];
    if (mutator.Draw(8) == 0) bytes = mutator.Bytes(300);
    mutator.Mutate(bytes);
    GetParam().run(bytes);
  }
}

INSTANTIATE_TEST_SUITE_P(Decoders, FuzzSmokeTest, testing::ValuesIn(FuzzedDecoders()),
                         [](const auto& decoder) { return std::string(decoder.param.name); });

}  // namespace
}  // namespace moondb
