// The geometry buffer is part of the public interface.
#pragma once

#include "halfshade/rasterizer.h"
