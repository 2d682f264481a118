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
  elseif(HALFSHADE_FEWER_TARGETS)
    target_compile_definitions(${name} PRIVATE "HWY_DISABLED_TARGETS=(HWY_SSSE3|HWY_SSE4)")
  endif()
  if(HALFSHADE_SCALAR_ONLY)
    target_compile_definitions(${name} PRIVATE HWY_COMPILE_ONLY_SCALAR)
  endif()
endfunction()

# halfshade_hide_symbols(NAME): the parts of the library. Only what include/halfshade/export.h marks leaves the .so.
function(halfshade_hide_symbols name)
  set_target_properties(${name} PROPERTIES CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
endfunction()
