#include "apps/moonctl/mistyped.h"

#include <algorithm>
#include <string_view>

#include "apps/moonctl/command_tree.h"
#include "model/did_you_mean.h"
#include "model/duration.h"

namespace moondb {
namespace {

// Words of other programs, with the group before them, and what does the same here.
struct Synonym {
  std::string_view words;
  const char* instead;
};

constexpr Synonym kSynonyms[] = {
    {"start", "moonctl up"},
    {"launch", "moonctl up"},
    {"run", "moonctl up"},
    {"stop", "moonctl down"},
    {"kill", "moonctl down"},
    {"shutdown", "moonctl down"},
    {"restart", "moonctl down, then moonctl up"},
    {"list", "moonctl status (agents), or moonctl record list TYPE"},
    {"ls", "moonctl status (agents), or moonctl record list TYPE"},
    {"node", "moonctl status (agents), or moonctl record next-node (pose graph)"},
    {"nodes", "moonctl status (agents), or moonctl graph export FILE (pose graph)"},
    {"agents", "moonctl status"},
    {"info", "moonctl status, or moonctl db info"},
    {"ping", "moonctl status, or moonctl doctor for the links of this robot"},
    {"monitor", "moonctl status --watch, or moonctl view"},
    {"leader", "moonctl role show"},
    {"roles", "moonctl role show"},
    {"topic", "moonctl record list TYPE"},
    {"topics", "moonctl record list TYPE"},
    {"echo", "moonctl record list TYPE --follow"},
    {"bag", "moonctl export FILE.mcap"},
    {"backup", "moonctl db backup FILE"},
    {"query", "moonctl db query SQL"},
    {"sql", "moonctl db query SQL"},
    {"gui", "moonctl view"},
    {"map save", "moonctl map export FOLDER"},
    {"map show", "moonctl view, or moonctl map export FOLDER"},
    {"sync start", "moonctl sync now"},
    {"sync stop", "moonctl sync pause"},
    {"replicate start", "moonctl replicate now"},
    {"config get", "moonctl config show"},
    {"config set", "edit the team file on every agent, then moonctl config check FILE"},
    {"config edit", "edit the team file on every agent, then moonctl config check FILE"},
    {"record echo", "moonctl record list TYPE --follow"},
    {"record show", "moonctl record list TYPE, or moonctl record get KEY"},
    {"graph match", "moonctl graph matches"},
    {"graph show", "moonctl graph stats, or moonctl view"},
    {"role get", "moonctl role show"},
    {"role change", "moonctl role swap, or moonctl role set AGENT leader"},
};

std::string InsteadOf(std::string_view words, std::string_view word, const std::vector<std::string>& names) {
  const auto* found = std::ranges::find(kSynonyms, words, &Synonym::words);
  return found == std::end(kSynonyms) ? DidYouMean(word, names) : std::string("; use ") + found->instead;
}

// Returns the error for a word that follows a command without arguments. `group` is the command, with a blank behind
// it.
std::string UnexpectedText(const std::string& group, const std::string& word) {
  const std::string what = "unexpected \"" + word + "\" after \"" + group.substr(0, group.size() - 1) + "\"; ";
  if (ParseDuration(word)) return what + "a time limit is --timeout " + word;
  return what + "an agent is named by -a " + word;
}

}  // namespace

std::optional<std::string> DescribeMistyped(const Command& app, const std::vector<std::string>& words) {
  const Command* current = &app;
  std::string group;  // The commands before the word, each with a blank behind it.
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "--") break;
    if (word.starts_with("-") && word.size() > 1) {
      const Option* option = FindOption(*current, word);
      if (option == nullptr && word.starts_with("--")) {
        return "unknown option " + OptionName(word) + DidYouMean(OptionName(word), OptionNames(*current));
      }
      if (option != nullptr && option->takes_value() && word.find('=') == std::string::npos) ++i;
      continue;
    }
    if (const Command* sub = FindSubcommand(*current, word)) {
      current = sub;
      group += sub->name() + " ";
      continue;
    }
    std::vector<std::string> names;
    for (const Command* sub : current->subcommands()) names.push_back(sub->name());
    if (names.empty() && ArgumentsOf(*current).empty()) return UnexpectedText(group, word);
    if (names.empty()) continue;  // The word is an argument, because the command has no subcommands.
    return "unknown command \"" + word + "\"" + InsteadOf(group + word, word, names);
  }
  return std::nullopt;
}

}  // namespace moondb
