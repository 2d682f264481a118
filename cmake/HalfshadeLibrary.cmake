# The libraries that others link, libhalfshade.so and libhalfshade.a: all objects of rasterizer and shadows, nothing of
# io. Targets, the same in the build tree and after find_package (halfshadeConfig.cmake.in):
#
#   halfshade::halfshade   the C++ interface
#   halfshade::c           the C interface
#
# The tests and the command line reach behind the interface, so they link the parts, halfshade::rasterizer and
# halfshade::shadows, which here are plain static libraries.
if(PROJECT_IS_TOP_LEVEL)
  set(build_shared ON)
  set(build_static ON)
else()
  set(build_shared ${BUILD_SHARED_LIBS})
  set(build_static ON)
  if(BUILD_SHARED_LIBS)
    set(build_static OFF)
  endif()
endif()
option(HALFSHADE_SHARED "libhalfshade.so" ${build_shared})
option(HALFSHADE_STATIC "libhalfshade.a" ${build_static})
if(NOT HALFSHADE_SHARED AND NOT HALFSHADE_STATIC)
  message(FATAL_ERROR "HALFSHADE_SHARED and HALFSHADE_STATIC are both OFF: one is needed")
endif()

# halfshade_whole_library(NAME KIND)
function(halfshade_whole_library name kind)
  add_library(${name} ${kind} $<TARGET_OBJECTS:halfshade_rasterizer> $<TARGET_OBJECTS:halfshade_shadows>)
  set_target_properties(${name} PROPERTIES OUTPUT_NAME halfshade LINKER_LANGUAGE CXX)
  target_include_directories(${name} INTERFACE
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:include>)
  target_link_libraries(${name} PRIVATE TBB::tbb hwy::hwy)
endfunction()

set(default_kind static)
if(HALFSHADE_STATIC)
  halfshade_whole_library(halfshade_static STATIC)
  set_target_properties(halfshade_static PROPERTIES EXPORT_NAME static)
endif()
if(HALFSHADE_SHARED)
  halfshade_whole_library(halfshade_shared SHARED)
  if(UNIX AND NOT APPLE)
    set(map ${CMAKE_CURRENT_LIST_DIR}/halfshade.map)
    target_link_options(halfshade_shared PRIVATE "LINKER:--version-script=${map}")
    set_target_properties(halfshade_shared PROPERTIES LINK_DEPENDS ${map})
    if(NOT CMAKE_CXX_FLAGS MATCHES "-fsanitize")
      target_link_options(halfshade_shared PRIVATE "LINKER:--no-undefined")
    endif()
  endif()
  # Before 1.0 each minor version may break the binary interface: its number is the library's. 0 belongs to 0.1.
  set_target_properties(halfshade_shared PROPERTIES EXPORT_NAME shared VERSION 0.${PROJECT_VERSION} SOVERSION 0)
  set(default_kind shared)
endif()

add_library(halfshade_c INTERFACE)
add_library(halfshade::c ALIAS halfshade_c)
target_link_libraries(halfshade_c INTERFACE halfshade_${default_kind})
add_library(halfshade_cpp INTERFACE)
add_library(halfshade::halfshade ALIAS halfshade_cpp)
target_link_libraries(halfshade_cpp INTERFACE halfshade_${default_kind} glm::glm)
target_compile_features(halfshade_cpp INTERFACE cxx_std_20)
