// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <CLI/App.hpp>
#include <string>

namespace stillpoint::cli {

/// The command line as the user gave it, quoted for a shell; for the results that it makes.
std::string& command_line();

// Each adds one subcommand with its options; the command runs from the parser's callback and says
// what went wrong by throwing.
void add_synth_command(CLI::App& app);
void add_run_command(CLI::App& app);
void add_evaluate_command(CLI::App& app);
void add_mask_command(CLI::App& app);
void add_segment_command(CLI::App& app);
void add_bench_command(CLI::App& app);

}  // namespace stillpoint::cli
