#include "bench/report.h"

#include <fmt/format.h>

#include <algorithm>

namespace moondb {

std::string TableOf(const Section& section) {
  const Figure& ours = section.figures.front();
  std::string text = fmt::format("{} ({}{}{})\n", section.name, section.unit,
                                 section.target.empty() ? "" : "; target: ", section.target);
  for (const Figure& figure : section.figures) {
    const auto [least, greatest] = std::minmax_element(figure.samples.begin(), figure.samples.end());
    text += fmt::format("  {:<18}{:>14.4g}   {:.4g} to {:.4g}", figure.name, figure.median(), *least, *greatest);
    if (&figure != &ours && figure.median() != 0) {
      text += fmt::format("   moondb is {:.3g} x this", ours.median() / figure.median());
    }
    text += '\n';
  }
  return text;
}

std::string Json(const std::vector<Section>& sections) {
  std::string text = "{";
  for (const Section& section : sections) {
    text += fmt::format("{}\n  \"{}\": {{\"unit\": \"{}\"", &section == &sections.front() ? "" : ",", section.name,
                        section.unit);
    for (const Figure& figure : section.figures) text += fmt::format(", \"{}\": {:.6g}", figure.name, figure.median());
    text += ", \"samples\": {";
    for (const Figure& figure : section.figures) {
      text += fmt::format("{}\"{}\": [{:.6g}]", &figure == &section.figures.front() ? "" : ", ", figure.name,
                          fmt::join(figure.samples, ", "));
    }
    text += "}}";
  }
  return text + "\n}\n";
}

}  // namespace moondb
