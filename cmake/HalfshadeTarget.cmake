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
  if(HALFSHADE_SCALAR_ONLY)
    target_compile_definitions(${name} PRIVATE HWY_COMPILE_ONLY_SCALAR)
  endif()
endfunction()
