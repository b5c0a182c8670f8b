// Owners of OpenGL names (ids of OpenGL objects), and wrappers of the few calls that can fail. All of them need a
// current context. A destructor that runs without a current context does not delete its name, because the objects of a
// lost context no longer exist.
#pragma once

#include <GLES3/gl31.h>

#include <string>
#include <utility>

#include "actors/merge/egl_context.h"
#include "model/error.h"

namespace moondb {

// Owns one OpenGL name and deletes it on destruction with Traits::Delete(GLuint).
template <typename Traits>
class GlObject {
 public:
  GlObject() = default;
  explicit GlObject(GLuint id) : id_(id) {}
  GlObject(GlObject&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  GlObject& operator=(GlObject&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~GlObject() {
    if (id_ != 0 && IsContextCurrent()) Traits::Delete(id_);
  }
  GLuint id() const { return id_; }

 private:
  GLuint id_ = 0;
};

struct TextureTraits {
  static void Delete(GLuint id) { glDeleteTextures(1, &id); }
};
struct RenderbufferTraits {
  static void Delete(GLuint id) { glDeleteRenderbuffers(1, &id); }
};
struct FramebufferTraits {
  static void Delete(GLuint id) { glDeleteFramebuffers(1, &id); }
};
struct BufferTraits {
  static void Delete(GLuint id) { glDeleteBuffers(1, &id); }
};
struct VertexArrayTraits {
  static void Delete(GLuint id) { glDeleteVertexArrays(1, &id); }
};
struct ProgramTraits {
  static void Delete(GLuint id) { glDeleteProgram(id); }
};

using GlTexture = GlObject<TextureTraits>;
using GlRenderbuffer = GlObject<RenderbufferTraits>;
using GlFramebuffer = GlObject<FramebufferTraits>;
using GlBuffer = GlObject<BufferTraits>;
using GlVertexArray = GlObject<VertexArrayTraits>;
using GlProgram = GlObject<ProgramTraits>;

GlTexture MakeTexture();
GlRenderbuffer MakeRenderbuffer();
GlFramebuffer MakeFramebuffer();
GlBuffer MakeBuffer();
GlVertexArray MakeVertexArray();

// Compiles and links a program. Returns kInternal, with the first line of the driver's message, if compiling or linking
// fails.
Result<GlProgram> MakeProgram(const char* vertex_shader, const char* fragment_shader);

GLint GetGlInteger(GLenum name);

// Returns kUnavailable if OpenGL has recorded an error since the last call. `doing`: the operation, for the error text.
Result<void> CheckGl(const std::string& doing);

}  // namespace moondb
