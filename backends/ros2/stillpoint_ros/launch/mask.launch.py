# SPDX-License-Identifier: BSD-2-Clause
"""The mask node for any camera; realsense, orbbec, azure_kinect and bag call it with their topics.

ros2 launch stillpoint_ros mask.launch.py color:=/camera/color/image_raw \
    depth:=/camera/aligned_depth_to_color/image_raw camera_info:=/camera/color/camera_info

to:=rtabmap, to:=nvblox publish under the names that these read.
"""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = [
    ('color', 'color/image', 'color images'),
    ('depth', 'depth/image', 'depth images, registered to color'),
    ('camera_info', 'color/camera_info', 'calibration of the color camera'),
    ('labels', 'labels', 'label images of a network'),
    ('detections', 'detections', 'boxes of a detector'),
    ('odometry', 'odometry', 'read with poses:=odometry'),
    ('namespace', 'stillpoint', 'of the node and what it publishes'),
    ('sensor', 'kinect_v1', 'kinect_v1, realsense_d400, time_of_flight, exact'),
    ('poses', 'none', 'none, tf, odometry'),
    ('color_transport', 'raw', 'raw, compressed, ...'),
    ('depth_transport', 'raw', 'raw, compressedDepth, ...'),
    ('use_sim_time', 'false', 'for bags and simulations'),
    ('to', 'none', 'none, rtabmap, nvblox'),
    ('params_file', '', 'YAML file with more parameters'),
]

# What is published -> the name that the reader gives it.
READERS = {
    'none': {},
    'rtabmap': {'depth_static': '/rtabmap/depth/image'},
    'nvblox': {'mask': '/camera_0/mask/image', 'camera_info': '/camera_0/mask/camera_info'},
}


def make_node(context):
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    if value['to'] not in READERS:
        raise RuntimeError(f"to: expected one of {', '.join(READERS)}, found '{value['to']}'")
    inputs = {'color/image': 'color', 'depth/image': 'depth', 'color/camera_info': 'camera_info',
              'labels': 'labels', 'detections': 'detections', 'odometry': 'odometry'}
    remappings = [(ours, value[argument]) for ours, argument in inputs.items()]
    remappings += READERS[value['to']].items()
    parameters = [{
        'sensor': value['sensor'],
        'poses': value['poses'],
        'color_transport': value['color_transport'],
        'depth_transport': value['depth_transport'],
        'use_sim_time': value['use_sim_time'].lower() == 'true',
    }]
    if value['params_file']:
        parameters.append(value['params_file'])
    return [Node(package='stillpoint_ros', executable='stillpoint_mask_node', name='stillpoint',
                 namespace=value['namespace'], remappings=remappings, parameters=parameters,
                 output='screen')]


def generate_launch_description():
    arguments = [DeclareLaunchArgument(name, default_value=default, description=text)
                 for name, default, text in ARGUMENTS]
    return LaunchDescription(arguments + [OpaqueFunction(function=make_node)])
