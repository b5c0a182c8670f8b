#include "actors/sharing/coding/trained_tables.h"

#include <algorithm>
#include <array>

#include "model/check.h"

namespace moondb {

namespace {

// Printable characters that need no escape in a string literal.
constexpr std::string_view kAlphabet =
    "!#$%&'()*+,-./0123456789:;<=>@ABCDEFGHIJKLMNOPQRSTUVWXYZ[]^_`abcdefghijklmnopqrstuvwxyz{|}~";

// A trained slot is written as one character: its logit in steps of kLevelStep. Logits have the unit 1/256
// (logistic.h), so a step is a logit of 0.5.
constexpr int kLevelStep = 128;
constexpr int kLevelMax = 20;
constexpr int kLevels = 2 * kLevelMax + 1;
// The initial count of each trained slot at the start of a run. The count is low, so the model adapts quickly: the
// first maps of a run predict its later maps better than the training maps do.
constexpr int kTrainedCount = 11;
constexpr std::uint32_t kCountMin = 5;  // Slots with a lower count are written as untrained.
// The characters of kAlphabet after the first kLevels stand for 1, 2, 4, ... untrained slots in a row.
constexpr std::array<std::size_t, 8> kRuns = {1, 2, 4, 8, 16, 64, 256, 1024};
static_assert(kLevels + kRuns.size() <= kAlphabet.size());

// A weight or a rare probability is written as two characters.
constexpr int kWeightStep = 8;
constexpr int kBase = 91;
constexpr int kTableWeightMax = kBase * kBase / 2;
static_assert(kBase <= kAlphabet.size());

std::array<int, 256> MakeDigits() {
  std::array<int, 256> digits;
  digits.fill(-1);
  for (std::size_t i = 0; i < kAlphabet.size(); ++i)
    digits[static_cast<unsigned char>(kAlphabet[i])] = static_cast<int>(i);
  return digits;
}

// Returns false for a weight whose input is always 0.
bool IsUsed(std::size_t weight, std::size_t weight_count) {
  return weight % kInputs <= (weight < weight_count / 2 ? kModelsAlone : kModelsWithPrevious);
}

void WriteUnseen(std::size_t count, std::string& text) {
  for (std::size_t i = kRuns.size(); i-- > 0;) {
    for (; count >= kRuns[i]; count -= kRuns[i]) text.push_back(kAlphabet[kLevels + i]);
  }
}

void WritePair(int value, std::string& text) {
  const std::size_t number =
      static_cast<std::size_t>(std::clamp(value, -kTableWeightMax, kTableWeightMax) + kTableWeightMax);
  text.push_back(kAlphabet[number / kBase]);
  text.push_back(kAlphabet[number % kBase]);
}

// Divides `value` by `step` and rounds to the nearest integer.
int Steps(int value, int step) { return (value + (value < 0 ? -step : step) / 2) / step; }

class Reader {
 public:
  explicit Reader(std::string_view text) : digits_(MakeDigits()), text_(text) {}

  int Digit() {
    Check(next_ < text_.size(), "trained tables are complete");
    const int digit = digits_[static_cast<unsigned char>(text_[next_++])];
    Check(digit >= 0, "trained tables hold their own characters only");
    return digit;
  }
  int Pair() {
    const int high = Digit();
    return high * kBase + Digit() - kTableWeightMax;
  }
  bool IsAtEnd() const { return next_ == text_.size(); }

 private:
  std::array<int, 256> digits_;
  std::string_view text_;
  std::size_t next_ = 0;
};

void ReadSlots(Reader& reader, std::vector<BitModel::Slot>& slots) {
  for (std::size_t i = 0; i < slots.size();) {
    const int digit = reader.Digit();
    if (digit >= kLevels) {
      i += kRuns[static_cast<std::size_t>(digit - kLevels)];
      continue;
    }
    slots[i] = BitModel::Slot(Squash((digit - kLevelMax) * kLevelStep), kTrainedCount);
    ++i;
  }
}

}  // namespace

std::string WriteTables(BitModel& model) {
  std::string text;
  std::size_t unseen = 0;
  for (const BitModel::Slot& slot : model.slots()) {
    if (slot.count() < kCountMin) {
      ++unseen;
      continue;
    }
    WriteUnseen(unseen, text);
    unseen = 0;
    const int level =
        std::clamp(Steps(Stretch(static_cast<int>(slot.p())), kLevelStep), -kLevelMax, kLevelMax) + kLevelMax;
    text.push_back(kAlphabet[static_cast<std::size_t>(level)]);
  }
  WriteUnseen(unseen, text);
  const std::vector<std::int16_t>& weights = model.weights();
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (IsUsed(i, weights.size())) WritePair(Steps(weights[i], kWeightStep), text);
  }
  for (const std::uint16_t rare : model.rare()) WritePair(rare, text);
  return text;
}

BitModel ReadTables(std::string_view text) {
  BitModel model;
  Reader reader(text);
  ReadSlots(reader, model.slots());
  std::vector<std::int16_t>& weights = model.weights();
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (IsUsed(i, weights.size())) weights[i] = static_cast<std::int16_t>(reader.Pair() * kWeightStep);
  }
  for (std::uint16_t& rare : model.rare()) rare = static_cast<std::uint16_t>(std::max(reader.Pair(), 1));
  Check(reader.IsAtEnd(), "trained tables are not too long");
  return model;
}

const BitModel& TrainedModel() {
  static const BitModel kModel = kTrainedTables.empty() ? BitModel() : ReadTables(kTrainedTables);
  return kModel;
}

}  // namespace moondb
