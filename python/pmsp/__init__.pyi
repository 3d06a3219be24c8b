# SPDX-License-Identifier: BSD-2-Clause
"""Dense 3D from 360-degree video: the interface of libpmsp in Python.

Names, units, defaults and errors are those of the C++ headers. Images are arrays, rows from top to bottom. Arrays of results
are read-only views that keep their owner alive. Calls that compute or block release the GIL. An object serves one call at a
time, unless its class says otherwise; else Error. Exceptions of callbacks, KeyboardInterrupt too, leave the call.
"""
from os import PathLike
from typing import Any, Callable, ClassVar, Dict, Final, List, Optional, Sequence, Set, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Path = Union[str, PathLike[str]]

__version__: str

# ---- errors ----

class Error(RuntimeError):
    """Base of the exceptions of libpmsp. Messages contain subject, expectation and remedy."""

class InvalidOption(Error):
    """Option with an invalid value: field, value and range."""

class InvalidInput(Error):
    """Invalid input: a damaged map, an image of the wrong size, a pose that is no rotation."""

class IoError(Error):
    """File that cannot be opened, read or decoded."""

class OutputError(Error):
    """File that cannot be written. No incomplete file remains."""

class DeviceError(Error):
    """Failed GPU call or allocation. The object must not be used again."""

class BackendUnavailable(Error):
    """Backend that is not built in, not supported by the machine, or has too little memory."""

# ---- records of arrays ----

CloudPoint: np.dtype[np.void]
"""position (3 float32) and normal (3 float32, unit, facing the camera) in the frame of the container, color (3 uint8),
views (uint8, keyframes with agreeing depth maps), confidence (float32, 0 to 1)."""

OutputPoint: np.dtype[np.void]
"""position (3 float64), normal (3 float32), confidence (float32), keyframe_id (int64), pixel (uint32, row x width + column),
agree (uint32), color (3 uint8), views (uint8), in the frame of a file."""

Landmark: np.dtype[np.void]
"""id (int64, common to all keyframes that observe it), position_world (3 float64) [map units]."""

MapLandmark: np.dtype[np.void]
"""As Landmark."""

MapObservation: np.dtype[np.void]
"""landmark_id (int64), pixel (2 float32), x right and y down; the centre of the first pixel is (0.5, 0.5)."""

# ---- options ----

class _Enumeration:
    __members__: ClassVar[Any]
    def __init__(self, value: int) -> None: ...
    def __int__(self) -> int: ...
    def __index__(self) -> int: ...
    def __hash__(self) -> int: ...
    def __eq__(self, other: object) -> bool: ...
    def __ne__(self, other: object) -> bool: ...
    name: Final[str]
    value: Final[int]

class Quality(_Enumeration):
    """Presets: time per depth map against detail."""

    PAPER: ClassVar[Quality]
    ONLINE: ClassVar[Quality]
    NORMAL: ClassVar[Quality]
    HIGH: ClassVar[Quality]

class Backend(_Enumeration):
    AUTO: ClassVar[Backend]
    CPU: ClassVar[Backend]
    CUDA: ClassVar[Backend]

class Simd(_Enumeration):
    AUTO: ClassVar[Simd]
    SCALAR: ClassVar[Simd]
    AVX2: ClassVar[Simd]
    AVX512: ClassVar[Simd]

def quality_from_name(name: str) -> Quality:
    """Accepts "paper", "online", "normal", "high". Raises InvalidOption."""

def backend_from_name(name: str) -> Backend:
    """Accepts "auto", "cpu", "cuda". Raises InvalidOption."""

def simd_from_name(name: str) -> Simd:
    """Accepts "auto", "scalar", "avx2", "avx512". Raises InvalidOption."""

def preset(quality: Quality) -> DensifierOptions:
    """Returns the options of a preset."""

