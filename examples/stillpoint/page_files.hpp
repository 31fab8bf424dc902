// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <string>

namespace stillpoint::cli {

// The files of page/, put into the program by CMakeLists.txt.
std::string page_template();
std::string page_table_template();
std::string page_chart_template();
std::string page_style();
std::string page_script();

/// Chart.js, or an empty string if it was not there when the program was built.
std::string chart_library();

}  // namespace stillpoint::cli
