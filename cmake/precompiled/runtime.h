// Headers that most files above model/ include. Precompiled (cmake/MoondbCompile.cmake); no file may rely on it.
// Statuses are not among them: a new field of a status must not compile everything again (tools/check_rebuild).
#pragma once

#include "cmake/precompiled/model.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"
