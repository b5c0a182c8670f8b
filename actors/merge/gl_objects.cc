#include "actors/merge/gl_objects.h"

#include <array>

namespace moondb {
namespace {

std::string FirstLine(const std::array<char, 1024>& log) {
  const std::string text(log.data());
  return text.substr(0, text.find('\n'));
}

Result<GLuint> CompileShader(GLenum kind, const char* source) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint is_compiled = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &is_compiled);
  if (is_compiled == GL_TRUE) return shader;
  std::array<char, 1024> log{};
  glGetShaderInfoLog(shader, log.size() - 1, nullptr, log.data());
  glDeleteShader(shader);
  return Fail(ErrorCode::kInternal, "a shader does not compile: " + FirstLine(log));
}

}  // namespace

GlTexture MakeTexture() {
  GLuint id = 0;
  glGenTextures(1, &id);
  return GlTexture(id);
}

GlRenderbuffer MakeRenderbuffer() {
  GLuint id = 0;
  glGenRenderbuffers(1, &id);
  return GlRenderbuffer(id);
}

GlFramebuffer MakeFramebuffer() {
  GLuint id = 0;
  glGenFramebuffers(1, &id);
  return GlFramebuffer(id);
}

GlBuffer MakeBuffer() {
  GLuint id = 0;
  glGenBuffers(1, &id);
  return GlBuffer(id);
}

GlVertexArray MakeVertexArray() {
  GLuint id = 0;
  glGenVertexArrays(1, &id);
  return GlVertexArray(id);
}

Result<GlProgram> MakeProgram(const char* vertex_shader, const char* fragment_shader) {
  const Result<GLuint> vertex = CompileShader(GL_VERTEX_SHADER, vertex_shader);
  if (!vertex) return tl::unexpected(vertex.error());
  const Result<GLuint> fragment = CompileShader(GL_FRAGMENT_SHADER, fragment_shader);
  if (!fragment) {
    glDeleteShader(*vertex);
    return tl::unexpected(fragment.error());
  }
  GlProgram program(glCreateProgram());
  for (const GLuint shader : {*vertex, *fragment}) {
    glAttachShader(program.id(), shader);
    glDeleteShader(shader);  // The program keeps the shader alive.
  }
  glLinkProgram(program.id());
  GLint is_linked = GL_FALSE;
  glGetProgramiv(program.id(), GL_LINK_STATUS, &is_linked);
  if (is_linked == GL_TRUE) return program;
  std::array<char, 1024> log{};
  glGetProgramInfoLog(program.id(), log.size() - 1, nullptr, log.data());
  return Fail(ErrorCode::kInternal, "the shaders do not link: " + FirstLine(log));
}

GLint GetGlInteger(GLenum name) {
  GLint value = 0;
  glGetIntegerv(name, &value);
  return value;
}

Result<void> CheckGl(const std::string& doing) {
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return {};
  // Each glGetError clears one flag. A lost context returns errors forever, so the loop is bounded.
  for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; ++i) {
  }
  const std::string name = error == GL_OUT_OF_MEMORY ? "out of memory" : "error " + std::to_string(error);
  return Fail(ErrorCode::kUnavailable, "OpenGL, " + doing + ": " + name);
}

}  // namespace moondb
