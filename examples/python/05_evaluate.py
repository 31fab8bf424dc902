# SPDX-License-Identifier: BSD-2-Clause
"""Judges a trajectory as evo does: 05_evaluate.py GROUNDTRUTH.txt ESTIMATE.txt.

evo_ape tum GROUNDTRUTH.txt ESTIMATE.txt --align gives the same figures. Traps: evo pairs poses
within 0.01 s, the TUM benchmark within 0.02 s; evo does not align unless it is told to; and a low
error means little without the coverage, which evo does not state.
"""
import sys

import stillpoint

truth, estimate = map(stillpoint.Trajectory.read, sys.argv[1:3])
error = stillpoint.ate(truth, estimate, max_difference_s=0.01)
print(f"ATE  rmse {error.rmse_m:.6f}  mean {error.mean_m:.6f}  median {error.median_m:.6f}")
print(f"     std  {error.sd_m:.6f}  min  {error.min_m:.6f}  max    {error.max_m:.6f}  (metres)")
step = stillpoint.rpe(truth, estimate)
print(f"RPE  {step.translation_m.rmse:.6f} m, {step.rotation_deg.rmse:.4f} deg per frame (rmse)")
print(f"coverage {100 * stillpoint.coverage(truth, estimate).share:.1f} %")
