#include "apps/moonctl/mistyped.h"

#include "apps/moonctl/command_tree.h"
#include "model/did_you_mean.h"

namespace moondb {

std::optional<std::string> DescribeMistyped(const Command& app, const std::vector<std::string>& words) {
  const Command* current = &app;
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
      continue;
    }
    std::vector<std::string> names;
    for (const Command* sub : current->subcommands()) names.push_back(sub->name());
    if (names.empty()) continue;  // The word is an argument, because the command has no subcommands.
    return "unknown command \"" + word + "\"" + DidYouMean(word, names);
  }
  return std::nullopt;
}

}  // namespace moondb
