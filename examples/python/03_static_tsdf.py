# SPDX-License-Identifier: BSD-2-Clause
"""A mesh of the static scene by Open3D's TSDF: 03_static_tsdf.py SEQUENCE MESH.ply [--everybody].

Uses the masks of a network in SEQUENCE/masks, if they are there. Trap: whom the network misses at
first is found once he has moved, and a TSDF does not forget: the first second is left out.
--everybody: without the front end, for comparison. Of a sequence with true masks of people
(masks_gt/) and true poses it counts the ghosts: vertices where only people ever were.
"""
import pathlib
import sys

import cv2
import numpy as np
import open3d as o3d
import stillpoint

everybody = "--everybody" in sys.argv
folder, mesh_file = [argument for argument in sys.argv[1:] if argument != "--everybody"]
sequence = stillpoint.TumSequence(folder)
camera = sequence.camera
masks_of_network = pathlib.Path(folder, "masks")
segmenter = None
if masks_of_network.is_dir():
    segmenter = stillpoint.MaskFilesSegmenter(masks_of_network, sequence)
front_end = None if everybody else stillpoint.FrontEnd(camera, segmenter)
slam = stillpoint.SlamSystem(camera)
masks = {}
for frame in sequence:
    if slam.process(frame, front_end) is not None and front_end:
        masks[frame.timestamp] = front_end.mask
slam.finish()  # poses are final now
trajectory = slam.trajectory()
poses = dict(zip(trajectory.timestamps, trajectory.poses))

volume = o3d.pipelines.integration.ScalableTSDFVolume(
    voxel_length=0.02,
    sdf_trunc=0.08,
    color_type=o3d.pipelines.integration.TSDFVolumeColorType.RGB8,
)
height, width = sequence[0].shape
intrinsic = o3d.camera.PinholeCameraIntrinsic(
    width, height, camera.fx, camera.fy, camera.cx, camera.cy
)
integrated = 0
for frame in sequence:
    if frame.timestamp not in poses or frame.timestamp < sequence.timestamps[0] + 1:
        continue
    depth = frame.depth_m()
    if front_end:
        depth[masks[frame.timestamp] > 0] = 0
    color = cv2.cvtColor(frame.color, cv2.COLOR_BGR2RGB)
    image = o3d.geometry.RGBDImage.create_from_color_and_depth(
        o3d.geometry.Image(color),
        o3d.geometry.Image(depth),
        depth_scale=1.0,
        depth_trunc=4.0,
        convert_rgb_to_intensity=False,
    )
    # Trap: Open3D wants the inverse, world to camera.
    volume.integrate(image, intrinsic, np.linalg.inv(poses[frame.timestamp]))
    integrated += 1
mesh = volume.extract_triangle_mesh()
if not mesh.has_vertices():
    sys.exit(f"{folder}: expected a sequence that goes on after the first second, found none")
o3d.io.write_triangle_mesh(mesh_file, mesh)
print(f"wrote {mesh_file} from {integrated} frames")

true_masks = pathlib.Path(folder, "masks_gt")
if true_masks.is_dir() and sequence.has_groundtruth:
    truth = sequence.groundtruth()
    counter = stillpoint.GhostCounter()
    for i, k in stillpoint.associate(sequence.timestamps, truth.timestamps):
        frame = sequence[i]
        people = stillpoint.read_mask(true_masks / f"{sequence.stems[i]}.png", frame.shape)
        counter.add(frame, camera, people, truth.poses[k])
    error = stillpoint.ate(truth, trajectory)
    print("ghosts", counter.count(mesh.vertices, error.T_groundtruth_estimate))
