// View files: camera and lights as JSON.
//
//   {"camera": {"eye": [x,y,z], "target": [x,y,z], "up": [x,y,z], "fov_y_deg": d},
//    "lights": [{"name": "key", "type": "rectangle", "center": [..], "u": [..], "v": [..], "two_sided": false,
//                "emission": 1}]}
// Types: rectangle {center, u, v}, point {position}, disk {center, normal, radius}, sphere {center, radius},
// ellipsoid {center, axes}, polygon {vertices}, samples {points}. `up` defaults to +y, `fov_y_deg` to 45, `emission`
// (number or rgb; for rectangles also an image file in the view's directory or below) to 1, `two_sided` to false.
#pragma once

#include <filesystem>
#include <string>

#include "halfshade/light.h"

namespace halfshade {

/// Throws Error{kBadInput}: "file: /lights/0/radius: what, value, allowed". Unknown keys are errors.
View load_view(const std::filesystem::path& file);

/// The same format; load_view gives back every bit. An emission image is named, not written.
std::string view_to_json(const View& view);

}  // namespace halfshade
