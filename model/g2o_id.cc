#include "model/g2o_id.h"

#include "model/pyfg.h"

namespace moondb {

namespace {

constexpr int kLetterShift = 56;
constexpr int kLabelShift = 48;

}  // namespace

std::uint64_t SymbolOf(const NodeKey& key) {
  return std::uint64_t{static_cast<unsigned char>(LetterOfAgent(key.agent))} << kLetterShift | key.index;
}

std::optional<NodeKey> NodeOfId(std::uint64_t id) {
  const auto letter = static_cast<char>(id >> kLetterShift);
  const auto label = static_cast<char>(id >> kLabelShift);
  const std::uint64_t index = id & kSymbolIndexMax;
  if (letter == 0 && id <= kPlainIdMax) return NodeKey{0, id};
  if (letter != 0 && AgentOfLetter(letter) == 0) return std::nullopt;
  const AgentId agent = AgentOfLetter(label == 0 ? letter : label);
  if (agent == 0) return std::nullopt;
  return NodeKey{agent, index};
}

std::string NameOfId(std::uint64_t id) {
  const std::optional<NodeKey> node = NodeOfId(id);
  if (!node || node->agent == 0) return std::to_string(id);
  return FormatKey(*node) + " (id " + std::to_string(id) + ")";
}

}  // namespace moondb
