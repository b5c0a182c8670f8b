// Progress: how far long work is, on stderr: a bar that is drawn anew on a terminal, plain lines elsewhere (at most one
// a second and the last; one in ten seconds while nothing but the text changes). Not thread-safe.
#pragma once

#include <chrono>
#include <string>

namespace moondb {

class Progress {
 public:
  explicit Progress(std::string label);
  ~Progress();  // Ends the line.

  // `done` of `total` (0: nothing to do); `text` stands behind the bar.
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
