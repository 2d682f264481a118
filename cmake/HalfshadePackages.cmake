# Debian packages by CPack, one per install component: libhalfshade0 (runtime), libhalfshade-dev (dev), halfshade-tools
# (tools) and python3-halfshade (python). ./dev package builds them; docs/packages.md says what is in each.
find_program(DPKG dpkg)
find_program(GZIP gzip)
mark_as_advanced(DPKG GZIP)
if(NOT PROJECT_IS_TOP_LEVEL OR NOT HALFSHADE_INSTALL OR NOT HALFSHADE_SHARED OR NOT DPKG OR NOT GZIP)
  return()
endif()

set(package_runtime libhalfshade0)
set(package_dev libhalfshade-dev)
set(components runtime dev)
if(TARGET halfshade)
  set(package_tools halfshade-tools)
  list(APPEND components tools)
endif()
if(TARGET halfshade_python)
  set(package_python python3-halfshade)
  list(APPEND components python)
endif()

# Every package has its copyright and its changelog.
set(debian_dir ${CMAKE_CURRENT_LIST_DIR}/debian)
set(made_dir ${PROJECT_BINARY_DIR}/debian)
set(HALFSHADE_MAINTAINER "Halfshade maintainers <maintainers@halfshade.invalid>" CACHE STRING
  "Maintainer of the packages: whoever builds and gives them away")
set(maintainer ${HALFSHADE_MAINTAINER})
set(revision 1)
configure_file(${debian_dir}/changelog.in ${made_dir}/changelog @ONLY)
execute_process(COMMAND ${GZIP} -9nc ${made_dir}/changelog OUTPUT_FILE ${made_dir}/changelog.Debian.gz)
foreach(component IN LISTS components)
  install(FILES ${debian_dir}/copyright ${made_dir}/changelog.Debian.gz
    DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package_${component}} COMPONENT ${component})
endforeach()
install(FILES ${PROJECT_SOURCE_DIR}/examples/minimal.cpp ${PROJECT_SOURCE_DIR}/examples/c_minimal.c
  DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package_dev}/examples COMPONENT dev)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME halfshade)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL ${components})
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER ${maintainer})
set(CPACK_DEBIAN_PACKAGE_RELEASE ${revision})
set(CPACK_DEBIAN_PACKAGE_SOURCE halfshade)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY "=")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR})
set(full_version ${PROJECT_VERSION}-${revision})

set(about "For every visible point and every sample of an area light halfshade answers
whether a triangle is in between, with the result of exact arithmetic: the
same bits for any number of threads and any instruction set.
")

# debian_package(COMPONENT SECTION SYNOPSIS TEXT DEPENDS): what CPack asks of a component.
macro(debian_package component section synopsis text depends)
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package_${component}})
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section})
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${synopsis}\n${about}\n${text}")
  set(CPACK_DEBIAN_${upper}_PACKAGE_DEPENDS "${depends}")
endmacro()

debian_package(runtime libs "exact soft shadows on the CPU - shared library"
  "This package holds the shared library." "")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA ${debian_dir}/triggers)

debian_package(dev libdevel "exact soft shadows on the CPU - development files"
  "This package holds the C++ and C headers, the static library, and what CMake\nand pkg-config need to find them."
  "${package_runtime} (= ${full_version}), libglm-dev, libtbb-dev, libhwy-dev")

debian_package(tools graphics "exact soft shadows on the CPU - command line"
  "This package holds the halfshade command line: it renders, verifies, compares\nand measures." "")

if(TARGET halfshade_python)
  set(next_minor ${Python3_VERSION_MINOR})
  math(EXPR next_minor "${next_minor} + 1")
  set(python_depends "python3 (>= 3.${Python3_VERSION_MINOR}~), python3 (<< 3.${next_minor}), python3-numpy")
  debian_package(python python "exact soft shadows on the CPU - Python module"
    "This package holds the Python module halfshade, which works on NumPy arrays."
    "${package_runtime} (= ${full_version}), ${python_depends}")
endif()
include(CPack)
