#include "bench/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

namespace moondb {

std::string TableOf(const Section& section) {
  const Figure& ours = section.figures.front();
  std::string text = fmt::format("{} ({}{}{})\n", section.name, section.unit,
                                 section.target.empty() ? "" : "; target: ", section.target);
  for (const Figure& figure : section.figures) {
    const auto [least, greatest] = std::minmax_element(figure.samples.begin(), figure.samples.end());
    text += fmt::format("  {:<18}{:>14.4g}   {:.4g} to {:.4g}", figure.name, figure.median(), *least, *greatest);
    if (!figure.cpu_ns.empty()) text += fmt::format("   {:.3g} ns of processor each", Median(figure.cpu_ns));
    if (&figure != &ours && figure.median() != 0) {
      text += fmt::format("   moondb is {:.3g} x this", ours.median() / figure.median());
    }
    text += '\n';
  }
  return text;
}

namespace {

// Returns "NAME": VALUE for each figure, separated by commas.
std::string Members(const Section& section, const std::function<std::string(const Figure&)>& value) {
  std::vector<std::string> members;
  for (const Figure& figure : section.figures) members.push_back(fmt::format("\"{}\": {}", figure.name, value(figure)));
  return fmt::format("{}", fmt::join(members, ", "));
}

std::string JsonOf(const Section& section) {
  const auto median = [](const Figure& figure) { return fmt::format("{:.6g}", figure.median()); };
  const auto samples = [](const Figure& figure) { return fmt::format("[{:.6g}]", fmt::join(figure.samples, ", ")); };
  const auto cpu_ns = [](const Figure& figure) { return fmt::format("{:.6g}", Median(figure.cpu_ns)); };
  std::string text = fmt::format("\"{}\": {{\"unit\": \"{}\", {}, \"samples\": {{{}}}", section.name, section.unit,
                                 Members(section, median), Members(section, samples));
  const bool has_cpu = !section.figures.front().cpu_ns.empty();
  if (has_cpu) text += fmt::format(", \"cpu_ns\": {{{}}}", Members(section, cpu_ns));
  return text + "}";
}

}  // namespace

std::string Json(const std::vector<Section>& sections) {
  std::vector<std::string> texts;
  for (const Section& section : sections) texts.push_back(JsonOf(section));
  return fmt::format("{{\n  {}\n}}\n", fmt::join(texts, ",\n  "));
}

}  // namespace moondb
