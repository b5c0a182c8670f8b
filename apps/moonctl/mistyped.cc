#include "apps/moonctl/mistyped.h"

#include <CLI/CLI.hpp>

#include "runtime/did_you_mean.h"

namespace moondb {
namespace {

std::vector<std::string> SubcommandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(sub->get_name());
  return names;
}

const CLI::App* FindSubcommand(const CLI::App& app, const std::string& name) {
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (sub->get_name() == name) return sub;
  }
  return nullptr;
}

// "--json" of "--json=1".
std::string OptionName(const std::string& word) { return word.substr(0, word.find('=')); }

const CLI::Option* FindOption(const CLI::App* app, const std::string& word) {
  for (; app != nullptr; app = app->get_parent()) {
    if (const CLI::Option* option = app->get_option_no_throw(OptionName(word))) return option;
  }
  return nullptr;
}

std::vector<std::string> OptionNames(const CLI::App* app) {
  std::vector<std::string> names;
  for (; app != nullptr; app = app->get_parent()) {
    for (const CLI::Option* option : app->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

}  // namespace

std::optional<std::string> DescribeMistyped(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* current = &app;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "--") break;
    if (word.starts_with("-") && word.size() > 1) {
      const CLI::Option* option = FindOption(current, word);
      if (option == nullptr && word.starts_with("--")) {
        return "unknown option " + OptionName(word) + DidYouMean(OptionName(word), OptionNames(current));
      }
      const bool takes_value = option != nullptr && option->get_expected_min() > 0;
      if (takes_value && word.find('=') == std::string::npos) ++i;
      continue;
    }
    if (const CLI::App* sub = FindSubcommand(*current, word)) {
      current = sub;
      continue;
    }
    const std::vector<std::string> names = SubcommandNames(*current);
    if (names.empty()) continue;  // A plain argument.
    return "unknown command \"" + word + "\"" + DidYouMean(word, names);
  }
  return std::nullopt;
}

}  // namespace moondb
