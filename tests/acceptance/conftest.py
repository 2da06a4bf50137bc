"""Runs that several tests look at, made once."""

import numpy as np
import pytest

from acceptance.bench import Bench, ChordRun
from gantryctl.engineering.accuracy.job import AccuracyJob, accuracy_report
from gantryctl.engineering.accuracy.procedure.plan import chord_test
from gantryctl.engineering.accuracy.report.report import AccuracyReport
from gantryctl.machine import default_machine


@pytest.fixture(scope="session")
def bench() -> Bench:
    return Bench()


@pytest.fixture(scope="session")
def report() -> AccuracyReport:
    """The product's own accuracy job on the reference machine: chord test, noise and speed test."""
    return accuracy_report(default_machine(), AccuracyJob(chord_test(default_machine())), version="test")


@pytest.fixture(scope="session")
def reference(report: AccuracyReport) -> ChordRun:
    """The chord run of that job."""
    assert report.procedure is not None
    assert report.angle_errors_deg is not None
    load_rad = report.procedure.targets_rad + np.radians(report.angle_errors_deg)
    return ChordRun(default_machine(), report.procedure, load_rad)
