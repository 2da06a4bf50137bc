"""A drive, a program, a truth and a time that tests can steer and read."""

from collections.abc import Callable

from gantryctl.image import DriveFeedback, DriveIdentity, DriveRequest, DriveState, InputImage, OutputImage


class FakeDrive:
    """Its plant is a counter: one count per write, so that feedback k = writes before it."""

    def __init__(self) -> None:
        self.outputs: list[OutputImage] = []
        self.speed_rad_s = 0.0
        self.silent_from: int | None = None
        self.closed = 0

    def identity(self) -> DriveIdentity:
        return DriveIdentity("fake", "serial", 4096, 4096)

    def read(self) -> DriveFeedback:
        return DriveFeedback(
            DriveState.OPERATION_ENABLED, len(self.outputs), self.speed_rad_s, 0.0, True, False, 0.0
        )

    def write(self, output: OutputImage) -> None:
        if self.silent_from is not None and len(self.outputs) >= self.silent_from:
            raise OSError("bus is gone")
        self.outputs.append(output)

    def close(self) -> None:
        self.closed += 1


class FakeTruth:
    truth_columns = ("pos_load_rad",)

    def __init__(self, drive: FakeDrive) -> None:
        self.drive = drive

    def truth(self) -> tuple[float, ...]:
        return (float(len(self.drive.outputs)),)


class FakeProgram:
    """Enables the drive and commands the scan number; does what `hooks[scan]` says first."""

    trace_columns = ("pos_act_counts", "vel_cmd_rad_s")

    def __init__(self) -> None:
        self.images: list[InputImage] = []
        self.hooks: dict[int, Callable[[], object]] = {}

    def scan(self, image: InputImage) -> OutputImage:
        self.images.append(image)
        self.hooks.get(image.scan, lambda: None)()
        return OutputImage(DriveRequest.ENABLE, float(image.scan), 0.0, True)

    def trace_row(self) -> tuple[float, ...]:
        image = self.images[-1]
        return (image.drive.pos_act_counts, float(image.scan))


class FakeTime:
    """A monotonic clock that moves only when someone sleeps or a test says so."""

    def __init__(self, now_s: float = 5_000.0) -> None:
        self.now_s = now_s
        self.slept_s: list[float] = []

    def now(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.slept_s.append(seconds)
        self.now_s += seconds

    def work(self, seconds: float) -> None:
        self.now_s += seconds


def raising(error: BaseException) -> Callable[[], object]:
    """A hook that raises."""

    def hook() -> None:
        raise error

    return hook
