"""Fixtures for all tests: the models, the shared data (skipped where absent) and edited copies of the shipped cell."""

import os
import signal
from collections.abc import Callable, Mapping
from pathlib import Path

import casadi as ca
import pytest
import yaml
from hypothesis import HealthCheck, settings

from adaptive_flot.greybox.function_cache import forget_functions
from adaptive_flot.greybox.model import Model, Parameter, Quantity, Scope
from adaptive_flot.greybox.stepping.stepper import Stepper
from adaptive_flot.processes import flotation
from adaptive_flot.resources import cell_file
from tests.edits import edit

SHARED = Path(__file__).parents[1].parent / "shared"

# The same examples on every machine, and no verdict that depends on how fast it is.
settings.register_profile(
    "deterministic",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=15,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("deterministic")

# A suite in the background of a shell starts with SIGINT ignored, and every program that it starts would be, too.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """One worker more than there are cores: half the time of the live tests is waiting for a clock."""
    return (os.cpu_count() or 1) + 1


@pytest.fixture(autouse=True, scope="module")
def no_functions_of_the_module_before() -> None:
    """What a test finds does not depend on those that ran before it in other files."""
    forget_functions()


@pytest.fixture(scope="session")
def shared_file() -> Callable[[str], Path]:
    """Path of a file in the shared folder beside the repository; the test is skipped where it is absent."""

    def find(name: str) -> Path:
        file = SHARED / name
        if not file.is_file():
            pytest.skip(f"needs {file}, which lies beside a developer's checkout only")
        return file

    return find


@pytest.fixture(scope="session")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cache of compiled functions for all tests of a session, in all its processes; the user's stays as it is.

    A function of the cell takes the compiler up to ten seconds.
    """
    base = tmp_path_factory.getbasetemp()  # of one of several workers, in that of all
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "libraries" / "compiled"


@pytest.fixture(scope="session")
def model() -> Model:
    """The 87-litre flotation cell."""
    return flotation.make_model()


@pytest.fixture(scope="session")
def fast(model: Model) -> Stepper:
    """Default fast step of the cell over 1 s."""
    return Stepper(model, 1.0)


@pytest.fixture(scope="session")
def accurate(model: Model) -> Stepper:
    """Accurate step of the cell over 1 s."""
    return Stepper(model, 1.0, accurate=True)


@pytest.fixture(scope="session")
def write_cell(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Mapping[str, object]], Path]:
    """Write the shipped cell with entries changed by dotted path; `...` deletes, a new path adds."""

    def write(changes: Mapping[str, object]) -> Path:
        content = edit(yaml.safe_load(cell_file().read_text()), changes)
        file = tmp_path_factory.mktemp("cell") / "cell.yaml"
        file.write_text(yaml.safe_dump(content))
        return file

    return write


@pytest.fixture(scope="session")
def clock() -> Model:
    """dx/dt = k cos(t) + u, y = x + t: x = x0 + k (sin t - sin t0) + the integral of u."""

    def equations(m: Scope) -> None:
        m.derivative("x", m.parameter("k") * ca.cos(m.time) + m.input("u"))
        m.output("y", m.state("x") + m.time)

    return Model(
        name="clock",
        states=(Quantity("x", "-", ""),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(Parameter("k", 2.0, "-", ""),),
        outputs=(Quantity("y", "-", ""),),
        equations=equations,
    )


@pytest.fixture(scope="session")
def two_unknowns() -> Model:
    """dx/dt = -k b with a b = x^2 and b = a x, so a = x^0.5, b = x^1.5 and x = (x0^-0.5 + k t / 2)^-2."""

    def equations(m: Scope) -> None:
        x, a, b = m.state("x"), m.algebraic("a"), m.algebraic("b")
        m.residual("b", b - a * x, 1.001 * x**1.5)
        m.residual("a", a * b - x**2, 0.999 * x**0.5)
        m.derivative("x", -m.parameter("k") * b)
        m.output("y", b / a)

    return Model(
        name="two-unknowns",
        states=(Quantity("x", "-", "", 0.0),),
        inputs=(Quantity("u", "-", ""),),
        parameters=(Parameter("k", 0.5, "-", ""),),
        outputs=(Quantity("y", "-", ""),),
        algebraic=(Quantity("a", "-", "", 0.0), Quantity("b", "-", "", 0.0)),
        equations=equations,
    )
