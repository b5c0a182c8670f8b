# Install rules, and the package for `find_package(moondb)` (cmake/moondbConfig.cmake.in). The install tree contains:
#
#   bin/            the programs
#   lib/            static libraries, each a target moondb::NAME
#   include/moondb/ public headers, under the paths that they have here: #include "runtime/actor.h"
#   share/moondb/   .proto files, the commented team file, the examples
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(MOONDB_INCLUDE_DIR ${CMAKE_INSTALL_INCLUDEDIR}/moondb)
set(MOONDB_SHARE_DIR ${CMAKE_INSTALL_DATADIR}/moondb)
set(MOONDB_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/moondb)

# moondb_install_library(TARGET [NAME name] [EXPORT set] [HEADERS public headers of this folder...]): installs the
# library `TARGET` as moondb::NAME. Without NAME, the name is that of the target without "moondb_". The set is
# moondbClient for the client and what it links, otherwise moondb. If a public header includes another header, that
# header must be public too. Libraries that were not built are skipped: a build of the target `programs` has the client.
function(moondb_install_library target)
  cmake_parse_arguments(ARG "" "NAME;EXPORT" "HEADERS" ${ARGN})
  if(NOT ARG_NAME)
    string(REGEX REPLACE "^moondb_" "" ARG_NAME ${target})
  endif()
  if(NOT ARG_EXPORT)
    set(ARG_EXPORT moondb)
  endif()
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${ARG_NAME})
  add_library(moondb::${ARG_NAME} ALIAS ${target})
  install(TARGETS ${target} EXPORT ${ARG_EXPORT} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development OPTIONAL)
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  install(FILES ${ARG_HEADERS} DESTINATION ${MOONDB_INCLUDE_DIR}/${folder} COMPONENT development)
endfunction()

# moondb_install_program(TARGET): installs a program, if it was built.
function(moondb_install_program target)
  install(TARGETS ${target} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs OPTIONAL)
endfunction()

# moondb_install_package(): installs the package. Call it once, after all libraries are declared.
function(moondb_install_package)
  foreach(set IN ITEMS moondb moondbClient)
    install(EXPORT ${set} NAMESPACE moondb:: FILE ${set}Targets.cmake DESTINATION ${MOONDB_PACKAGE_DIR}
            COMPONENT development)
  endforeach()
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/moondbConfig.cmake.in
    ${PROJECT_BINARY_DIR}/moondbConfig.cmake INSTALL_DESTINATION ${MOONDB_PACKAGE_DIR}
    PATH_VARS MOONDB_INCLUDE_DIR MOONDB_SHARE_DIR)
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/moondbConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${PROJECT_BINARY_DIR}/moondbConfig.cmake ${PROJECT_BINARY_DIR}/moondbConfigVersion.cmake
          DESTINATION ${MOONDB_PACKAGE_DIR} COMPONENT development)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples DESTINATION ${MOONDB_SHARE_DIR} COMPONENT development)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/configs DESTINATION ${MOONDB_SHARE_DIR} COMPONENT programs)
  set(units ${PROJECT_SOURCE_DIR}/packaging/moondb-agent@.service)
  if(TARGET moondb_ros)
    list(APPEND units ${PROJECT_SOURCE_DIR}/packaging/moondb-ros@.service)
  endif()
  install(FILES ${units} DESTINATION lib/systemd/system COMPONENT programs)
  install(FILES ${PROJECT_SOURCE_DIR}/packaging/moondb.sysusers DESTINATION lib/sysusers.d RENAME moondb.conf
          COMPONENT programs)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT programs)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT development
          FILES_MATCHING PATTERN "*.md")
endfunction()
