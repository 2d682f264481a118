# Install rules: the libraries, public headers, and what find_package(halfshade) and pkg-config read. Components as in
# HalfshadePackages.cmake. halfshade::io is not installed: it serves the command line and has no public headers.
if(NOT HALFSHADE_INSTALL)
  return()
endif()

include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/halfshade)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/halfshade DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev
  FILES_MATCHING PATTERN "*.h")
foreach(kind shared static)
  if(TARGET halfshade_${kind})
    install(TARGETS halfshade_${kind} EXPORT halfshadeTargets
      LIBRARY COMPONENT runtime NAMELINK_COMPONENT dev
      ARCHIVE COMPONENT dev)
  endif()
endforeach()
install(EXPORT halfshadeTargets NAMESPACE halfshade:: DESTINATION ${package_dir} COMPONENT dev)

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/halfshadeConfig.cmake.in
  ${PROJECT_BINARY_DIR}/halfshadeConfig.cmake INSTALL_DESTINATION ${package_dir})
# Before 1.0 a new minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/halfshadeConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/halfshadeConfig.cmake ${PROJECT_BINARY_DIR}/halfshadeConfigVersion.cmake
  DESTINATION ${package_dir} COMPONENT dev)

# Paths relative to the .pc file, so that the installed tree may be moved.
set(pkgconfig_dir ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
file(RELATIVE_PATH pc_to_prefix /prefix/${pkgconfig_dir} /prefix)
string(REGEX REPLACE "/$" "" pc_to_prefix "${pc_to_prefix}")
set(pc_public "")
set(pc_private "tbb libhwy")
set(pc_public_libs "")
set(pc_private_libs "-lstdc++ -lm -lpthread")
if(NOT TARGET halfshade_shared)
  set(pc_public " ${pc_private}")
  set(pc_public_libs " ${pc_private_libs}")
endif()
configure_file(${CMAKE_CURRENT_LIST_DIR}/halfshade.pc.in ${PROJECT_BINARY_DIR}/halfshade.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/halfshade.pc DESTINATION ${pkgconfig_dir} COMPONENT dev)
