# halfshade_target(NAME): what every target of the project is compiled with.
function(halfshade_target name)
  target_compile_features(${name} PUBLIC cxx_std_20)
  set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  # Signs decide visibility: a*b+c must round the same way on every instruction set (docs/decisions/0001).
  target_compile_options(${name} PRIVATE -ffp-contract=off -Wall -Wextra -Wshadow -Wconversion -Wno-sign-conversion)
  if(HALFSHADE_WERROR)
    target_compile_options(${name} PRIVATE -Werror)
  endif()
  if(HALFSHADE_ONE_TARGET)
    target_compile_definitions(${name} PRIVATE "HWY_DISABLED_TARGETS=(HWY_SSSE3|HWY_SSE4|HWY_AVX3|HWY_AVX3_DL)")
  endif()
  if(HALFSHADE_SCALAR_ONLY)
    target_compile_definitions(${name} PRIVATE HWY_COMPILE_ONLY_SCALAR)
  endif()
endfunction()

# halfshade_hide_symbols(NAME): the parts of the library. Only what include/halfshade/export.h marks leaves the .so.
function(halfshade_hide_symbols name)
  set_target_properties(${name} PROPERTIES CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
endfunction()

# halfshade_precompile(NAME headers...): headers of other projects that most sources of the target include. Only those:
# a header of ours would compile everything again whenever it changes.
function(halfshade_precompile name)
  if(HALFSHADE_PRECOMPILE)
    set(halfshade_headers <algorithm> <array> <atomic> <bit> <cmath> <cstdint> <functional> <memory> <optional> <span>
      <string> <vector> <glm/geometric.hpp> <glm/vec2.hpp> <glm/vec3.hpp> <glm/vec4.hpp>)
    target_precompile_headers(${name} PRIVATE ${halfshade_headers} ${ARGN})
  endif()
endfunction()

# halfshade_precompile_as(NAME OTHER): the precompiled headers of OTHER, which is compiled with the same flags.
function(halfshade_precompile_as name other)
  if(HALFSHADE_PRECOMPILE AND TARGET ${other} AND NOT name STREQUAL other)
    target_precompile_headers(${name} REUSE_FROM ${other})
  endif()
endfunction()
