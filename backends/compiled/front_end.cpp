// SPDX-License-Identifier: BSD-2-Clause
// The code of FrontEnd, for programs that link stillpoint::compiled.
#include "stillpoint/front_end_pipeline.hpp"
