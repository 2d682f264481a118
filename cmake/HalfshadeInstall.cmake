# Install rules: public headers, the core libraries as an export set, and the package files that find_package(halfshade)
# reads. halfshade::io is not installed: it serves the command line and has no public headers.
option(HALFSHADE_INSTALL "Install rules" ${PROJECT_IS_TOP_LEVEL})
if(NOT HALFSHADE_INSTALL)
  return()
endif()

include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/halfshade)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/halfshade DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(TARGETS halfshade_rasterizer halfshade_shadows EXPORT halfshadeTargets)
install(EXPORT halfshadeTargets NAMESPACE halfshade:: DESTINATION ${package_dir})

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/halfshadeConfig.cmake.in
  ${PROJECT_BINARY_DIR}/halfshadeConfig.cmake INSTALL_DESTINATION ${package_dir})
# Before 1.0 a new minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/halfshadeConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/halfshadeConfig.cmake ${PROJECT_BINARY_DIR}/halfshadeConfigVersion.cmake
  DESTINATION ${package_dir})
