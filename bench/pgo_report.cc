#include "bench/pgo_report.h"

#include <fmt/format.h>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"

namespace moondb {
namespace {

std::string AteText(const GraphResult& result) { return result.ate_m ? fmt::format("{:.4f}", *result.ate_m) : "-"; }

std::string CostText(const GraphResult& result) {
  return fmt::format("{:.6f}{}", result.cost, result.has_converged ? "" : " (not converged)");
}

std::vector<std::string> PlainCells(const GraphRun& run) {
  if (!run.plain) return {"-", "-", "-"};
  return {CostText(*run.plain), AteText(*run.plain), FormatFixed(run.plain->seconds, 3)};
}

void Write(const GraphResult& result, JsonWriter& json) {
  json.Key("cost").Number(result.cost).Key("ate_m");
  if (result.ate_m) {
    json.Number(*result.ate_m);
  } else {
    json.Null();
  }
  if (result.hazard_iou) json.Key("hazard_iou").Number(*result.hazard_iou);
  json.Key("seconds").Number(result.seconds).Key("has_converged").Bool(result.has_converged);
}

void Write(const GraphRun& run, JsonWriter& json) {
  json.BeginObject().Key("name").String(run.name).Key("is_team").Bool(run.is_team);
  json.Key("nodes").Number(static_cast<double>(run.node_count));
  json.Key("edges").Number(static_cast<double>(run.edge_count));
  json.Key("ranges").Number(static_cast<double>(run.range_count));
  Write(run.ours, json);
  json.Key("initialisation").String(run.initialisation).Key("text").String(run.text);
  if (run.plain) {
    json.Key("plain_ceres").BeginObject();
    Write(*run.plain, json);
    json.EndObject();
  }
  json.EndObject();
}

void Write(const std::string& name, const MethodFigures& figures, JsonWriter& json) {
  json.BeginObject().Key("name").String(name).Key("median_ate_m").Number(figures.median_ate_m);
  json.Key("worst_ate_m").Number(figures.worst_ate_m);
  json.Key("median_seconds").Number(figures.median_seconds).EndObject();
}

void Write(const std::map<Method, MethodFigures>& methods, JsonWriter& json) {
  json.Key("methods").BeginArray();
  for (const auto& [method, figures] : methods) Write(ToString(method), figures, json);
  json.EndArray();
}

void Write(const RedrawRun& run, JsonWriter& json) {
  json.BeginObject().Key("name").String(run.name).Key("draws").Number(run.draws);
  Write(run.methods, json);
  json.Key("others").BeginArray();
  Write("long ranges known", run.without_bursts, json);
  if (run.with_matches) Write("with matches", *run.with_matches, json);
  json.EndArray().Key("worst_match_ratio").Number(run.worst_match_ratio).EndObject();
}

void Write(const RegistrationRun& run, JsonWriter& json) {
  json.BeginObject().Key("mission").String(run.mission).Key("what").String(run.what);
  json.Key("has_ranges").Bool(run.has_ranges).Key("pairs").Number(static_cast<double>(run.candidate_count));
  json.Key("verdicts").BeginObject();
  for (const auto& [verdict, count] : run.verdicts) json.Key(verdict).Number(static_cast<double>(count));
  json.EndObject().Key("given").Number(static_cast<double>(run.match_count));
  json.Key("used").Number(static_cast<double>(run.used_count));
  json.Key("right").Number(static_cast<double>(run.right_count)).Key("worst_used_m").Number(run.worst_used_m);
  json.Key("refused_sets").Number(static_cast<double>(run.refused_set_count));
  json.Key("median_ms").Number(run.median_ms).Key("cpu_seconds").Number(run.seconds);
  json.Key("ate_m").Number(run.ate_m).Key("hazard_iou");
  if (run.hazard_iou) {
    json.Number(*run.hazard_iou);
  } else {
    json.Null();
  }
  json.EndObject();
}

void Write(const TeamRun& run, JsonWriter& json) {
  json.BeginObject().Key("name").String(run.team.name).Key("nodes").Number(run.team.node_count);
  json.Key("seeds").Number(run.seeds);
  Write(run.methods, json);
  json.Key("precision").Number(run.precision).Key("recall").Number(run.recall);
  json.Key("others").BeginArray();
  Write("warm", run.warm, json);
  Write("window", run.window, json);
  json.EndArray().EndObject();
}

void Add(const std::string& name, const MethodFigures& figures, Table& table) {
  table.Add({name, FormatFixed(figures.median_ate_m, 3), FormatFixed(figures.worst_ate_m, 3),
             FormatFixed(figures.median_seconds, 4)});
}

Table MethodTable(const std::map<Method, MethodFigures>& methods) {
  Table table({"METHOD", "MEDIAN ATE M", "WORST ATE M", "SECONDS"});
  for (const auto& [method, figures] : methods) Add(ToString(method), figures, table);
  return table;
}

}  // namespace

std::string TableOf(const std::vector<GraphRun>& graphs) {
  Table table({"GRAPH", "NODES", "EDGES", "RANGES", "COST", "ATE M", "SECONDS", "BEGINNING", "FROM ODOMETRY", "ATE M",
               "SECONDS", "HAZARD IOU", "NOTE"});
  for (const GraphRun& run : graphs) {
    std::vector<std::string> row = {run.name,
                                    std::to_string(run.node_count),
                                    std::to_string(run.edge_count),
                                    std::to_string(run.range_count),
                                    CostText(run.ours),
                                    AteText(run.ours),
                                    FormatFixed(run.ours.seconds, 3),
                                    run.initialisation};
    for (const std::string& cell : PlainCells(run)) row.push_back(cell);
    row.push_back(run.ours.hazard_iou ? FormatFixed(*run.ours.hazard_iou, 3) : "-");
    row.push_back(run.text);
    table.Add(std::move(row));
  }
  return table.Text();
}

std::string TableOf(const std::vector<TeamRun>& teams) {
  std::string text;
  for (const TeamRun& run : teams) {
    Table table = MethodTable(run.methods);
    Add("staged, 10 new nodes each", run.warm, table);
    Add("window of 100 nodes each", run.window, table);
    text += fmt::format("{} (seeds 1 to {}); rejection: precision {:.3f}, recall {:.3f}\n{}\n", run.team.name,
                        run.seeds, run.precision, run.recall, table.Text());
  }
  return text;
}

std::string TableOf(const std::vector<RedrawRun>& redraws) {
  std::string text;
  for (const RedrawRun& run : redraws) {
    Table table = MethodTable(run.methods);
    Add("long ranges known", run.without_bursts, table);
    if (run.with_matches) Add("with matches", *run.with_matches, table);
    text += fmt::format("{}, {} redraws of its noise\n{}\n", run.name, run.draws, table.Text());
    if (run.with_matches) {
      text += fmt::format("highest error with matches, divided by that without: {:.3f}\n", run.worst_match_ratio);
    }
  }
  return text;
}

std::string TableOf(const std::vector<ClosureRun>& closures) {
  if (closures.empty()) return "";
  Table table({"MISSION", "LOOP CLOSURES", "RANGES", "GIVEN", "REJECTED", "REFUSED SETS", "ATE m", "s"});
  for (const ClosureRun& run : closures) {
    table.Add({run.mission, run.what, run.has_ranges ? "yes" : "no", std::to_string(run.closure_count),
               std::to_string(run.rejected_count), std::to_string(run.refused_set_count), FormatFixed(run.ate_m, 3),
               FormatFixed(run.seconds, 3)});
  }
  return table.Text();
}

std::string TableOf(const std::vector<RegistrationRun>& registrations) {
  if (registrations.empty()) return "";
  Table table({"MISSION", "MATCHES", "RANGES", "PAIRS", "GIVEN", "USED", "RIGHT", "WORST m", "REFUSED SETS",
               "MEDIAN ms", "CPU s", "ATE m", "HAZARD IOU"});
  for (const RegistrationRun& run : registrations) {
    const double right =
        run.used_count == 0 ? 1 : static_cast<double>(run.right_count) / static_cast<double>(run.used_count);
    table.Add({run.mission, run.what, run.has_ranges ? "yes" : "no", std::to_string(run.candidate_count),
               std::to_string(run.match_count), std::to_string(run.used_count), FormatFixed(right, 3),
               FormatFixed(run.worst_used_m, 2), std::to_string(run.refused_set_count), FormatFixed(run.median_ms, 2),
               FormatFixed(run.seconds, 1), FormatFixed(run.ate_m, 3),
               run.hazard_iou ? FormatFixed(*run.hazard_iou, 3) : "-"});
  }
  return table.Text();
}

std::string TextOf(const UnknownStartsRun& run) {
  return fmt::format(
      "two rovers with unknown starts: {} of {} right; of the others {} reported as ambiguous, of the "
      "right ones {}; median {:.3f} s\n",
      run.right, run.runs, run.wrong_ambiguous, run.right_ambiguous, run.median_seconds);
}

std::string TableOf(const std::vector<LieRun>& lies) {
  if (lies.empty()) return {};
  Table table(
      {"MISSION", "LIE", "LIAR", "START", "MEDIAN MOVE M", "LARGEST M", "REJECTED", "NAMED", "OTHERS", "SECONDS"});
  for (const LieRun& run : lies) {
    table.Add({run.mission, run.lie, fmt::format("{}", run.liar), run.is_warm ? "warm" : "cold",
               FormatFixed(run.median_move_m, 3), FormatFixed(run.largest_move_m, 3),
               fmt::format("{}", run.rejected_count), run.is_named ? "yes" : "no", fmt::format("{}", run.named_others),
               FormatFixed(run.seconds, 3)});
  }
  return table.Text();
}

std::string JsonOf(const std::vector<GraphRun>& graphs, const std::vector<RedrawRun>& redraws,
                   const std::vector<ClosureRun>& closures, const std::vector<RegistrationRun>& registrations,
                   const std::vector<LieRun>& lies, const std::vector<TeamRun>& teams,
                   const UnknownStartsRun& unknown) {
  JsonWriter json;
  json.BeginObject().Key("graphs").BeginArray();
  for (const GraphRun& run : graphs) Write(run, json);
  json.EndArray().Key("redraws").BeginArray();
  for (const RedrawRun& run : redraws) Write(run, json);
  json.EndArray().Key("closures").BeginArray();
  for (const ClosureRun& run : closures) {
    json.BeginObject().Key("mission").String(run.mission).Key("what").String(run.what);
    json.Key("has_ranges").Bool(run.has_ranges).Key("given").Number(static_cast<double>(run.closure_count));
    json.Key("rejected").Number(static_cast<double>(run.rejected_count));
    json.Key("refused_sets").Number(static_cast<double>(run.refused_set_count));
    json.Key("ate_m").Number(run.ate_m).Key("seconds").Number(run.seconds).EndObject();
  }
  json.EndArray().Key("registrations").BeginArray();
  for (const RegistrationRun& run : registrations) Write(run, json);
  json.EndArray().Key("lies").BeginArray();
  for (const LieRun& run : lies) {
    json.BeginObject().Key("mission").String(run.mission).Key("lie").String(run.lie).Key("liar").Number(run.liar);
    json.Key("is_warm").Bool(run.is_warm).Key("median_move_m").Number(run.median_move_m);
    json.Key("largest_move_m").Number(run.largest_move_m);
    json.Key("rejected").Number(static_cast<double>(run.rejected_count)).Key("is_named").Bool(run.is_named);
    json.Key("named_others").Number(static_cast<double>(run.named_others));
    json.Key("seconds").Number(run.seconds).EndObject();
  }
  json.EndArray().Key("teams").BeginArray();
  for (const TeamRun& run : teams) Write(run, json);
  json.EndArray().Key("unknown_starts").BeginObject().Key("runs").Number(unknown.runs);
  json.Key("right").Number(unknown.right).Key("wrong_ambiguous").Number(unknown.wrong_ambiguous);
  json.Key("right_ambiguous").Number(unknown.right_ambiguous);
  json.Key("median_seconds").Number(unknown.median_seconds).EndObject().EndObject();
  return json.text() + "\n";
}

}  // namespace moondb
