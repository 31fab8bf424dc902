// SPDX-License-Identifier: BSD-2-Clause
#pragma once

/// Old name of image_file.hpp; gone in the next version.
#include "stillpoint/io/image_file.hpp"
