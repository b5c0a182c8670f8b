#include "apps/moonctl/completion_command.h"

#include <cstdio>

#include "apps/common/json_writer.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/command_tree.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/completion.h"
#include "model/custom_types.h"

namespace moondb {
namespace {

constexpr char kFiles[] = ":files";

// Each script calls `moonctl __complete` with the words up to the cursor. The answer has one line per candidate: the
// word, a tab and its description. After a line ":files", the shell also completes paths.
constexpr char kBash[] = R"(# bash completion for moonctl; printed by `moonctl completion bash`.
_moonctl() {
  local line program=${COMP_WORDS[0]/#\~/$HOME}
  COMPREPLY=()
  while IFS= read -r line; do
    if [ "$line" = :files ]; then
      compopt -o default 2> /dev/null
    else
      COMPREPLY+=("${line%%$'\t'*}")
    fi
  done < <("$program" __complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2> /dev/null)
}
complete -F _moonctl moonctl
)";

constexpr char kZsh[] = R"(#compdef moonctl
# zsh completion for moonctl; printed by `moonctl completion zsh`.
_moonctl() {
  local line program=${words[1]/#\~/$HOME}
  local -a candidates
  for line in "${(@f)$("$program" __complete "${(@)words[2,CURRENT]}" 2> /dev/null)}"; do
    if [[ $line == :files ]]; then
      _files
    elif [[ -n $line ]]; then
      candidates+=("${${line%%$'\t'*}//:/\\:}:${line#*$'\t'}")
    fi
  done
  (( $#candidates )) && _describe moonctl candidates
}
if [[ ${funcstack[1]} == _moonctl ]]; then
  _moonctl "$@"
else
  compdef _moonctl moonctl
fi
)";

constexpr char kFish[] = R"(# fish completion for moonctl; printed by `moonctl completion fish`.
function __moonctl_complete
  set -l before (commandline -opc)
  set -l typed (commandline -ct)
  set -l lines ($before[1] __complete $before[2..] "$typed" 2> /dev/null)
  for line in $lines
    if test "$line" = :files
      __fish_complete_path "$typed"
    else
      echo $line
    end
  end
end
complete -c moonctl -f -a '(__moonctl_complete)'
)";

const std::map<std::string, std::string> kScripts = {{"bash", kBash}, {"zsh", kZsh}, {"fish", kFish}};

// Reads the team file that -t or --team in `words` names, otherwise the team file in $MOONDB_TEAM.
TeamWords ReadTeamWords(const std::vector<std::string>& words, CommandContext& context) {
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    if (words[i] != "-t" && OptionName(words[i]) != "--team") continue;
    const bool is_split = OptionName(words[i]) == words[i];
    context.team_path = is_split ? words[words[i + 1] == "=" && i + 2 < words.size() ? i + 2 : i + 1]
                                 : words[i].substr(std::string("--team=").size());
  }
  TeamWords known;
  const auto team = context.Team();
  for (const DataType type : BuiltInDataTypes()) known.data_types.push_back(DataTypeName(type, {}));
  if (!team) return known;
  for (const proto::AgentConfig& agent : (*team)->config.agents()) known.agents.push_back(agent.name());
  for (const proto::CustomType& type : (*team)->config.custom_types()) known.data_types.push_back(type.name());
  return known;
}

}  // namespace

ExitCode PrintCompletions(const Command& root, const std::vector<std::string>& words, CommandContext& context) {
  const Completion completion = Complete(root, words, ReadTeamWords(words, context));
  for (const Candidate& candidate : completion.candidates) {
    std::printf("%s\t%s\n", candidate.word.c_str(), candidate.description.c_str());
  }
  if (completion.is_file) std::printf("%s\n", kFiles);
  return ExitCode::kDone;
}

void AddCompletionCommand(Command& app, CommandContext& context) {
  auto shell = std::make_shared<std::string>();
  Command& command = AddCommand(app, "completion", "Print the completion script for a shell",
                                {"moonctl completion bash > ~/.local/share/bash-completion/completions/moonctl"});
  command.AddOption("shell", *shell, "Name of the shell").Required().OneOf({"bash", "fish", "zsh"});
  command.Callback([&context, shell] {
    context.action = [&context, shell] {
      const std::string& script = kScripts.at(*shell);
      JsonWriter json;
      json.BeginObject().Key("shell").String(*shell).Key("script").String(script).EndObject();
      return context.Done(json.text(), script);
    };
  });
}

}  // namespace moondb
