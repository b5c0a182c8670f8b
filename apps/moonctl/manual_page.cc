#include "apps/moonctl/manual_page.h"

#include "apps/moonctl/command.h"
#include "apps/moonctl/command_tree.h"

namespace moondb {
namespace {

constexpr char kEnd[] = R"(.SH EXIT STATUS
.TP
.B 0
Done.
.TP
.B 1
Failed.
.TP
.B 2
The command line, the team file or an input is wrong.
.TP
.B 3
Some agents do not answer.
.TP
.B 4
Refused: a role conflict, an outdated state, or not the leader.
.TP
.B 5
Waiting for an acknowledgment or an answer took too long.
.SH ENVIRONMENT
.TP
.B MOONDB_TEAM
The team file if \-t is not given.
.TP
.B MOONDB_VIA
The agent that relays all requests if \-\-via is not given.
.TP
.B MOONDB_CLIENT_KEY
The client's secret key if \-\-key is not given.
.TP
.B MOONDB_RUN_DIR
The folder of the agents' sockets; else XDG_RUNTIME_DIR/moondb, else /tmp/moondb\-UID. An agent that was started with
another folder is found by its data folder.
.TP
.B NO_COLOR
Set to anything: no colours.
)";

// Escapes plain text for a line of roff.
std::string Escaped(const std::string& text) {
  std::string escaped = text.starts_with(".") || text.starts_with("'") ? "\\&" : "";
  for (const char c : text) {
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else if (c == '\'') {
      escaped += "\\(aq";
    } else {
      escaped += c == '\n' ? ' ' : c;
    }
  }
  return escaped;
}

// Returns the heading of an option, such as "-a, --agent AGENT". The heading of an argument is its name.
std::string Heading(const Option& option) {
  std::string names;
  for (const std::string& name : option.short_names()) names += (names.empty() ? "-" : ", -") + name;
  for (const std::string& name : option.long_names()) names += (names.empty() ? "--" : ", --") + name;
  const std::string type = option.takes_value() ? " \\fI" + Escaped(option.type_name()) + "\\fR" : "";
  return "\\fB" + Escaped(names.empty() ? option.name() : names) + "\\fR" + type;
}

std::string OptionText(const Option& option) {
  return ".TP\n" + Heading(option) + "\n" + Escaped(option.description()) + "\n";
}

std::string OptionsText(const Command& command) {
  std::string text;
  for (const Option* argument : ArgumentsOf(command)) text += OptionText(*argument);
  for (const Option* option : OwnOptions(command)) {
    if (option->name() != "--help") text += OptionText(*option);
  }
  return text;
}

std::string Synopsis(const Command& command) {
  std::string text = PathOf(command);
  for (const Option* argument : ArgumentsOf(command)) {
    text += argument->is_required() ? " " + argument->name() : " [" + argument->name() + "]";
  }
  return text;
}

// Returns true if the command gets its own section. A group that requires a subcommand gets no section.
bool IsCommand(const Command& command) { return command.subcommands().empty() || !command.requires_subcommand(); }

std::string CommandText(const Command& command) {
  std::string text = ".SS " + Escaped(Synopsis(command)) + "\n";
  const Command& group = *command.parent();
  if (group.parent() != nullptr) text += Escaped(group.description()) + ".\n";  // A name like "off" needs its group.
  text += Escaped(command.description()) + ".\n";
  text += OptionsText(command);
  if (const CommandNote* note = NoteOf(command)) {
    text += ".PP\n.nf\n" + Escaped(std::string(note->example)) + "\n.fi\n";
  }
  return text;
}

}  // namespace

std::string ManualPage(const Command& root, const std::string& version) {
  std::string text = ".TH MOONCTL 1 \"\" \"moondb " + Escaped(version) + "\" \"User Commands\"\n";
  text += ".SH NAME\nmoonctl \\- " + Escaped(root.description()) + "\n.SH SYNOPSIS\n.B moonctl\n";
  text +=
      "[\\fIoptions\\fR] \\fIcommand\\fR [\\fIarguments\\fR]\n.SH OPTIONS\nOptions may precede or follow the "
      "command.\n";
  text += OptionsText(root) + ".SH COMMANDS\n";
  VisitCommands(root, [&text, &root](const Command& command) {
    if (&command != &root && IsCommand(command)) text += CommandText(command);
  });
  return text + kEnd;
}

}  // namespace moondb
