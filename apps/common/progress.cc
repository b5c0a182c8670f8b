#include "apps/common/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace moondb {
namespace {

constexpr int kBarWidth = 30;

}  // namespace

Progress::Progress(std::string label) : label_(std::move(label)), is_terminal_(::isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (is_line_open_) std::fputc('\n', stderr);
}

void Progress::Show(double done, double total, const std::string& text) {
  const auto now = std::chrono::steady_clock::now();
  const bool is_end = done >= total;
  const bool is_only_text = done == last_done_;
  if (is_only_text && (is_end || text == last_text_)) return;
  const std::chrono::milliseconds line_period = is_only_text ? std::chrono::seconds(10) : std::chrono::seconds(1);
  if (!is_end && now - last_shown_ < (is_terminal_ ? std::chrono::milliseconds(50) : line_period)) return;
  last_done_ = done;
  last_text_ = text;
  last_shown_ = now;
  const double ratio = total > 0 ? std::clamp(done / total, 0.0, 1.0) : 1.0;
  if (is_terminal_) {
    const auto filled = static_cast<std::size_t>(std::lround(ratio * kBarWidth));
    const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
    std::fprintf(stderr, "\r%s [%s] %3.0f %%  %s\x1b[K", label_.c_str(), bar.c_str(), ratio * 100, text.c_str());
    std::fflush(stderr);
    is_line_open_ = true;
  } else {
    std::fprintf(stderr, "%s: %.0f %%, %s\n", label_.c_str(), ratio * 100, text.c_str());
  }
}

}  // namespace moondb
