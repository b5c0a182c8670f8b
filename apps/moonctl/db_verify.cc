#include <chrono>

#include "apps/common/json_writer.h"
#include "apps/common/progress.h"
#include "apps/common/table.h"
#include "apps/moonctl/db_commands.h"
#include "proto/status.pb.h"

namespace moondb {
namespace {

constexpr std::size_t kFindingsShown = 20;

struct Verification {
  double rows = 0;
  double held = 0;
  double damaged = 0;
  double missing = 0;
  double orphaned = 0;
  double file_check_s = 0;  // Duration of the file check, during which storage answers no requests.
  double total_s = 0;
  std::size_t findings_count = 0;     // Number of reported findings. An agent reports only its first findings.
  std::vector<std::string> findings;  // The first kFindingsShown findings.

  bool is_sound() const { return findings.empty(); }

  void Note(const proto::VerifyFinding& finding) {
    ++findings_count;
    if (findings.size() >= kFindingsShown) return;
    if (!finding.has_key()) return findings.push_back(finding.text());
    const bool is_shared = finding.key().seq() != 0;
    findings.push_back((is_shared ? ToString(FromProto(finding.key())) : "a local record") + ": " + finding.text());
  }
};

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Verifies one part of the store with as many requests as needed. If the store is too damaged to be read, adds the read
// error as a finding.
Result<void> VerifyOnePart(Client& client, proto::VerifyPart part, const std::function<void()>& progress,
                           Verification& found) {
  proto::VerifyRequest request;
  request.set_part(part);
  while (true) {
    const Result<proto::VerifyReply> reply = client.Verify(request);
    if (!reply && reply.error().code != ErrorCode::kCorrupt) return tl::unexpected(reply.error());
    if (!reply) {
      proto::VerifyFinding unreadable;
      unreadable.set_text(reply.error().text);
      found.Note(unreadable);
      return {};
    }
    (part == proto::VERIFY_PART_HELD ? found.held : found.rows) += reply->checked_count();
    found.damaged += reply->damaged_count();
    found.missing += reply->missing_count();
    found.orphaned += reply->orphaned_count();
    for (const proto::VerifyFinding& finding : reply->findings()) found.Note(finding);
    progress();
    if (reply->is_complete()) return {};
    request.set_after_row_id(reply->last_row_id());
    *request.mutable_after_key() = reply->last_key();
  }
}

Result<Verification> VerifyStore(Client& client) {
  const auto status = client.Status();
  if (!status) return tl::unexpected(status.error());
  double row_count = 0;
  for (const proto::RecordCount& part : status->storage().counts()) row_count += part.count();

  Progress progress("verifying " + status->name());
  Verification found;
  const auto start = std::chrono::steady_clock::now();
  const auto show = [&] {
    if (found.rows > 0) progress.Show(found.rows, row_count, FormatCount(found.rows) + " rows");
  };
  for (const auto part : {proto::VERIFY_PART_FILE, proto::VERIFY_PART_ROWS, proto::VERIFY_PART_HELD}) {
    if (auto verified = VerifyOnePart(client, part, show, found); !verified) return tl::unexpected(verified.error());
    if (part == proto::VERIFY_PART_FILE) found.file_check_s = SecondsSince(start);
  }
  found.total_s = SecondsSince(start);
  return found;
}

void WriteVerification(const Verification& found, JsonWriter& json) {
  json.Key("is_sound").Bool(found.is_sound()).Key("rows").Number(found.rows).Key("held").Number(found.held);
  json.Key("damaged").Number(found.damaged).Key("missing").Number(found.missing).Key("orphaned").Number(found.orphaned);
  json.Key("file_check_s").Number(found.file_check_s).Key("total_s").Number(found.total_s);
  json.Key("findings").BeginArray();
  for (const std::string& finding : found.findings) json.String(finding);
  json.EndArray();
}

std::string FindingsText(const std::string& agent, const Verification& found) {
  std::string text;
  for (const std::string& finding : found.findings) text += agent + ": " + finding + "\n";
  if (found.findings_count > found.findings.size()) text += agent + ": and more\n";
  return text;
}

}  // namespace

ExitCode VerifyStores(CommandContext& context) {
  const auto answers = context.CallEach(VerifyStore);
  if (!answers) return context.Report(answers.error());
  Table table({"AGENT", "ROWS", "DAMAGED", "MISSING", "STRAY", "FILE CHECK", "TOOK", "VERDICT"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  std::string findings;
  bool is_any_damaged = false;
  for (const auto& asked : *answers) {
    const auto& [agent, found] = asked;
    BeginAgent(asked, json);
    if (found) {
      is_any_damaged = is_any_damaged || !found->is_sound();
      table.Add({agent->name(), FormatCount(found->rows), FormatCount(found->damaged), FormatCount(found->missing),
                 FormatCount(found->orphaned), FormatFixed(found->file_check_s, 2) + " s",
                 FormatFixed(found->total_s, 2) + " s", found->is_sound() ? "sound" : "DAMAGED"});
      WriteVerification(*found, json);
      findings += FindingsText(agent->name(), *found);
    } else {
      table.Add({agent->name(), WhyNoAnswer(found.error())});
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(is_any_damaged ? ExitCode::kFailed : ExitCodeOf(*answers), json.text(), table.Text() + findings);
}

}  // namespace moondb
