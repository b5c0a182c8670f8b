# The package of the tarball: find_package(moondb REQUIRED COMPONENTS client) gives moondb::client, for a robot's
# software. The client is compiled here from its sources, because protobuf's headers and library must be those of this
# machine. It needs protobuf (3.12 or newer) with protoc, libzmq with zmq.hpp, tl-expected, libzstd and pkg-config.
cmake_minimum_required(VERSION 3.22)
get_filename_component(moondb_sources ${CMAKE_CURRENT_LIST_DIR}/../../../share/moondb/client ABSOLUTE)
set(MOONDB_PROTO_DIR ${moondb_sources}/proto)

include(CMakeFindDependencyMacro)
find_dependency(Protobuf)
find_dependency(tl-expected)
find_dependency(PkgConfig)
pkg_check_modules(moondb_zmq REQUIRED QUIET IMPORTED_TARGET libzmq)
pkg_check_modules(moondb_zstd REQUIRED QUIET IMPORTED_TARGET libzstd)

foreach(component IN LISTS moondb_FIND_COMPONENTS)
  if(component STREQUAL "client")
    set(moondb_client_FOUND TRUE)
  elseif(moondb_FIND_REQUIRED_${component})
    set(moondb_FOUND FALSE)
    set(moondb_NOT_FOUND_MESSAGE "the tarball of moondb has the component client only; build moondb for ${component}")
    return()
  endif()
endforeach()

if(NOT TARGET moondb::client)
  file(GLOB moondb_files ${moondb_sources}/client/*.cc ${moondb_sources}/model/*.cc)
  file(GLOB moondb_protos ${MOONDB_PROTO_DIR}/*.proto)
  set(moondb_out ${CMAKE_BINARY_DIR}/moondb)
  file(MAKE_DIRECTORY ${moondb_out}/proto)
  set(moondb_generated)
  foreach(file IN LISTS moondb_protos)
    get_filename_component(name ${file} NAME_WE)
    list(APPEND moondb_generated ${moondb_out}/proto/${name}.pb.cc ${moondb_out}/proto/${name}.pb.h)
  endforeach()
  add_custom_command(OUTPUT ${moondb_generated}
    COMMAND protobuf::protoc --cpp_out=${moondb_out}/proto -I ${MOONDB_PROTO_DIR} ${moondb_protos}
    DEPENDS ${moondb_protos} VERBATIM)
  add_library(moondb_client STATIC EXCLUDE_FROM_ALL ${moondb_files} ${moondb_generated})
  add_library(moondb::client ALIAS moondb_client)
  target_compile_features(moondb_client PUBLIC cxx_std_20)
  target_include_directories(moondb_client SYSTEM PUBLIC ${moondb_sources} ${moondb_out} ${moondb_out}/proto)
  target_link_libraries(moondb_client PUBLIC protobuf::libprotobuf tl::expected
                        PRIVATE PkgConfig::moondb_zmq PkgConfig::moondb_zstd)
endif()
