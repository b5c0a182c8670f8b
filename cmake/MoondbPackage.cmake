# Debian packages by CPack, built by tools/package: moondb, libmoondb-dev and python3-moondb.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME moondb)
set(CPACK_PACKAGE_CONTACT "moondb developers <moondb@localhost>")
set(CPACK_PACKAGE_HOMEPAGE_URL "")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL programs development python)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)

set(CPACK_DEBIAN_PROGRAMS_PACKAGE_NAME moondb)
set(CPACK_DEBIAN_PROGRAMS_DESCRIPTION "Stores, shares and merges what a team of robots learns
 The agent (moondb_agent), the operator's tool (moonctl), and a unit for systemd.")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_RECOMMENDS "fonts-dejavu-core")
set(CPACK_DEBIAN_PROGRAMS_PACKAGE_CONTROL_EXTRA
  ${PROJECT_SOURCE_DIR}/packaging/programs/postinst ${PROJECT_SOURCE_DIR}/packaging/programs/prerm)

# Clients need the first line only (cmake/moondbConfig.cmake.in).
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libmoondb-dev)
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "Client library and actors of moondb, for C++
 Headers and static libraries for clients of agents, and for agents with your own actors.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
  "libprotobuf-dev, protobuf-compiler, libzmq3-dev, libexpected-dev, libzstd-dev, pkg-config")
string(CONCAT CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS
  "libeigen3-dev, libceres-dev, libspdlog-dev, libyaml-cpp-dev, libpng-dev, libsqlite3-dev, libsodium-dev, "
  "libxxhash-dev, libegl-dev, libgles-dev, libcli11-dev")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-moondb)
set(CPACK_DEBIAN_PYTHON_DESCRIPTION "Client of moondb agents, for Python")
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3:any, python3-zmq, python3-protobuf, python3-zstandard, python3-yaml")
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/packaging/python/prerm)
include(CPack)
