#include "apps/moonctl/mistyped.h"

#include <CLI/CLI.hpp>

#include "apps/moonctl/command_tree.h"
#include "model/did_you_mean.h"

namespace moondb {

std::optional<std::string> DescribeMistyped(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* current = &app;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "--") break;
    if (word.starts_with("-") && word.size() > 1) {
      const CLI::Option* option = FindOption(*current, word);
      if (option == nullptr && word.starts_with("--")) {
        return "unknown option " + OptionName(word) + DidYouMean(OptionName(word), OptionNames(*current));
      }
      if (option != nullptr && TakesValue(*option) && word.find('=') == std::string::npos) ++i;
      continue;
    }
    if (const CLI::App* sub = FindSubcommand(*current, word)) {
      current = sub;
      continue;
    }
    std::vector<std::string> names;
    for (const CLI::App* sub : SubcommandsOf(*current)) names.push_back(sub->get_name());
    if (names.empty()) continue;  // A plain argument.
    return "unknown command \"" + word + "\"" + DidYouMean(word, names);
  }
  return std::nullopt;
}

}  // namespace moondb
