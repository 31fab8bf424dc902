# SPDX-License-Identifier: BSD-2-Clause
"""Masks for a RealSense D4xx; start its driver first, with depth aligned to color:

ros2 launch realsense2_camera rs_launch.py align_depth.enable:=true enable_sync:=true
"""
import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

DEFAULTS = {
    'color': '/camera/camera/color/image_raw',
    'depth': '/camera/camera/aligned_depth_to_color/image_raw',
    'camera_info': '/camera/camera/color/camera_info',
    'sensor': 'realsense_d400',
}


def generate_launch_description():
    mask = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'mask.launch.py')
    return LaunchDescription(
        [DeclareLaunchArgument(name, default_value=value) for name, value in DEFAULTS.items()] +
        [IncludeLaunchDescription(PythonLaunchDescriptionSource(mask))])
