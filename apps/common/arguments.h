// Command lines: a tree of commands, their options, and the variables that options fill.
//
//   std::string team;
//   moondb::Command app("wire_feed", "Gives a mission to a running team.");
//   app.AddOption("-t,--team", team, "Team file").EnvName("MOONDB_TEAM").Required();
//   if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
//
// The root has the options -h and --help, and so has every command below it. An option without a dash in its name is an
// argument, found by its place. Bound variables must outlive the command. A mistake in a definition, such as a name
// that is used twice, throws. Not thread-safe.
//
// CLI11 does the work. Only arguments.cc includes its headers, because they take several seconds to compile.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace moondb {

// The types of variables that an option can fill. Vectors take several values.
template <typename T>
concept OptionValue = std::same_as<T, std::string> || std::same_as<T, int> || std::same_as<T, std::int64_t> ||
    std::same_as<T, std::uint32_t> || std::same_as<T, std::uint64_t> || std::same_as<T, double> ||
    std::same_as<T, std::optional<double>> || std::same_as<T, std::vector<std::string>> ||
    std::same_as<T, std::vector<std::int64_t>> || std::same_as<T, std::vector<std::uint64_t>>;

// The types of bounds. `--help` and error messages name the type.
template <typename T>
concept OptionBound =
    std::same_as<T, int> || std::same_as<T, std::uint32_t> || std::same_as<T, std::uint64_t> || std::same_as<T, double>;

// An option, a flag or an argument of a command, which owns it. Setters return the option itself.
class Option {
 public:
  Option(const Option&) = delete;
  Option& operator=(const Option&) = delete;

  Option& Required();
  Option& TypeName(const std::string& name);  // In --help, in place of TEXT, INT and so on.
  Option& DefaultShown();                     // --help shows the variable's value as it is now.
  Option& DefaultShown(const std::string& text);
  Option& EnvName(const std::string& name);        // The environment variable with the value, if no word gives one.
  Option& Expected(int count_min, int count_max);  // Number of values.
  Option& Excludes(Option& other);                 // Parsing fails if both are given.
  Option& Needs(Option& other);                    // Parsing fails if the other one is missing.

  // Checks of each value.
  template <OptionBound T>
  Option& Within(T low, T high);  // Both included.
  Option& Positive();
  Option& OneOf(const std::vector<std::string>& values);
  Option& ExistingFolder();

  std::string name() const;                             // "--agent"; of an argument its name.
  const std::vector<std::string>& long_names() const;   // "agent".
  const std::vector<std::string>& short_names() const;  // "a".
  std::string type_name() const;                        // With the checks: "TEXT:{ros,png}".
  const std::string& description() const;
  bool is_required() const;
  bool is_argument() const;
  bool takes_value() const;  // False for flags.
  int values_max() const;    // The largest number of values.

 private:
  friend class Command;
  explicit Option(CLI::Option* option) : option_(option) {}

  CLI::Option* option_;
};

// An example of a command, and whether it can be repeated.
struct CommandNote {
  std::string example;      // As typed: "moonctl role set rover2 leader".
  bool is_showing = false;  // Changes nothing, so that it can be repeated: --watch.
};

// The end of a program whose command line asks for help or is wrong.
struct ParseStop {
  int exit_code = 0;  // 0: --help or --version, which has been printed. Else CLI11's number of the error.
  std::string error;  // One line; empty if exit_code is 0.
};

// A command with its options and the commands below it, which it owns; the root stands for the program. Setters return
// the command itself.
class Command {
 public:
  explicit Command(const std::string& name = "", const std::string& description = "");  // A root.
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  // `names`: "-t,--team", or "file" for an argument.
  template <OptionValue T>
  Option& AddOption(const std::string& names, T& variable, const std::string& description = "");
  // Takes the names of `choices` and their numbers.
  template <typename Enum>
  Option& AddChoice(const std::string& names, Enum& variable, const std::map<std::string, Enum>& choices,
                    const std::string& description);
  Option& AddFlag(const std::string& names, bool& variable, const std::string& description = "");
  // "--watch{2}" sets the variable to "2", and --watch=5 to "5".
  Option& AddFlag(const std::string& names, std::string& variable, const std::string& description = "");
  Option& AddVersionFlag(const std::string& names, const std::string& version);
  Command& AddSubcommand(const std::string& name, const std::string& description);

  Command& RequireSubcommand();              // Parsing fails unless exactly one of the commands below is given.
  Command& AllowSubcommand();                // At most one of the commands below can be given.
  Command& Fallthrough();                    // Options of this command may stand behind commands added from now on.
  Command& ShowDefaults();                   // --help shows the default of each option added from now on.
  Command& Footer(const std::string& text);  // Ends --help.
  Command& Callback(std::function<void()> callback);  // Called by Parse if the command was given.
  Command& SetNote(CommandNote note);

  // Reads a command line into the variables, then calls the callbacks. Returns nothing if the program is to go on.
  // Prints help or the version if one of them is asked for. Does not print errors.
  std::optional<ParseStop> Parse(int argc, const char* const* argv);
  // As above, for a line that begins with the program's name. Words with blanks stand in quotation marks.
  std::optional<ParseStop> Parse(const std::string& line);
  // As above, but also prints errors to stderr. Returns the exit code.
  std::optional<int> ParseOrReport(int argc, const char* const* argv);

  std::string Help() const;
  const std::string& name() const;
  std::string description() const;
  const CommandNote* note() const { return note_ ? &*note_ : nullptr; }  // Null: it has none.
  const Command* parent() const { return parent_; }                      // Null for the root.
  bool requires_subcommand() const;
  bool is_given() const;                   // On the command line that was parsed last.
  const Command* GivenSubcommand() const;  // The first one that was given. Null: none.

  // In the order in which they were added.
  std::vector<const Command*> subcommands() const;
  std::vector<Command*> subcommands();
  std::vector<const Option*> options() const;  // The arguments and --help included.
  // The command's own option that "--json" or "-a" names. Null: none.
  const Option* FindOwnOption(const std::string& word) const;

 private:
  Command(CLI::App* app, const Command* parent);
  Option& Add(CLI::Option* option);
  Option& AddChoice(const std::string& names, std::function<void(int)> set,
                    const std::vector<std::pair<std::string, int>>& choices, const std::string& description);

  std::unique_ptr<CLI::App> root_;  // Null below the root.
  CLI::App* app_;
  const Command* parent_ = nullptr;
  std::optional<CommandNote> note_;
  std::vector<std::unique_ptr<Command>> subcommands_;
  std::vector<std::unique_ptr<Option>> options_;
};

template <typename Enum>
Option& Command::AddChoice(const std::string& names, Enum& variable, const std::map<std::string, Enum>& choices,
                           const std::string& description) {
  static_assert(std::is_enum_v<Enum>);
  std::vector<std::pair<std::string, int>> numbers;
  for (const auto& [name, value] : choices) numbers.emplace_back(name, static_cast<int>(value));
  return AddChoice(
      names, [&variable](int number) { variable = static_cast<Enum>(number); }, numbers, description);
}

}  // namespace moondb
