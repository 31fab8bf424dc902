# SPDX-License-Identifier: BSD-2-Clause
"""Masks for an Orbbec Gemini 330; start its driver first, with depth registered to color:

ros2 launch orbbec_camera gemini_330_series.launch.py depth_registration:=true

For a Femto (femto_bolt.launch.py), sensor:=time_of_flight.
"""
import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

DEFAULTS = {
    'color': '/camera/color/image_raw',
    'depth': '/camera/depth/image_raw',
    'camera_info': '/camera/color/camera_info',
    'sensor': 'realsense_d400',
}


def generate_launch_description():
    mask = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'mask.launch.py')
    return LaunchDescription(
        [DeclareLaunchArgument(name, default_value=value) for name, value in DEFAULTS.items()] +
        [IncludeLaunchDescription(PythonLaunchDescriptionSource(mask))])
