// Progress: shows the progress of a long operation on stderr. A terminal shows a bar that is redrawn. Other outputs get
// lines: at most one per second, or one per 10 s if only the text changes, and one at the end. Not thread-safe.
#pragma once

#include <chrono>
#include <string>

namespace moondb {

class Progress {
 public:
  explicit Progress(std::string label);
  ~Progress();  // Ends the line that shows the progress.

  // Shows the fraction `done` / `total`, and `text` after the bar. If `total` is 0, shows 100 %.
  void Show(double done, double total, const std::string& text);

 private:
  std::string label_;
  bool is_terminal_;
  bool is_line_open_ = false;
  double last_done_ = -1;
  std::string last_text_;
  std::chrono::steady_clock::time_point last_shown_{};
};

}  // namespace moondb
