// From the C interface's descriptions to the C++ interface's values. Everything is checked before it is read; what is
// wrong is thrown as Error, naming the field. What the C++ interface checks itself is left to it.
#pragma once

#include <cstring>
#include <string>

#include "halfshade/c_api.h"
#include "halfshade/shadow_solver.h"

namespace halfshade {

/// Nothing counts more than this in C, and no stride is wider.
inline constexpr std::size_t kMostInC = 0x7fffffff;

/// Bytes that a struct may be larger than the one known here, for interfaces to come.
inline constexpr std::size_t kMostUnknownBytes = 4096;

/// Throws Error{kUsage} unless `struct_size` is one that some version of the interface had.
void check_struct_size(std::size_t struct_size, std::size_t known, const char* name);

/// A copy of the part of `*given` that is known here. Throws Error{kUsage}: NULL, a wrong struct_size, or something
/// other than zero in fields of a later version.
template <class Struct>
Struct read_struct(const Struct* given, const char* name) {
  if (given == nullptr) throw Error(ErrorCode::kUsage, std::string(name) + " is NULL");
  std::size_t struct_size = 0;
  std::memcpy(&struct_size, given, sizeof struct_size);
  check_struct_size(struct_size, sizeof(Struct), name);
  const auto* bytes = reinterpret_cast<const unsigned char*>(given);
  for (std::size_t i = sizeof(Struct); i < struct_size; ++i) {
    if (bytes[i] == 0) continue;
    throw Error(ErrorCode::kUsage, std::string(name) + " sets a field of a later version, at byte " +
                                       std::to_string(i) + ": this library cannot honour it");
  }
  Struct known;
  std::memcpy(&known, given, sizeof known);
  return known;
}

/// Fills the part of `*out` that is known here and leaves its struct_size. Throws Error{kUsage} as read_struct.
template <class Struct>
void write_struct(Struct* out, Struct values, const char* name) {
  if (out == nullptr) throw Error(ErrorCode::kUsage, std::string(name) + " is NULL");
  check_struct_size(out->struct_size, sizeof(Struct), name);
  values.struct_size = out->struct_size;
  std::memcpy(out, &values, sizeof values);
}

/// The number behind an enumeration of C, where it may be any: C++ must not even look at a value that is none of it.
template <class Enum>
int number_of(const Enum& value) {
  int number = 0;
  static_assert(sizeof number == sizeof value);
  std::memcpy(&number, &value, sizeof number);
  return number;
}

/// Error{kUsage} when data is missing or the stride shorter than an element, Error{kLimit} when there is too much.
void check_array(const void* data, std::size_t count, std::size_t stride_bytes, std::size_t element_bytes,
                 std::size_t alignment, const std::string& name);

PointView to_view(const halfshade_points& points, const std::string& name);
IndexView to_view(const halfshade_indices& indices, const std::string& name);
TriangleView to_triangles(const halfshade_indices& triangles, const std::string& name);
UvView to_view(const halfshade_uvs& uvs, const std::string& name);
AlphaView to_view(const halfshade_alpha_desc* given);
MeshView to_view(const halfshade_mesh_desc* given);
ReceiverView to_view(const halfshade_receivers* given);
/// `any`: there are receivers and lights, so that an array without elements is too short.
ShadowOutput to_output(const halfshade_output* given, bool any);

/// 12 values, row by row.
Transform to_transform(const double* rows);

/// Into `light`, whose memory is used again.
void to_light(const halfshade_light* given, const std::string& name, Light& light);
/// Into `lights`, likewise. The lights of a C array lie lights[0].struct_size bytes apart.
void to_lights(const halfshade_light* given, std::size_t count, std::vector<Light>& lights);

ShadowConfig to_config(const halfshade_solver_desc* given);

}  // namespace halfshade
