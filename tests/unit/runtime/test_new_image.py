"""Images that the scan makes without their constructors."""

import sys
from typing import Any

import pytest

from gantryctl._core import new_image
from gantryctl.image import DriveFeedback, DriveState, InputImage, OperatorCommand, OutputImage

FEEDBACK = DriveFeedback(DriveState.FAULT, 1.0, 2.0, 3.0, False, True, 0.5)


@pytest.mark.parametrize(
    "image",
    [FEEDBACK, OutputImage(vel_cmd_rad_s=2.5), InputImage(3, 0.003, FEEDBACK, OperatorCommand(), None)],
)
def test_it_is_what_the_constructor_makes(image: Any) -> None:
    made = new_image(type(image), *image)
    assert type(made) is type(image)
    assert made == image
    assert made._asdict() == image._asdict()


def test_it_owns_its_values_as_long_as_it_lives() -> None:
    value = object()
    before = sys.getrefcount(value)
    image = new_image(InputImage, 1, 0.0, value, value, None)
    assert sys.getrefcount(value) == before + 2
    del image
    assert sys.getrefcount(value) == before


@pytest.mark.parametrize("given", [(), (list, 1), (5, 1), ("InputImage",)])
def test_anything_but_a_named_tuple_is_refused(given: tuple[Any, ...]) -> None:
    make: Any = new_image
    with pytest.raises(TypeError, match="named tuple"):
        make(*given)
