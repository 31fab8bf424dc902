# SPDX-License-Identifier: BSD-2-Clause
"""A mesh of the static scene by Open3D's TSDF: 03_static_tsdf.py SEQUENCE MESH.ply."""
import sys

import cv2
import numpy as np
import open3d as o3d
import stillpoint

sequence = stillpoint.TumSequence(sys.argv[1])
camera = sequence.camera
front_end = stillpoint.FrontEnd(camera)
slam = stillpoint.SlamSystem(camera)
volume = o3d.pipelines.integration.ScalableTSDFVolume(
    voxel_length=0.02,
    sdf_trunc=0.08,
    color_type=o3d.pipelines.integration.TSDFVolumeColorType.RGB8,
)
masks = {}
for frame in sequence:
    if slam.process(frame, front_end) is not None:
        masks[frame.timestamp] = front_end.mask
slam.finish()  # poses are final now
trajectory = slam.trajectory()
poses = dict(zip(trajectory.timestamps, trajectory.poses))
height, width = sequence[0].shape
intrinsic = o3d.camera.PinholeCameraIntrinsic(
    width, height, camera.fx, camera.fy, camera.cx, camera.cy
)
for frame in sequence:
    if frame.timestamp not in poses:
        continue
    depth = frame.depth_m()
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
o3d.io.write_triangle_mesh(sys.argv[2], volume.extract_triangle_mesh())
print(f"wrote {sys.argv[2]} from {len(poses)} frames")
