#include "apps/common/arguments.h"

#include <CLI/CLI.hpp>

namespace moondb {
namespace {

// Calls `parse`. If `parse` throws an error of CLI11, returns the error as a ParseStop, otherwise nothing. If the
// command line asks for the help or the version, prints it and returns a ParseStop with exit code 0.
template <typename ParseWords>
std::optional<ParseStop> StopOf(const CLI::App& app, ParseWords parse) {
  try {
    parse();
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return ParseStop{app.exit(error), ""};
    return ParseStop{error.get_exit_code(), error.what()};
  }
  return std::nullopt;
}

}  // namespace

Option& Option::Required() {
  option_->required();
  return *this;
}

Option& Option::TypeName(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Option& Option::DefaultShown() {
  option_->capture_default_str();
  return *this;
}

Option& Option::DefaultShown(const std::string& text) {
  option_->default_str(text);
  return *this;
}

Option& Option::EnvName(const std::string& name) {
  option_->envname(name);
  return *this;
}

Option& Option::Expected(int count_min, int count_max) {
  option_->expected(count_min, count_max);
  return *this;
}

Option& Option::Excludes(Option& other) {
  option_->excludes(other.option_);
  return *this;
}

Option& Option::Needs(Option& other) {
  option_->needs(other.option_);
  return *this;
}

template <OptionBound T>
Option& Option::Within(T low, T high) {
  option_->check(CLI::Range(low, high));
  return *this;
}

template Option& Option::Within(int low, int high);
template Option& Option::Within(std::uint32_t low, std::uint32_t high);
template Option& Option::Within(std::uint64_t low, std::uint64_t high);
template Option& Option::Within(double low, double high);

Option& Option::Positive() {
  option_->check(CLI::PositiveNumber);
  return *this;
}

Option& Option::OneOf(const std::vector<std::string>& values) {
  option_->check(CLI::IsMember(values));
  return *this;
}

Option& Option::ExistingFolder() {
  option_->check(CLI::ExistingDirectory);
  return *this;
}

std::string Option::name() const { return option_->get_name(); }
const std::vector<std::string>& Option::long_names() const { return option_->get_lnames(); }
const std::vector<std::string>& Option::short_names() const { return option_->get_snames(); }
std::string Option::type_name() const { return option_->get_type_name(); }
const std::string& Option::description() const { return option_->get_description(); }
bool Option::is_required() const { return option_->get_required(); }
bool Option::is_argument() const { return option_->get_positional(); }
bool Option::takes_value() const { return option_->get_expected_min() > 0; }
int Option::values_max() const { return option_->get_items_expected_max(); }

Command::Command(const std::string& name, const std::string& description)
    : root_(std::make_unique<CLI::App>(description, name)), app_(root_.get()) {
  Add(app_->get_help_ptr());
}

Command::Command(CLI::App* app, const Command* parent) : app_(app), parent_(parent) { Add(app_->get_help_ptr()); }

Command::~Command() = default;

template <OptionValue T>
Option& Command::AddOption(const std::string& names, T& variable, const std::string& description) {
  return Add(app_->add_option(names, variable, description));
}

template Option& Command::AddOption(const std::string&, std::string&, const std::string&);
template Option& Command::AddOption(const std::string&, int&, const std::string&);
template Option& Command::AddOption(const std::string&, std::int64_t&, const std::string&);
template Option& Command::AddOption(const std::string&, std::uint32_t&, const std::string&);
template Option& Command::AddOption(const std::string&, std::uint64_t&, const std::string&);
template Option& Command::AddOption(const std::string&, double&, const std::string&);
template Option& Command::AddOption(const std::string&, std::optional<double>&, const std::string&);
template Option& Command::AddOption(const std::string&, std::vector<std::string>&, const std::string&);
template Option& Command::AddOption(const std::string&, std::vector<std::int64_t>&, const std::string&);
template Option& Command::AddOption(const std::string&, std::vector<std::uint64_t>&, const std::string&);

Option& Command::AddChoice(const std::string& names, std::function<void(int)> set,
                           const std::vector<std::pair<std::string, int>>& choices, const std::string& description) {
  CLI::Option* option = app_->add_option_function<int>(
      names, [set = std::move(set)](const int& number) { set(number); }, description);
  option->type_name("ENUM")->transform(CLI::CheckedTransformer(choices));
  return Add(option);
}

Option& Command::AddFlag(const std::string& names, bool& variable, const std::string& description) {
  return Add(app_->add_flag(names, variable, description));
}

Option& Command::AddFlag(const std::string& names, std::string& variable, const std::string& description) {
  return Add(app_->add_flag(names, variable, description));
}

Option& Command::AddVersionFlag(const std::string& names, const std::string& version) {
  return Add(app_->set_version_flag(names, version));
}

Command& Command::AddSubcommand(const std::string& name, const std::string& description) {
  CLI::App* app = app_->add_subcommand(name, description);
  return *subcommands_.emplace_back(new Command(app, this));
}

Command& Command::RequireSubcommand() {
  app_->require_subcommand(1);
  return *this;
}

Command& Command::AllowSubcommand() {
  app_->require_subcommand(0, 1);
  return *this;
}

Command& Command::Fallthrough() {
  app_->fallthrough();
  return *this;
}

Command& Command::ShowDefaults() {
  app_->option_defaults()->always_capture_default();
  return *this;
}

Command& Command::Footer(const std::string& text) {
  app_->footer(text);
  return *this;
}

Command& Command::Callback(std::function<void()> callback) {
  app_->callback(std::move(callback));
  return *this;
}

Command& Command::SetNote(CommandNote note) {
  note_ = std::move(note);
  return *this;
}

std::optional<ParseStop> Command::Parse(int argc, const char* const* argv) {
  return StopOf(*app_, [&] { app_->parse(argc, argv); });
}

std::optional<ParseStop> Command::Parse(const std::string& line) {
  return StopOf(*app_, [&] { app_->parse(line, /*program_name_included=*/true); });
}

std::optional<int> Command::ParseOrReport(int argc, const char* const* argv) {
  try {
    app_->parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app_->exit(error);
  }
  return std::nullopt;
}

std::string Command::Help() const { return app_->help(); }
const std::string& Command::name() const { return app_->get_name(); }
std::string Command::description() const { return app_->get_description(); }
bool Command::requires_subcommand() const { return app_->get_require_subcommand_min() > 0; }
bool Command::is_given() const { return app_->parsed(); }

const Command* Command::GivenSubcommand() const {
  const std::vector<CLI::App*> given = app_->get_subcommands();
  if (given.empty()) return nullptr;
  for (const auto& subcommand : subcommands_) {
    if (subcommand->app_ == given.front()) return subcommand.get();
  }
  return nullptr;
}

std::vector<const Command*> Command::subcommands() const {
  std::vector<const Command*> all;
  for (const auto& subcommand : subcommands_) all.push_back(subcommand.get());
  return all;
}

std::vector<Command*> Command::subcommands() {
  std::vector<Command*> all;
  for (const auto& subcommand : subcommands_) all.push_back(subcommand.get());
  return all;
}

std::vector<const Option*> Command::options() const {
  std::vector<const Option*> all;
  for (const auto& option : options_) all.push_back(option.get());
  return all;
}

const Option* Command::FindOwnOption(const std::string& word) const {
  const CLI::Option* found = app_->get_option_no_throw(word);
  for (const auto& option : options_) {
    if (option->option_ == found) return option.get();
  }
  return nullptr;
}

Option& Command::Add(CLI::Option* option) { return *options_.emplace_back(new Option(option)); }

}  // namespace moondb
