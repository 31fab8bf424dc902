// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// The one place of the version: CMake, pkg-config and stats.json read it from here.
#define STILLPOINT_VERSION_MAJOR 0
#define STILLPOINT_VERSION_MINOR 1
#define STILLPOINT_VERSION_PATCH 0
#define STILLPOINT_VERSION "0.1.0"
