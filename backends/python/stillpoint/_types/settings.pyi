# SPDX-License-Identifier: BSD-2-Clause
from typing import Any, Sequence, TypeVar

_T = TypeVar("_T")

class _Settings:
    def to_dict(self) -> dict[str, Any]: ...
    def __copy__(self: _T) -> _T: ...
    def __deepcopy__(self: _T, memo: object) -> _T: ...
    def __eq__(self, other: object) -> bool: ...

class SegmentationCompensatorSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    trigger: str
    area_ratio: float
    history: int
    corner_history: bool
    use_depth: bool
    search_px: int
    min_template_score: float
    min_depth_support: float
    max_restored_frames: int
    sharp_px: float
    max_prediction_s: float
    max_unnamed_s: float
    sudden_share: float
    sudden_results: int
    max_speed_m_s: float
    @staticmethod
    def paper(**changes: Any) -> SegmentationCompensatorSettings: ...

class DepthMaskFuserSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    method: str
    cell_px: int
    range_m: float
    growth_m: float
    dilation_px: int
    dilation_per_blur_px: float
    seed: int
    @staticmethod
    def paper(**changes: Any) -> DepthMaskFuserSettings: ...

class KeypointFilterSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    radius_px: float
    weight: float
    decay_per_px: float
    threshold: float
    min_kept: int
    @staticmethod
    def paper(**changes: Any) -> KeypointFilterSettings: ...

class MoverDetectorSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    min_moved_cells: int
    min_moved_area_m2: float
    min_moved_share: float
    growth_m: float
    max_open_share: float

class MotionCheckSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    block_px: int
    movers: MoverDetectorSettings

class EgoMotionSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    measure: bool
    max_step_m: float
    max_rotation_deg: float
    max_doubt: float
    jump_m: float
    jump_rad: float

class LateSegmentationSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    predict: bool
    max_age_s: float
    widen_after_s: float
    widen_px_per_s: float

class BlurMeterSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    exposure_s: float

class ObjectTrackerSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    max_lost_s: float
    velocity_m_s: float
    acceleration_m_s2: float
    centroid_m: float

class SensorModel(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    depth_floor_m: float
    depth_slope: float
    depth_square: float
    depth_systematic: float
    sigmas: float
    delay_s: float
    readout_s: float
    min_range_m: float
    max_range_m: float
    @staticmethod
    def kinect_v1(**changes: Any) -> SensorModel: ...
    @staticmethod
    def time_of_flight(**changes: Any) -> SensorModel: ...
    @staticmethod
    def realsense_d400(**changes: Any) -> SensorModel: ...
    @staticmethod
    def exact(**changes: Any) -> SensorModel: ...

class FrontEndSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    compensation: SegmentationCompensatorSettings
    depth: DepthMaskFuserSettings
    probability: KeypointFilterSettings
    motion: MotionCheckSettings
    ego: EgoMotionSettings
    late: LateSegmentationSettings
    blur: BlurMeterSettings
    objects: ObjectTrackerSettings
    sensor: SensorModel
    use_compensation: bool
    use_depth: bool
    use_probability: bool
    use_motion: bool
    large_mask_share: float
    @property
    def dynamic_classes(self) -> tuple[tuple[str, float], ...]: ...
    @dynamic_classes.setter
    def dynamic_classes(self, value: Sequence[str | tuple[str, float]]) -> None: ...
    @staticmethod
    def network_only(**changes: Any) -> FrontEndSettings: ...
    @staticmethod
    def preset(name: str, **changes: Any) -> FrontEndSettings: ...
    @staticmethod
    def with_motion(**changes: Any) -> FrontEndSettings: ...
    @staticmethod
    def paper(**changes: Any) -> FrontEndSettings: ...

class DenseMapSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    voxel_m: float
    stride_px: int
    min_depth_m: float
    max_depth_m: float
    edge_ratio: float
    carve: bool
    carve_margin_m: float
    carve_margin_per_m: float
    carve_frames: int

class RpeSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    delta_frames: int
    delta_s: float
    max_delta_error_s: float
    max_difference_s: float
    @staticmethod
    def tum(**changes: Any) -> RpeSettings: ...

class SyntheticSettings(_Settings):
    def __init__(self, **changes: Any) -> None: ...
    motion: str
    people: int
    seated: bool
    carried_object: bool
    movers: int
    frames: int
    fps: float
    shutter_s: float
    width: int
    height: int
    seed: int
    start_s: float
    color_noise: float