class ViewFilterOptions:
    """Selection of keyframes that get a depth map."""

    enabled: bool
    min_parallax_deg: float
    max_parallax_deg: float
    min_share: float
    min_sharpness: float
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class InitOptions:
    """Initial planes of PatchMatch."""

    sparse_points: bool
    sparse_radius_px: float
    warp_previous: bool
    chain_keyframes: int
    range_margin: float
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class PatchMatchOptions:
    """Red-black PatchMatch on the sphere."""

    iterations: int
    neighbours: int
    refinements: int
    fine_patch: float
    image_scale: float
    sigma_color: float
    min_sigma_color: float
    plane_priors: bool
    geometric_passes: int
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class MedianFilterOptions:
    """Removal of outliers and correction of depth edges."""

    enabled: bool
    max_relative_deviation: float
    min_score: float
    weighted: bool
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class ConsistencyFilterOptions:
    """Agreement of depth maps."""

    enabled: bool
    window: int
    min_views: int
    max_relative_depth: float
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class FusionOptions:
    """Fusion of depth maps into points, and duplicate removal."""

    window: int
    spacing_px: float
    max_relative_depth: float
    max_normal_deg: float
    min_confidence: float
    suppression: float
    history: int
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class FreeSpaceOptions:
    """Removal of points that other depth maps see through."""

    enabled: bool
    views: int
    max_relative_depth: float
    min_relative_gap: float
    max_contradiction: float
    mirrors: bool
    whole_mission: bool
    history: int
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class AdvancedOptions:
    """Options of the stages; pmsp/advanced.h and `pmsp-densify --help-all` describe each."""

    view_filter: ViewFilterOptions
    init: InitOptions
    patchmatch: PatchMatchOptions
    median: MedianFilterOptions
    consistency: ConsistencyFilterOptions
    fusion: FusionOptions
    free_space: FreeSpaceOptions
    pipelined: bool
    expected_keyframes: int
    def __init__(self) -> None: ...

class DensifierOptions:
    """Options of a Densifier, by default those of Quality.ONLINE."""

    width: int
    """Of the depth maps [px], even, 32 to 16384. 0 = by the height or the images."""
    height: int
    """Of the depth maps [px], even, 16 to 8192. 0 = by the images."""
    seed: int
    """Same input, seed, backend and simd give the same bytes."""
    backend: Backend
    devices: List[int]
    """CUDA devices, at most 16; empty = all. A copy: assign a list to change it."""
    threads: int
    """1 to 1024; 0 = one per CPU."""
    simd: Simd
    scratch_folder: str
    """Existing directory for temporary data; "" = in memory."""
    lens_distance: float
    """Between the camera's two lens centres along its forward axis [map units]; 0 = one centre."""
    unordered: bool
    """No temporal order, as of photos."""
    advanced: AdvancedOptions
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

# ---- poses ----

