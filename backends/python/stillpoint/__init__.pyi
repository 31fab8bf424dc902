# SPDX-License-Identifier: BSD-2-Clause
# Types of the module; what each does is in its docstring: help(stillpoint.FrontEnd).
from stillpoint._enums import FrameStatus as FrameStatus
from stillpoint._enums import KeypointReason as KeypointReason
from stillpoint._types.settings import BlurMeterSettings as BlurMeterSettings
from stillpoint._types.settings import DenseMapSettings as DenseMapSettings
from stillpoint._types.settings import DepthMaskFuserSettings as DepthMaskFuserSettings
from stillpoint._types.settings import EgoMotionSettings as EgoMotionSettings
from stillpoint._types.settings import FrontEndSettings as FrontEndSettings
from stillpoint._types.settings import KeypointFilterSettings as KeypointFilterSettings
from stillpoint._types.settings import LateSegmentationSettings as LateSegmentationSettings
from stillpoint._types.settings import MotionCheckSettings as MotionCheckSettings
from stillpoint._types.settings import MoverDetectorSettings as MoverDetectorSettings
from stillpoint._types.settings import ObjectTrackerSettings as ObjectTrackerSettings
from stillpoint._types.settings import RpeSettings as RpeSettings
from stillpoint._types.settings import (
    SegmentationCompensatorSettings as SegmentationCompensatorSettings,
)
from stillpoint._types.settings import SensorModel as SensorModel
from stillpoint._types.settings import SyntheticSettings as SyntheticSettings
from stillpoint._types.frames import Camera as Camera
from stillpoint._types.frames import DepthScaleCheck as DepthScaleCheck
from stillpoint._types.frames import Error as Error
from stillpoint._types.frames import Instance as Instance
from stillpoint._types.frames import RgbdFrame as RgbdFrame
from stillpoint._types.frames import Segmentation as Segmentation
from stillpoint._types.frames import Trajectory as Trajectory
from stillpoint._types.frames import check_depth_scale as check_depth_scale
from stillpoint._types.frames import instances_from_labels as instances_from_labels
from stillpoint._types.frames import labels_from_instances as labels_from_instances
from stillpoint._types.frames import mask_from_instances as mask_from_instances
from stillpoint._types.front_end import DepthMaskFuser as DepthMaskFuser
from stillpoint._types.front_end import FrameStats as FrameStats
from stillpoint._types.front_end import FrontEnd as FrontEnd
from stillpoint._types.front_end import ProbabilisticKeypointFilter as ProbabilisticKeypointFilter
from stillpoint._types.front_end import SegmentationCompensator as SegmentationCompensator
from stillpoint._types.front_end import Segmenter as Segmenter
from stillpoint._types.front_end import Selection as Selection
from stillpoint._types.front_end import compact as compact
from stillpoint._types.front_end import status_names as status_names
from stillpoint._types.objects import DynamicObject as DynamicObject
from stillpoint._types.objects import ObjectState as ObjectState
from stillpoint._types.objects import dynamic_probability as dynamic_probability
from stillpoint._types.objects import dynamic_probability_at as dynamic_probability_at
from stillpoint._types.objects import feature_mask as feature_mask
from stillpoint._types.objects import masked_depth as masked_depth
from stillpoint._types.objects import static_image as static_image
from stillpoint._types.systems import ColoredPoints as ColoredPoints
from stillpoint._types.systems import DenseMap as DenseMap
from stillpoint._types.systems import DetectionThread as DetectionThread
from stillpoint._types.systems import MaskFilesSegmenter as MaskFilesSegmenter
from stillpoint._types.systems import OpenCvDnnSegmenter as OpenCvDnnSegmenter
from stillpoint._types.systems import SlamSystem as SlamSystem
from stillpoint._types.systems import SyntheticFrame as SyntheticFrame
from stillpoint._types.systems import SyntheticSequence as SyntheticSequence
from stillpoint._types.systems import TrackedFrame as TrackedFrame
from stillpoint._types.systems import Tracker as Tracker
from stillpoint._types.systems import TumSequence as TumSequence
from stillpoint._types.systems import read_color as read_color
from stillpoint._types.systems import read_depth as read_depth
from stillpoint._types.systems import read_labels as read_labels
from stillpoint._types.systems import read_mask as read_mask
from stillpoint._types.systems import run_sequence as run_sequence
from stillpoint._types.systems import write_mask as write_mask
from stillpoint._types.evaluation import AteResult as AteResult
from stillpoint._types.evaluation import BinaryCounts as BinaryCounts
from stillpoint._types.evaluation import Coverage as Coverage
from stillpoint._types.evaluation import ErrorStatistics as ErrorStatistics
from stillpoint._types.evaluation import GhostCounter as GhostCounter
from stillpoint._types.evaluation import GhostCounts as GhostCounts
from stillpoint._types.evaluation import MaskMetrics as MaskMetrics
from stillpoint._types.evaluation import RpeResult as RpeResult
from stillpoint._types.evaluation import associate as associate
from stillpoint._types.evaluation import ate as ate
from stillpoint._types.evaluation import camera_of_bonn_body as camera_of_bonn_body
from stillpoint._types.evaluation import compare_keypoints as compare_keypoints
from stillpoint._types.evaluation import compare_masks as compare_masks
from stillpoint._types.evaluation import coverage as coverage
from stillpoint._types.evaluation import median_interval as median_interval
from stillpoint._types.evaluation import rpe as rpe

__all__: list[str]
__version__: str
