#include "actors/merge/egl_context.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GLES3/gl31.h>

#include <array>
#include <string_view>
#include <utility>
#include <vector>

namespace moondb {
namespace {

bool HasWord(const char* words, std::string_view word) {
  return words != nullptr && std::string_view(words).find(word) != std::string_view::npos;
}

// Returns an EGL or GL extension function. Such functions are not linked but looked up by name.
template <typename Function>
Function Load(const char* name) {
  return reinterpret_cast<Function>(eglGetProcAddress(name));
}

// Returns one display per device known to EGL (EGL_EXT_platform_device), then Mesa's surfaceless display, then the
// default display.
std::vector<EGLDisplay> Displays() {
  std::vector<EGLDisplay> displays;
  const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const auto get_display = Load<PFNEGLGETPLATFORMDISPLAYEXTPROC>("eglGetPlatformDisplayEXT");
  const auto query_devices = Load<PFNEGLQUERYDEVICESEXTPROC>("eglQueryDevicesEXT");
  if (get_display != nullptr && query_devices != nullptr && HasWord(extensions, "EGL_EXT_platform_device")) {
    std::array<EGLDeviceEXT, 16> devices{};
    EGLint count = 0;
    if (query_devices(devices.size(), devices.data(), &count) != EGL_TRUE) count = 0;
    for (EGLint i = 0; i < count; ++i) {
      displays.push_back(get_display(EGL_PLATFORM_DEVICE_EXT, devices[static_cast<std::size_t>(i)], nullptr));
    }
  }
  if (get_display != nullptr && HasWord(extensions, "EGL_MESA_platform_surfaceless")) {
    displays.push_back(get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr));
  }
  displays.push_back(eglGetDisplay(EGL_DEFAULT_DISPLAY));
  return displays;
}

// Returns the attributes of a context. If the driver supports robust contexts, it reports the context as lost after a
// GPU hang. Otherwise a hang may end the process.
std::vector<EGLint> ContextAttributes(EGLDisplay display) {
  std::vector<EGLint> attributes = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 1};
  if (HasWord(eglQueryString(display, EGL_EXTENSIONS), "EGL_EXT_create_context_robustness")) {
    attributes.insert(attributes.end(),
                      {EGL_CONTEXT_OPENGL_ROBUST_ACCESS_EXT, EGL_TRUE,
                       EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_EXT, EGL_LOSE_CONTEXT_ON_RESET_EXT});
  }
  attributes.push_back(EGL_NONE);
  return attributes;
}

EGLContext CreateContext(EGLDisplay display) {
  const std::vector<EGLint> attributes = ContextAttributes(display);
  if (HasWord(eglQueryString(display, EGL_EXTENSIONS), "EGL_KHR_no_config_context")) {
    return eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes.data());
  }
  const std::array<EGLint, 5> wanted = {EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (eglChooseConfig(display, wanted.data(), &config, 1, &count) != EGL_TRUE || count == 0) return EGL_NO_CONTEXT;
  return eglCreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
}

bool IsSoftware(std::string_view renderer) {
  for (const std::string_view name : {"llvmpipe", "softpipe", "swrast", "SwiftShader", "Software"}) {
    if (renderer.find(name) != std::string_view::npos) return true;
  }
  return false;
}

}  // namespace

Result<std::unique_ptr<EglContext>> EglContext::CreateOn(void* display) {
  if (display == EGL_NO_DISPLAY) return Fail(ErrorCode::kUnavailable, "no display");
  if (eglInitialize(display, nullptr, nullptr) != EGL_TRUE) {
    return Fail(ErrorCode::kUnavailable, "the display does not start");
  }
  if (!HasWord(eglQueryString(display, EGL_EXTENSIONS), "EGL_KHR_surfaceless_context")) {
    return Fail(ErrorCode::kUnavailable, "the driver cannot draw without a window");
  }
  if (eglBindAPI(EGL_OPENGL_ES_API) != EGL_TRUE) return Fail(ErrorCode::kUnavailable, "no OpenGL ES");
  const EGLContext created = CreateContext(display);
  if (created == EGL_NO_CONTEXT) return Fail(ErrorCode::kUnavailable, "the driver has no OpenGL ES 3.1");
  std::unique_ptr<EglContext> context(new EglContext(display, created));
  if (Result<void> current = context->MakeCurrent(); !current) return tl::unexpected(current.error());
  const auto* renderer = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  context->renderer_ = renderer == nullptr ? "unknown" : renderer;
  context->is_software_ = IsSoftware(context->renderer_);
  context->Release();
  return context;
}

Result<std::unique_ptr<EglContext>> EglContext::Create() {
  std::unique_ptr<EglContext> software;
  std::string reason = "no display";
  for (const EGLDisplay display : Displays()) {
    Result<std::unique_ptr<EglContext>> context = CreateOn(display);
    if (!context) {
      reason = context.error().text;
      continue;
    }
    if (!(*context)->is_software()) return context;
    if (software == nullptr) software = std::move(*context);
  }
  if (software != nullptr) return software;
  return Fail(ErrorCode::kUnavailable,
              "OpenGL ES 3.1 through EGL: " + reason + "; install a driver (Debian: libgl1-mesa-dri) or merge on cpu");
}

EglContext::~EglContext() { eglDestroyContext(display_, context_); }

Result<void> EglContext::MakeCurrent() {
  if (eglBindAPI(EGL_OPENGL_ES_API) == EGL_TRUE &&
      eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) == EGL_TRUE) {
    return {};
  }
  return Fail(ErrorCode::kUnavailable, "the OpenGL context cannot be used: EGL error " + std::to_string(eglGetError()));
}

bool EglContext::is_lost() const {
  using GetStatus = GLenum (*)();
  static const auto get_status = Load<GetStatus>("glGetGraphicsResetStatusKHR");
  const auto* extensions = reinterpret_cast<const char*>(glGetString(GL_EXTENSIONS));
  return get_status != nullptr && HasWord(extensions, "GL_KHR_robustness") && get_status() != GL_NO_ERROR;
}

bool IsContextCurrent() { return eglGetCurrentContext() != EGL_NO_CONTEXT; }

void EglContext::Release() { eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }

}  // namespace moondb
