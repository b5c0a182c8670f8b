// EglContext: an OpenGL ES 3.1 context without a window, on the first display that gives one, real GPUs first.
//
// Current only between MakeCurrent and Release, so that any one thread at a time may use it. Displays are shared by
// the whole process and are therefore never terminated here.
#pragma once

#include <memory>
#include <string>

#include "model/error.h"

namespace moondb {

class EglContext {
 public:
  // kUnavailable, in one line, where no driver gives a context. Leaves no context current.
  static Result<std::unique_ptr<EglContext>> Create();
  ~EglContext();
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  // kUnavailable where the driver refuses: another thread holds it, or it is lost.
  Result<void> MakeCurrent();
  void Release();

  // The driver has taken the context away (GL_KHR_robustness; where that is missing, errors alone tell). While current.
  bool is_lost() const;

  const std::string& renderer() const { return renderer_; }
  bool is_software() const { return is_software_; }  // llvmpipe, softpipe, swrast.

 private:
  EglContext(void* display, void* context) : display_(display), context_(context) {}
  static Result<std::unique_ptr<EglContext>> CreateOn(void* display);

  void* display_;
  void* context_;
  std::string renderer_;
  bool is_software_ = false;
};

// Whether this thread has a current context.
bool IsContextCurrent();

// Current for one scope.
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
