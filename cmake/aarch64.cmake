# Toolchain for aarch64 with Debian's cross compiler and a sysroot (tools/sysroot arm64). Programs of the build, and tests,
# run under qemu-user.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES MOONDB_SYSROOT)
set(CMAKE_SYSROOT ${MOONDB_SYSROOT})
set(CMAKE_FIND_ROOT_PATH ${MOONDB_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static -L ${MOONDB_SYSROOT})
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${MOONDB_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR} ${MOONDB_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${MOONDB_SYSROOT}/usr/share/pkgconfig)
# protoc of this machine has the version of the sysroot's libprotobuf.
set(Protobuf_PROTOC_EXECUTABLE /usr/bin/protoc CACHE FILEPATH "")