class RigidTransform:
    """target_from_source: x_target = rotation * x_source + translation."""

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3), orthonormal, determinant +1; read-only: assign to change it."""
    @rotation.setter
    def rotation(self, value: ArrayLike) -> None: ...
    @property
    def translation(self) -> NDArray[np.float64]:
        """(3,) [map units]; read-only: assign to change it."""
    @translation.setter
    def translation(self, value: ArrayLike) -> None: ...
    @overload
    def __init__(self) -> None: ...
    @overload
    def __init__(self, rotation: ArrayLike, translation: ArrayLike) -> None: ...
    def inverse(self) -> RigidTransform: ...
    def center(self) -> NDArray[np.float64]:
        """Origin of the target frame in the source frame; of cam_from_world the camera centre."""
    @overload
    def __mul__(self, other: RigidTransform) -> RigidTransform: ...
    @overload
    def __mul__(self, other: ArrayLike) -> NDArray[np.float64]: ...
    def __eq__(self, other: object) -> bool: ...

class KeyframePose:
    """Pose and unit of a keyframe: a point X of its frame is at world_from_cam * (scale * X)."""

    cam_from_world: RigidTransform
    scale: float
    @overload
    def __init__(self) -> None: ...
    @overload
    def __init__(self, cam_from_world: RigidTransform, scale: float = 1.0) -> None: ...
    def __eq__(self, other: object) -> bool: ...

class Similarity:
    """target_from_source: x_target = scale * rotation * x_source + translation."""

    scale: float
    @property
    def rotation(self) -> NDArray[np.float64]: ...
    @rotation.setter
    def rotation(self, value: ArrayLike) -> None: ...
    @property
    def translation(self) -> NDArray[np.float64]: ...
    @translation.setter
    def translation(self, value: ArrayLike) -> None: ...
    @overload
    def __init__(self) -> None: ...
    @overload
    def __init__(self, scale: float, rotation: ArrayLike, translation: ArrayLike) -> None: ...
    def is_identity(self) -> bool: ...
    @overload
    def __mul__(self, other: Similarity) -> Similarity: ...
    @overload
    def __mul__(self, other: RigidTransform) -> RigidTransform: ...
    @overload
    def __mul__(self, other: ArrayLike) -> NDArray[np.float64]: ...

def rigid_transform(matrix: ArrayLike) -> RigidTransform:
    """Converts a (4, 4) pose matrix; its bottom row is ignored."""

def cam_from_slam_cam(image_width: int) -> RigidTransform:
    """Correction of poses of OpenVSLAM and stella_vslam: cam_from_slam_cam(width) * rigid_transform(pose_cw)."""

def bearing_from_pixel(pixels: ArrayLike, width: int, height: int) -> NDArray[np.float64]:
    """(n, 2) points of an equirectangular image to (n, 3) unit bearings. Pixel (i, j) has its centre at (i + 0.5, j + 0.5)."""

def pixel_from_bearing(directions: ArrayLike, width: int, height: int) -> NDArray[np.float64]:
    """(n, 3) directions to (n, 2) points in [0, width) x [0, height]."""

# ---- keyframes and results ----

class Keyframe:
    """Keyframe of a SLAM. Camera axes: x right, y down, z forward.

    Setters of images refer to the array, without a copy: TypeError for another dtype, ValueError for another shape or pixels
    that are not contiguous in a row. They must not change during Densifier.add.
    """

    id: int
    timestamp: float
    """[s]"""
    cam_from_world: RigidTransform
    """Translation in map units; poses of stella_vslam need cam_from_slam_cam."""
    @property
    def landmarks(self) -> NDArray[np.void]:
        """Observed landmarks, (n,) of Landmark, a copy; empty = no depth map."""
    @landmarks.setter
    def landmarks(self, value: ArrayLike) -> None: ...
    image: Optional[NDArray[np.uint8]]
    """(height, width, 3), red, green, blue; even width >= 16, even height >= 8."""
    mask: Optional[NDArray[np.uint8]]
    """(height, width) of the image, 0 = ignored; None = all used."""
    prior_depth: Optional[NDArray[np.float32]]
    """(height, width), along the rays [map units]; 0 or not finite = none."""
    pose_error: float
    """Expected error of directions due to the pose [rad]."""
    scale: float
    """Unit of the results in map units."""
    def __init__(self) -> None: ...
    def pose(self) -> KeyframePose: ...

class DepthMap:
    """Full-sphere images of one size."""

    keyframe_id: Final[int]
    cam_from_world: Final[RigidTransform]
    depth: Final[NDArray[np.float32]]
    """(height, width), distance along the ray [keyframe's unit]; 0 = none."""
    normal: Final[NDArray[np.float32]]
    """(height, width, 3), unit, camera frame, facing the camera; 0 where depth is 0."""
    confidence: Final[NDArray[np.float32]]
    """(height, width), 0 to 1: expected relative error of 0.5 % * (1 - c) / c."""
    scale: Final[float]

class KeyframeCloud:
    """Points of a keyframe in its camera frame."""

    keyframe_id: Final[int]
    cam_from_world: Final[RigidTransform]
    scale: Final[float]
    def pose(self) -> KeyframePose: ...
    points: Final[NDArray[np.void]]
    """(n,) of CloudPoint."""
    pixels: Final[NDArray[np.uint32]]
    """(n,), row x width + column, ascending; empty = unknown."""
    agree: Final[NDArray[np.uint32]]
    """(n,), bit k: the depth map of keyframe window_ids[k] agrees; empty = unknown."""
    window_ids: Final[NDArray[np.int64]]

def transform_points(cloud: KeyframeCloud, pose: KeyframePose) -> NDArray[np.void]:
    """Returns the points in world coordinates, (n,) of CloudPoint."""

# ---- densifier ----

class DensifierStats:
    """Numbers of keyframes, pixels and points so far, and the time of each stage [s]."""

    keyframes_added: Final[int]
    keyframes_accepted: Final[int]
    keyframes_rejected: Final[int]
    keyframes_blurred: Final[int]
    depth_maps: Final[int]
    keyframes_without_neighbour: Final[int]
    keyframes_without_range: Final[int]
    pixels: Final[int]
    pixels_matched: Final[int]
    pixels_after_median: Final[int]
    pixels_after_consistency: Final[int]
    pixels_far: Final[int]
    points_fused: Final[int]
    points_repeated: Final[int]
    points: Final[int]
    work_done: Final[float]
    work_remaining: Final[float]
    seconds_prepare: Final[float]
    seconds_init: Final[float]
    seconds_patchmatch: Final[float]
    seconds_median: Final[float]
    seconds_consistency: Final[float]
    seconds_fusion: Final[float]
    seconds_free_space: Final[float]
    seconds_duplicates: Final[float]

class Densifier:
    """PatchMatch-Stereo-Panorama over keyframes in temporal order.

    Callbacks run inside add and flush, on the thread of the caller; they may call cancel, cancelled, stats, options and
    backend. Results of callbacks that are None are not computed. Ctrl-C raises KeyboardInterrupt after the running task.
    After any exception but InvalidInput the Densifier is cancelled.
    """

    def __init__(
        self,
        options: DensifierOptions,
        *,
        raw_depth: Optional[Callable[[DepthMap], object]] = None,
        filtered_depth: Optional[Callable[[DepthMap], object]] = None,
        cloud: Optional[Callable[[KeyframeCloud], object]] = None,
        progress: Optional[Callable[[], object]] = None,
    ) -> None:
        """Raises InvalidOption, BackendUnavailable."""
    def add(self, keyframe: Keyframe) -> bool:
        """Returns whether the view filter accepts the keyframe; False after cancel.

        Raises InvalidInput, with no effect, if image, mask, prior depth, pose or landmarks are invalid or the id was added
        before; DeviceError, BackendUnavailable, OutputError, IoError.
        """
    def flush(self) -> None:
        """Completes all pending keyframes. Raises DeviceError, OutputError, IoError."""
    def cancel(self) -> None:
        """Makes add or flush return at the next safe point. May be called from any thread."""
    def cancelled(self) -> bool: ...
    def stats(self) -> DensifierStats: ...
    def options(self) -> DensifierOptions:
        """In effect; sizes of 0 are replaced at the first add."""
    def backend(self) -> str: ...

# ---- live densifier ----

class PixelFormat(_Enumeration):
    RGB: ClassVar[PixelFormat]
    BGR: ClassVar[PixelFormat]
    GRAY: ClassVar[PixelFormat]

class LiveImage:
    """Image that refers to an array, without a copy. The array is kept alive and must not change."""

    def __init__(self, pixels: NDArray[np.uint8], format: PixelFormat = ...) -> None:
        """pixels: (height, width, 3), or (height, width) with PixelFormat.GRAY; raises as setters of Keyframe."""
    width: Final[int]
    height: Final[int]
    format: Final[PixelFormat]

class LiveKeyframe:
    """State of a keyframe, in frames and units of Keyframe. Image, prior depth, pose error: ignored in updates."""

    id: int
    cam_from_world: RigidTransform
    @property
    def landmarks(self) -> NDArray[np.void]:
        """(n,) of Landmark, a copy; empty in an update = unchanged."""
    @landmarks.setter
    def landmarks(self, value: ArrayLike) -> None: ...
    image: Optional[LiveImage]
    prior_depth: Optional[NDArray[np.float32]]
    """(height, width), copied; see Keyframe."""
    pose_error: float
    map_id: int
    """Keyframes of different maps never share points or depth."""
    def __init__(self) -> None: ...

class LiveOptions:
    """See pmsp/live.h."""

    densifier: DensifierOptions
    nice: int
    """Niceness added to the worker threads, 0 to 19."""
    calibrate_lenses: bool
    find_rig: bool
    previews: bool
    memory_mib: int
    """Maximum memory of images and depth maps [MiB]."""
    max_waiting: int
    stable_after: int
    stable_at_latest: int
    stable_move: float
    max_move_px: float
    mask: Optional[NDArray[np.uint8]]
    """(height, width), for all keyframes, copied; None = none."""
    def __init__(self) -> None: ...
    def validate(self) -> None:
        """Raises InvalidOption."""

class LiveCloud:
    """Points of a keyframe, to be drawn with `pose`."""

    keyframe_id: Final[int]
    map_id: Final[int]
    pose: Final[KeyframePose]
    cloud: Final[KeyframeCloud]
    """Shared and immutable."""
    preliminary: Final[bool]
    cloud_since: Final[int]
    pose_since: Final[int]

class LiveSnapshot:
    """Immutable state of a live map at one version."""

    version: Final[int]
    clouds: Final[List[LiveCloud]]
    """By ascending keyframe id."""

class LiveChanges:
    """Differences between the versions `from_` and `to`. Each keyframe is in at most one list."""

    from_: Final[int]
    to: Final[int]
    reset: Final[bool]
    """Remove all clouds first."""
    added: Final[List[LiveCloud]]
    replaced: Final[List[LiveCloud]]
    moved: Final[List[LiveCloud]]
    removed: Final[List[int]]
    def empty(self) -> bool: ...

class LiveStats:
    """Counts since construction, across resets."""

    added: Final[int]
    erased: Final[int]
    resets: Final[int]
    used: Final[int]
    not_needed: Final[int]
    dropped_late: Final[int]
    previews: Final[int]
    previews_late: Final[int]
    passes: Final[int]
    matched_again: Final[int]
    clouds: Final[int]
    rescaled: Final[int]
    images_dropped: Final[int]
    keyframes_frozen: Final[int]
    errors: Final[int]
    last_error: Final[str]
    failed: Final[bool]
    memory_mib: Final[int]
    lens_distance: Final[float]
    rig: Final[float]

class LiveBacklog:
    """Pending work, in keyframes."""

    unstable: Final[int]
    waiting: Final[int]
    refining: Final[int]
    idle: Final[bool]

class LiveDensifier:
    """Maintains the dense map of a running SLAM while keyframes are added, moved and removed.

    Calls return at once, except `wait`, and may be made from any thread. Callbacks run on a worker thread; their exceptions
    count as errors. A with statement, or the end of the program, ends the worker.
    """

    def __init__(
        self,
        options: LiveOptions = ...,
        *,
        changed: Optional[Callable[[int], object]] = None,
        on_error: Optional[Callable[[str], object]] = None,
    ) -> None:
        """Raises InvalidOption, BackendUnavailable, DeviceError."""
    def __enter__(self) -> LiveDensifier: ...
    def __exit__(self, *args: object) -> None:
        """Cancels work in progress; further calls raise Error. Raises Error in a callback."""
    def add(self, keyframe: LiveKeyframe) -> None:
        """Adds (with image) or updates a keyframe; ids ascending in time. Raises InvalidInput."""
    def update(self, keyframes: Sequence[LiveKeyframe]) -> None:
        """Sets pose and map id of existing keyframes, and landmarks unless empty. Raises InvalidInput."""
    def sync(self, keyframes: Sequence[LiveKeyframe]) -> None:
        """Sets the complete state of a SLAM that can only be polled. Raises InvalidInput."""
    def erase(self, ids: Sequence[int]) -> None: ...
    def reset(self) -> None: ...
    def pause(self) -> None: ...
    def resume(self) -> None: ...
    def finish(self) -> None:
        """Expects no more keyframes: pending ones are processed at once."""
    def wait(self, at_most: float) -> bool:
        """Blocks until the worker is idle or `at_most` [s] has elapsed. Returns whether it is idle."""
    def snapshot(self) -> LiveSnapshot: ...
    def changes_since(self, version: int) -> LiveChanges: ...
    def stats(self) -> LiveStats: ...
    def backlog(self) -> LiveBacklog: ...
    def backend(self) -> str: ...

# ---- maps and images ----

class MapCamera:
    """Equirectangular camera of a map."""

    name: Final[str]
    width: Final[int]
    height: Final[int]
    fps: Final[float]

class MapKeyframe:
    """Keyframe of a map; cam_from_world is corrected for pixel centres at index + 0.5."""

    id: Final[int]
    timestamp: Final[float]
    source_frame: Final[Optional[int]]
    camera: Final[int]
    cam_from_world: Final[RigidTransform]
    image: Final[str]
    mask: Final[PathLike[str]]
    prior_depth: Final[PathLike[str]]
    observations: Final[NDArray[np.void]]
    """(n,) of MapObservation."""

class SlamMap:
    """Map of a SLAM or a reconstruction."""

    path: Final[PathLike[str]]
    format: Final[str]
    cameras: Final[List[MapCamera]]
    keyframes: Final[List[MapKeyframe]]
    """Ascending id."""
    landmarks: Final[NDArray[np.void]]
    """(n,) of MapLandmark, ascending id."""
    observations_skipped: Final[int]
    observations_repeated: Final[int]
    images: Final[PathLike[str]]
    component: Final[int]
    component_keyframes: Final[List[int]]
    pixel_centers_at_integers: Final[bool]
    observations_are_measured: Final[bool]
    ids_are_row_numbers: Final[bool]
    masks_are_instances: Final[bool]
    notes: Final[List[str]]
    def find_keyframe(self, id: int) -> Optional[MapKeyframe]: ...

def read_map(
    path: _Path,
    *,
    component: Optional[int] = None,
    points: _Path = "",
    image_list: _Path = "",
    camera_from_body: _Path = "",
) -> SlamMap:
    """Reads a map in a format detected by content, see map_formats. Raises IoError, InvalidInput, InvalidOption."""

def map_formats() -> List[str]: ...
def keyframe_of(map: SlamMap, in_map: MapKeyframe) -> Keyframe:
    """Converts a keyframe of a map; image and mask stay None."""

class SkippedKeyframe:
    """Keyframe without a usable image."""

    keyframe_id: Final[int]
    reason: Final[str]

class ImageSource:
    """Sequential reader of the images of a map's keyframes. `iter(images.next, None)` delivers all."""

    class Item:
        keyframe_id: Final[int]
        image: Final[NDArray[np.uint8]]
        """(height, width, 3), red, green, blue."""

    class Origin:
        file: Final[PathLike[str]]
        frame: Final[str]
        def name(self) -> PathLike[str]:
            """The file, for a frame VIDEO/FRAME.jpg: a name for masks and prior depth."""

    def keyframe_ids(self) -> List[int]: ...
    def skipped(self) -> List[SkippedKeyframe]: ...
    def description(self) -> str: ...
    def next(self) -> Optional[ImageSource.Item]:
        """Returns the next image, None after the last one. Raises IoError, InvalidInput; further calls continue."""
    def origin(self, keyframe_id: int) -> ImageSource.Origin:
        """Raises InvalidInput if the id is not in keyframe_ids."""
    def read_ahead(self, images: int) -> None:
        """Sets the number of images decoded in advance; must precede next."""
    def restrict_to(self, keyframe_ids: Set[int]) -> None:
        """Must precede next."""
    def reopen(self) -> ImageSource:
        """Returns another source with the same pairing; must precede next. Raises IoError."""

def open_image_folder(
    map: SlamMap, folder: _Path, *, fps: float = 0.0, frame_offset: Optional[int] = None, allow_missing: bool = False
) -> ImageSource:
    """Pairs the images of a directory with keyframes. Raises IoError, InvalidInput."""

def open_video(
    map: SlamMap,
    video: _Path,
    *,
    fps: float = 0.0,
    frame_offset: Optional[int] = None,
    presentation_times: bool = False,
    allow_missing: bool = False,
) -> ImageSource:
    """Pairs the frames of a video with keyframes. Raises IoError, InvalidInput."""

class MaskSource:
    """Masks of images: a file or directory, those beside the images in the directory `images`, and caps [deg]."""

    def __init__(
        self,
        path: _Path = "",
        *,
        images: _Path = "",
        nadir_deg: float = 0.0,
        zenith_deg: float = 0.0,
        found: bool = True,
    ) -> None:
        """Raises InvalidOption, IoError, InvalidInput."""
    def mask_for(self, image: _Path, width: int, height: int) -> Optional[NDArray[np.uint8]]:
        """(height, width), 0 = ignored; None if all pixels are used. Raises IoError, InvalidInput."""

class CalibrationOptions:
    """Estimates of the camera."""

    lenses: bool
    """Distance of its two lenses."""
    rig: bool
    """Mask of camera mount, vehicle and operator."""
    def __init__(self, lenses: bool = True, rig: bool = True) -> None: ...

def densify(
    map: SlamMap,
    images: ImageSource,
    options: DensifierOptions,
    output: Optional[CloudOutput] = None,
    *,
    raw_depth: Optional[Callable[[DepthMap], object]] = None,
    filtered_depth: Optional[Callable[[DepthMap], object]] = None,
    cloud: Optional[Callable[[KeyframeCloud], object]] = None,
    masks: Optional[MaskSource] = None,
    prior_depth: _Path = "",
    image_folder: _Path = "",
    verify: bool = True,
    warning: Optional[Callable[[str], object]] = None,
    calibrate: CalibrationOptions = ...,
    progress: Optional[Callable[[int, int], object]] = None,
) -> DensifierStats:
    """Computes the points of a mission, as pmsp-densify: into `output`, which the caller commits, and the callbacks.

    masks: None = those of the map, alpha channels, and with `image_folder` files beside the images. progress: called after
    each keyframe with processed and expected number; False cancels. Callbacks as of Densifier.
    Raises InvalidInput if conventions, poses or pairing are wrong (`verify`) or no image can be read; as Densifier;
    OutputError.
    """

# ---- clouds and depth maps as files ----

class CloudUnit:
    """Unit of lengths of a cloud."""

    class Kind(_Enumeration):
        UNKNOWN: ClassVar[CloudUnit.Kind]
        MAP: ClassVar[CloudUnit.Kind]
        METRES: ClassVar[CloudUnit.Kind]

    kind: CloudUnit.Kind
    by: str
    def __init__(self) -> None: ...

class OutputView:
    """Image of a keyframe in a dataset."""

    keyframe_id: int
    timestamp: float
    cam_from_file: RigidTransform
    name: str
    """File name of the image, unique."""
    width: int
    height: int
    has_mask: bool
    def __init__(self) -> None: ...

class DatasetDepth:
    """Depth images of a dataset: distance from the camera centre, normals and confidence of each image."""

    png: bool
    exr: bool
    png_scale: float
    lens_distance: float
    def __init__(self) -> None: ...
    def is_wanted(self) -> bool: ...

class CloudHeader:
    """Cloud metadata."""

    generator: str
    comments: List[str]
    """A copy: assign a list to change it."""
    file_from_map: Similarity
    unit: CloudUnit
    @property
    def center(self) -> NDArray[np.float64]: ...
    @center.setter
    def center(self, value: ArrayLike) -> None: ...
    reach: float
    resolution: float
    double_positions: bool
    wkt: str
    year: int
    day_of_year: int
    @property
    def scratch(self) -> PathLike[str]: ...
    @scratch.setter
    def scratch(self, value: _Path) -> None: ...
    threads: int
    @property
    def export_views(self) -> Optional[Callable[[PathLike[str]], List[OutputView]]]:
        """For datasets: writes the images into `images` of the directory, masks into `masks`, and returns their cameras."""
    @export_views.setter
    def export_views(self, value: Optional[Callable[[PathLike[str]], List[OutputView]]]) -> None: ...
    dataset_points: int
    dataset_depth: DatasetDepth
    cameras: Dict[int, RigidTransform]
    """For maps for robots: file from camera, by keyframe id. A copy: assign a dict to change it."""
    cell_size: float
    """Side of the cells of maps for robots, > 0 [unit of the file], as all lengths below."""
    least_rays: int
    robot_height: float
    robot_step: float
    robot_slope_deg: float
    map_units: bool
    """Accept maps for robots in map units."""
    def __init__(self) -> None: ...

@overload
def cloud_header_of(map: SlamMap, options: DensifierOptions) -> CloudHeader:
    """Returns the header of pmsp-densify for a cloud in map units."""
@overload
def cloud_header_of(map: SlamMap, file_from_map: Similarity = ..., range_margin: float = ...) -> CloudHeader:
    """Returns a header with file_from_map, center, reach and cameras."""

class CloudOutput:
    """Output of points to a file or directory in the format of its extension, which appears with `commit`."""

    @overload
    def __init__(self, path: _Path) -> None: ...
    @overload
    def __init__(self, path: _Path, header: CloudHeader) -> None:
        """Raises InvalidOption if the extension is unknown; OutputError."""
    @overload
    def add(self, cloud: KeyframeCloud, pose: Optional[KeyframePose] = None) -> None: ...
    @overload
    def add(self, points: NDArray[np.void], file_from_points: Similarity) -> None:
        """points: (n,) of OutputPoint. Raises OutputError."""
    def add_depth(self, map: DepthMap) -> None:
        """Adds the depth map of a keyframe to datasets; densify with this output does."""
    def wants_depth(self) -> bool:
        """Whether add_depth has an effect."""
    def points_in(self) -> int:
        """Number of added points."""
    def points(self) -> int:
        """Number of written points."""
    def complete(self) -> None: ...
    def commit(self) -> None:
        """Replaces the target. Raises OutputError."""

class CloudInfo:
    """Metadata of a cloud."""

    format: Final[str]
    points: Final[int]
    has_normals: Final[bool]
    has_colors: Final[bool]
    has_confidence: Final[bool]
    has_views: Final[bool]
    double_positions: Final[bool]
    comments: Final[List[str]]
    file_from_map: Final[Optional[Similarity]]
    unit: Final[CloudUnit]
    wkt: Final[str]
    year: Final[int]
    day_of_year: Final[int]

class CloudReader:
    """Streaming reader of a cloud."""

    def info(self) -> CloudInfo: ...
    @overload
    def read(self) -> NDArray[np.void]: ...
    @overload
    def read(self, take: Callable[[NDArray[np.void]], object]) -> None:
        """Returns all points, (n,) of OutputPoint, or delivers them in blocks. Raises IoError, InvalidInput."""

def open_cloud(path: _Path) -> CloudReader:
    """Opens a PLY, LAS, Potree or dataset directory, or workspace. Raises IoError, InvalidInput."""

def read_pfm(path: _Path) -> NDArray[np.float32]:
    """(height, width). Raises IoError, InvalidInput."""

def read_pfm3(path: _Path) -> NDArray[np.float32]:
    """(height, width, 3). Raises IoError, InvalidInput."""

def write_pfm(path: _Path, image: NDArray[np.float32]) -> None:
    """(height, width) or (height, width, 3). Raises OutputError."""

class DepthFolder:
    """Directory of depth images: of --depth-maps, or named after those of `images`."""

    def __init__(self, folder: _Path, images: _Path) -> None:
        """Raises IoError, InvalidInput."""
    def is_indexed(self) -> bool: ...
    def file_for(self, keyframe_id: int, image: _Path) -> PathLike[str]:
        """Returns the depth image of a keyframe, an empty path if none."""
    def read(self, file: _Path) -> NDArray[np.float32]:
        """(height, width), 0 = none. Raises IoError, InvalidInput."""
    def read_normals(self, keyframe_id: int) -> Optional[NDArray[np.float32]]:
        """(height, width, 3); None = not stored."""
    def read_confidence(self, keyframe_id: int) -> Optional[NDArray[np.float32]]:
        """(height, width); None = not stored."""
    def png_scale(self) -> float: ...
    def kind(self) -> str: ...
    def lens_distance(self) -> float: ...
