#include <chrono>
#include <cstdint>

#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/db_commands.h"
#include "model/custom_types.h"
#include "model/prune_rules.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr double kMegabyte = 1e6;

constexpr auto kAgeMax = std::chrono::milliseconds(static_cast<std::int64_t>(kPruneAgeMax_s * 1000));

Result<proto::PruneOrder> OrderOf(const PruneArguments& arguments, const CustomTypes& custom_types) {
  proto::PruneOrder order;
  order.set_is_dry_run(arguments.is_dry_run);
  order.set_occluded_maps(arguments.occluded_maps);
  order.set_is_history(arguments.is_history);
  if (!arguments.older_than.empty()) {
    const auto age = ParseDuration(arguments.older_than, kAgeMax);
    if (!age) {
      return Fail(ErrorCode::kInvalid, "expected an age such as 30d or 12h, got \"" + arguments.older_than + "\"",
                  "--older-than");
    }
    order.set_older_than_s(std::chrono::duration<double>(*age).count());
  }
  for (const std::string& name : arguments.types) {
    const auto type = DataTypeFromName(name, custom_types);
    if (!type) return Fail(ErrorCode::kInvalid, "no data type \"" + name + "\"", "--type");
    order.add_data_types(*type);
  }
  order.set_content_bytes_max(arguments.megabytes_max * kMegabyte);
  const bool is_limited = order.older_than_s() > 0 || order.occluded_maps() || order.is_history() ||
                          !order.data_types().empty() || order.content_bytes_max() > 0;
  if (is_limited) return order;
  return Fail(
      ErrorCode::kInvalid,
      "no records are selected: give at least one of --older-than, --type, --occluded-maps, --history or --max-mb");
}

std::string PrunedText(const proto::PruneReply& reply, bool is_dry_run, const CustomTypes& custom_types) {
  Table table({"TYPE", is_dry_run ? "WOULD BE REMOVED" : "REMOVED", "CONTENTS"});
  double count = 0;
  double bytes = 0;
  for (const proto::PrunedType& pruned : reply.pruned()) {
    table.Add({DataTypeName(pruned.data_type(), custom_types), FormatCount(pruned.record_count()),
               FormatBytes(pruned.content_bytes())});
    count += pruned.record_count();
    bytes += pruned.content_bytes();
  }
  table.Add({"all", FormatCount(count), FormatBytes(bytes)});
  const std::string kept = reply.unacknowledged_count() > 0
                               ? FormatCount(reply.unacknowledged_count(), "more record") +
                                     (reply.unacknowledged_count() == 1 ? " is" : " are") +
                                     " kept until the leader and the designated survivor hold them"
                               : "";
  return table.Text() + kept;
}

}  // namespace

ExitCode PruneStore(CommandContext& context, const PruneArguments& arguments) {
  if (context.agent.empty()) {
    return context.Report({ErrorCode::kInvalid, "which agent's store? Give -a rover1", "--agent"});
  }
  const auto team = context.Team();
  if (!team) return context.Report(team.error());
  const CustomTypes& custom_types = (*team)->config.custom_types();
  const auto order = OrderOf(arguments, custom_types);
  if (!order) return context.Report(order.error());
  auto chosen = context.Connect(context.agent);
  if (!chosen) return context.Report(chosen.error());
  const auto reply = chosen->client->Prune(*order);
  if (!reply) return context.Report(reply.error());
  const bool is_refused = !reply->text().empty();
  if (is_refused && !context.is_json) {
    return context.Report({ErrorCode::kRefused, chosen->agent->name() + " removes nothing: " + reply->text(), {}});
  }
  return context.Print(is_refused ? ExitCode::kRefused : ExitCode::kDone, ToJson(*reply),
                       PrunedText(*reply, order->is_dry_run(), custom_types));
}

}  // namespace moondb
