# SPDX-License-Identifier: BSD-2-Clause
"""Plots a run: the path, the share of the mask, the keypoints: 04_plot_run.py SEQUENCE OUT.png."""
import sys

import matplotlib

matplotlib.use("Agg")  # a file, no window
import matplotlib.pyplot as plt
import stillpoint

sequence = stillpoint.TumSequence(sys.argv[1])
front_end = stillpoint.FrontEnd(sequence.camera)
slam = stillpoint.SlamSystem(sequence.camera)
stats = []
for frame in sequence:
    slam.process(frame, front_end)
    stats.append(front_end.stats)
slam.finish()

figure, (path, share, keypoints) = plt.subplots(1, 3, figsize=(15, 4.5))
seconds = [s.timestamp - stats[0].timestamp for s in stats]
estimate = slam.trajectory()
positions = estimate.poses[:, :3, 3]
if sequence.has_groundtruth:
    truth = sequence.groundtruth()
    error = stillpoint.ate(truth, estimate)
    T = error.T_groundtruth_estimate
    positions = positions @ T[:3, :3].T + T[:3, 3]
    path.plot(truth.poses[:, 0, 3], truth.poses[:, 1, 3], color="0.7", label="ground truth")
    path.set_title(f"ATE {error.rmse_m:.4f} m (RMSE)")
path.plot(positions[:, 0], positions[:, 1], label="estimate")
path.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
path.legend()
share.plot(seconds, [100 * s.mask_share for s in stats])
share.set(xlabel="time (s)", ylabel="mask (% of the image)")
keypoints.plot(seconds, [s.keypoints for s in stats], label="extracted")
keypoints.plot(seconds, [s.kept for s in stats], label="kept")
keypoints.set(xlabel="time (s)", ylabel="keypoints", ylim=0)
keypoints.legend()
figure.tight_layout()
figure.savefig(sys.argv[2], dpi=100)
print(f"wrote {sys.argv[2]}")
