# SPDX-License-Identifier: BSD-2-Clause
"""Masks for a bag, which may loop:

ros2 bag play BAG --clock --loop

Name its topics by color:=, depth:=, camera_info:=.
"""
import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

DEFAULTS = {
    'color': '/camera/color/image_raw',
    'depth': '/camera/aligned_depth_to_color/image_raw',
    'camera_info': '/camera/color/camera_info',
    'use_sim_time': 'true',
}


def generate_launch_description():
    mask = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'mask.launch.py')
    return LaunchDescription(
        [DeclareLaunchArgument(name, default_value=value) for name, value in DEFAULTS.items()] +
        [IncludeLaunchDescription(PythonLaunchDescriptionSource(mask))])
