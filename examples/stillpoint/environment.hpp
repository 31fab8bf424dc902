// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <nlohmann/json.hpp>

namespace stillpoint::cli {

/// Program and library versions, and the machine, for stats and tables.
nlohmann::ordered_json versions_json();
nlohmann::ordered_json machine_json();

/// Peak memory since reset_peak_memory(), MB; NaN where the system does not say.
double peak_memory_mb();
void reset_peak_memory();

}  // namespace stillpoint::cli
