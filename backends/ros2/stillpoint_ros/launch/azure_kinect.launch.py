# SPDX-License-Identifier: BSD-2-Clause
"""Masks for an Azure Kinect; start its driver first:

ros2 launch azure_kinect_ros_driver driver.launch.py depth_mode:=NFOV_UNBINNED color_resolution:=720P fps:=30
"""
import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

DEFAULTS = {
    'color': '/rgb/image_raw',
    'depth': '/depth_to_rgb/image_raw',
    'camera_info': '/rgb/camera_info',
    'sensor': 'time_of_flight',
}


def generate_launch_description():
    mask = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'mask.launch.py')
    return LaunchDescription(
        [DeclareLaunchArgument(name, default_value=value) for name, value in DEFAULTS.items()] +
        [IncludeLaunchDescription(PythonLaunchDescriptionSource(mask))])
