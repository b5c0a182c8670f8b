// EglContext: an OpenGL ES 3.1 context without a window, on the first usable display. Real GPUs are preferred.
//
// The context is current only between MakeCurrent and Release. Any thread may use the context, but only one thread at a
// time. EGL displays are shared by the whole process, so this class never terminates a display.
#pragma once

#include <memory>
#include <string>

#include "model/error.h"

namespace moondb {

class EglContext {
 public:
  // Returns kUnavailable, with a one-line text, if no driver provides a context. Leaves no context current.
  static Result<std::unique_ptr<EglContext>> Create();
  ~EglContext();
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  // Returns kUnavailable if the driver refuses, because another thread holds the context or the context is lost.
  Result<void> MakeCurrent();
  void Release();

  // Returns true if the driver reports that the context was reset. Without GL_KHR_robustness, always returns false; a
  // lost context then shows only as errors of later calls. Requires: the context is current.
  bool is_lost() const;

  const std::string& renderer() const { return renderer_; }
  bool is_software() const { return is_software_; }  // True for renderers such as llvmpipe, softpipe and swrast.

 private:
  EglContext(void* display, void* context) : display_(display), context_(context) {}
  static Result<std::unique_ptr<EglContext>> CreateOn(void* display);

  void* display_;
  void* context_;
  std::string renderer_;
  bool is_software_ = false;
};

// Returns true if this thread has a current context.
bool IsContextCurrent();

// Makes a context current for the lifetime of this object.
class CurrentContext {
 public:
  explicit CurrentContext(EglContext& context) : context_(context), made_current_(context.MakeCurrent()) {}
  ~CurrentContext() {
    if (made_current_) context_.Release();
  }
  CurrentContext(const CurrentContext&) = delete;
  CurrentContext& operator=(const CurrentContext&) = delete;
  const Result<void>& made_current() const { return made_current_; }

 private:
  EglContext& context_;
  Result<void> made_current_;
};

}  // namespace moondb
