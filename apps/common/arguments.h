// Parses command lines: a tree of commands with options that set variables.
//
//   std::string team;
//   moondb::Command app("wire_feed", "Gives a mission to a running team.");
//   app.AddOption("-t,--team", team, "Team file").EnvName("MOONDB_TEAM").Required();
//   if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
//
// Every command has the options -h and --help. An option whose name has no dash is a positional argument. Bound
// variables must outlive the command. An invalid definition, such as a name that is used twice, throws an exception.
// Only arguments.cc includes the headers of CLI11, because they take several seconds to compile. Not thread-safe.
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

// The types of variables that an option can fill. An option that fills a vector takes several values.
template <typename T>
concept OptionValue = std::same_as<T, std::string> || std::same_as<T, int> || std::same_as<T, std::int64_t> ||
    std::same_as<T, std::uint32_t> || std::same_as<T, std::uint64_t> || std::same_as<T, double> ||
    std::same_as<T, std::optional<double>> || std::same_as<T, std::vector<std::string>> ||
    std::same_as<T, std::vector<std::int64_t>> || std::same_as<T, std::vector<std::uint64_t>>;

// The types of bounds that Option::Within accepts.
template <typename T>
concept OptionBound =
    std::same_as<T, int> || std::same_as<T, std::uint32_t> || std::same_as<T, std::uint64_t> || std::same_as<T, double>;

// An option, a flag or a positional argument of a Command, which owns it. Setters return the option itself.
class Option {
 public:
  Option(const Option&) = delete;
  Option& operator=(const Option&) = delete;

  Option& Required();
  Option& TypeName(const std::string& name);  // Name of the value in --help, in place of TEXT, INT and so on.
  Option& DefaultShown();                     // --help shows the variable's current value as the default.
  Option& DefaultShown(const std::string& text);
  Option& EnvName(const std::string& name);  // Environment variable that gives the value if the option is not given.
  Option& Expected(int count_min, int count_max);  // Number of values that the option takes.
  Option& Excludes(Option& other);                 // Parsing fails if this option and `other` are both given.
  Option& Needs(Option& other);                    // Parsing fails if this option is given without `other`.

  // Within, Positive, OneOf and ExistingFolder restrict each value of the option. Parsing fails for other values.
  template <OptionBound T>
  Option& Within(T low, T high);  // Allows the values from `low` to `high`, both included.
  Option& Positive();
  Option& OneOf(const std::vector<std::string>& values);
  Option& ExistingFolder();

  std::string name() const;                             // "--agent"; an argument's name without dashes.
  const std::vector<std::string>& long_names() const;   // Without dashes: "agent".
  const std::vector<std::string>& short_names() const;  // Without dashes: "a".
  std::string type_name() const;                        // Type and checks: "TEXT:{ros,png}".
  const std::string& description() const;
  bool is_required() const;
  bool is_argument() const;
  bool takes_value() const;  // False for flags.
  int values_max() const;    // The largest number of values that the option takes.

 private:
  friend class Command;
  explicit Option(CLI::Option* option) : option_(option) {}

  CLI::Option* option_;
};

// An example of a command, and whether --watch may repeat the command.
struct CommandNote {
  // The command as a user types it: "moonctl role set rover2 leader". Several examples are separated by line breaks.
  std::string example;
  bool is_showing = false;  // True if the command changes nothing, so --watch may repeat it.
};

// The reason why the program ends after parsing: the command line asks for the help or the version, or is wrong.
struct ParseStop {
  int exit_code = 0;  // 0: --help or --version, already printed. Otherwise CLI11's error number.
  std::string error;  // One line that describes the error; empty if exit_code is 0.
};

// A command, which owns its options and its subcommands. The root command represents the program. Setters return the
// command itself.
class Command {
 public:
  explicit Command(const std::string& name = "", const std::string& description = "");  // Makes a root command.
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  // Adds an option. Example of `names`: "-t,--team". A name without a dash, such as "file", adds a positional argument.
  template <OptionValue T>
  Option& AddOption(const std::string& names, T& variable, const std::string& description = "");
  // Adds an option that accepts the names in `choices` and stores the enumerator of the given name in `variable`.
  template <typename Enum>
  Option& AddChoice(const std::string& names, Enum& variable, const std::map<std::string, Enum>& choices,
                    const std::string& description);
  Option& AddFlag(const std::string& names, bool& variable, const std::string& description = "");
  // Adds a flag with an optional value. For example, the flag "--watch{2}" sets the variable to "2" on --watch, and to
  // "5" on --watch=5.
  Option& AddFlag(const std::string& names, std::string& variable, const std::string& description = "");
  Option& AddVersionFlag(const std::string& names, const std::string& version);
  Command& AddSubcommand(const std::string& name, const std::string& description);

  Command& RequireSubcommand();  // Parsing fails unless exactly one subcommand is given.
  Command& AllowSubcommand();    // Parsing fails if more than one subcommand is given.
  // Allows options of this command after subcommands on the command line. Call before AddSubcommand.
  Command& Fallthrough();
  Command& ShowDefaults();                   // --help shows the default of each option that is added after this call.
  Command& Footer(const std::string& text);  // Text at the end of --help.
  Command& Callback(std::function<void()> callback);  // Parse calls `callback` if the command line gives this command.
  Command& SetNote(CommandNote note);

  // Parses a command line: sets the variables of the options, then calls the callbacks of the given commands. Returns
  // nothing if the program must continue, otherwise the reason to end. Prints the help or the version if the command
  // line asks for it, but prints no errors.
  std::optional<ParseStop> Parse(int argc, const char* const* argv);
  // Like Parse(argc, argv), but for one string that begins with the program's name. Words that contain blanks must be
  // quoted.
  std::optional<ParseStop> Parse(const std::string& line);
  // Like Parse, but also prints errors to stderr. Returns the exit code if the program is to end, otherwise nothing.
  std::optional<int> ParseOrReport(int argc, const char* const* argv);

  std::string Help() const;
  const std::string& name() const;
  std::string description() const;
  const CommandNote* note() const { return note_ ? &*note_ : nullptr; }  // Null: the command has no note.
  const Command* parent() const { return parent_; }                      // Null for the root.
  bool requires_subcommand() const;
  bool is_given() const;                   // True if the last parsed command line gave this command.
  const Command* GivenSubcommand() const;  // The first subcommand that the command line gave. Null: none.

  // Subcommands and options in the order in which they were added.
  std::vector<const Command*> subcommands() const;
  std::vector<Command*> subcommands();
  std::vector<const Option*> options() const;  // Includes the positional arguments and --help.
  // Returns the command's own option that `word` ("--json" or "-a") names. Null: the command has no such option.
  const Option* FindOwnOption(const std::string& word) const;

 private:
  Command(CLI::App* app, const Command* parent);
  Option& Add(CLI::Option* option);
  Option& AddChoice(const std::string& names, std::function<void(int)> set,
                    const std::vector<std::pair<std::string, int>>& choices, const std::string& description);

  std::unique_ptr<CLI::App> root_;  // Null in subcommands.
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
